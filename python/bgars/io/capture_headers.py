"""What the headers of a capture's images say together, before a pixel is decoded."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from bgars.errors import FileFormatError
from bgars.io.image_formats import format_of
from bgars.io.image_tags import read_tags

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

__all__ = ["Headers", "read_headers"]

GAMMA_WITHIN = 0.01
"""Of 1: the roundings of writers, which turn a mid grey by less than one level of 255."""


class Headers(NamedTuple):
    """What the images of a capture have in common.

    Attributes
    ----------
    orientation : int
        As in EXIF, of all images.
    doubt : str
        Why the values may not be linear in light, as the beginning of a sentence; "" where no header speaks against it.
    with_alpha : tuple of Path
        Files with an opacity.
    with_extra : tuple of Path
        Files with a further channel that is none, and is not read.
    """

    orientation: int
    doubt: str
    with_alpha: tuple[Path, ...]
    with_extra: tuple[Path, ...]


def read_headers(paths: Sequence[Path], *, stack: bool) -> Headers:
    """Read the headers of all images.

    Raises
    ------
    FileFormatError
        A file is missing, no image, holds several images, or is turned another way than the first.
    """
    kinds = [format_of(path) for path in paths]
    tags = [read_tags(path, kind) for path, kind in zip(paths, kinds, strict=True)]
    for path, tag in zip(paths, tags, strict=True):
        if tag.pages > 1 and not stack:
            msg = (
                f"{path}: holds {tag.pages} images; one per light is expected (a stack of all lights is read if it is "
                "the only image file)"
            )
            raise FileFormatError(msg)
        if tag.orientation != tags[0].orientation:
            msg = (
                f"{path}: its orientation tag is {tag.orientation}, but that of {paths[0]} is {tags[0].orientation}: "
                "the camera turned them differently; export them without rotation"
            )
            raise FileFormatError(msg)
    doubted = [kind.name for kind in kinds if kind.lossy]
    doubted += [
        f"an image with a colour profile ({path.name})" for path, tag in zip(paths, tags, strict=True) if tag.profile
    ]
    doubted += [
        f"an image of gamma {tag.gamma:.3g} by its header ({path.name})"
        for path, tag in zip(paths, tags, strict=True)
        if abs(tag.gamma - 1.0) > GAMMA_WITHIN
    ]
    doubt = f"{doubted[0]} is hardly ever linear in light" if doubted else ""
    with_alpha = tuple(path for path, tag in zip(paths, tags, strict=True) if tag.alpha)
    with_extra = tuple(path for path, tag in zip(paths, tags, strict=True) if tag.extra)
    return Headers(tags[0].orientation, doubt, with_alpha, with_extra)
