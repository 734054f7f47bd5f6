"""The files of shape images: floats for programs, and one picture of them all."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from bgars.extras import missing
from bgars.io.atomic import atomic_file
from bgars.io.described_tiff import write_described

if TYPE_CHECKING:
    from os import PathLike

    from bgars.surface.shape_images import ShapeImages

__all__ = ["SHAPE_FILES", "SHAPE_PICTURE", "write_shape_images"]

SHAPE_PICTURE = "shape.png"
SHAPE_FILES = {
    SHAPE_PICTURE: "the picture to look at first: all four",
    "slope.tif": "angle between surface and image plane, float32, in degrees",
    "mean_curvature.tif": "half the sum of the principal curvatures, float32; domes negative, dents positive",
    "gaussian_curvature.tif": "product of the principal curvatures, float32; saddles negative",
    "flattened.tif": "heights minus the smoothed surface, float32: scratches, dents, texture",
}
"""Names of the files and what they hold."""


def write_shape_images(shape: ShapeImages, folder: str | PathLike[str]) -> dict[str, str]:
    """Write shape images as float TIFF files, and a picture of them all where matplotlib is installed.

    Parameters
    ----------
    shape : ShapeImages
        From :func:`bgars.shape_images`.
    folder : path
        An existing folder.

    Returns
    -------
    dict of str
        Names of the files and what they hold.

    Raises
    ------
    FileFormatError
        A file cannot be written.
    """
    place, unit = Path(folder), shape.unit
    images = {
        "slope.tif": (shape.slope_deg, "slope", "deg"),
        "mean_curvature.tif": (shape.mean_curvature, "mean curvature", f"1/{unit}"),
        "gaussian_curvature.tif": (shape.gaussian_curvature, "Gaussian curvature", f"1/{unit}^2"),
        "flattened.tif": (shape.flattened, "flattened heights", unit),
    }
    facts = {"scale_px": shape.scale_px, "pixel_pitch_um": shape.pixel_pitch_um}
    for name, (values, content, value_unit) in images.items():
        with atomic_file(place / name) as temporary:
            write_described(temporary, values, content, unit=value_unit, **facts)
    files = dict(SHAPE_FILES)
    if missing("matplotlib"):
        del files[SHAPE_PICTURE]
        return files
    from bgars.report.figures.shape_drawing import draw_shape  # noqa: PLC0415 - the extra "report"

    draw_shape(shape, place / SHAPE_PICTURE)
    return files
