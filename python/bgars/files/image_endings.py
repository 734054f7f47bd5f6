"""Which values in a table of lights are names of image files: whatever their column is called, they give the order."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeGuard

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["IMAGE_ENDINGS", "are_image_names"]

IMAGE_ENDINGS = (
    *(".png", ".tif", ".tiff", ".jpg", ".jpeg", ".bmp", ".pgm", ".ppm", ".pnm", ".webp", ".gif", ".exr", ".hdr"),
    *(".pfm", ".npy", ".tga", ".dng", ".nef", ".cr2", ".cr3", ".arw", ".raf", ".orf", ".rw2", ".pef", ".srw"),
    *(".heic", ".heif", ".avif", ".jp2", ".jxl", ".psd"),
)
"""Of images that are read, and of those that people convert first: an image is also found by its stem."""


def are_image_names(values: Sequence[Any]) -> TypeGuard[Sequence[str]]:
    """Whether some values are all names of image files, by their endings.

    Examples
    --------
    >>> are_image_names(["a.PNG", "C:/raw/b.nef"]), are_image_names(["LED 1", "a.png"]), are_image_names([])
    (True, False, False)
    """
    return len(values) > 0 and all(isinstance(each, str) and each.lower().endswith(IMAGE_ENDINGS) for each in values)
