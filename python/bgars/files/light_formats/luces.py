"""LED parameters of the LUCES data set (Mecca et al., BMVC 2021): near lights in the camera's frame."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bgars.errors import FileFormatError
from bgars.files.light_formats.columns import Style, as_number, data_lines
from bgars.files.light_formats.table import LightTable, checked_vectors
from bgars.files.safe_files import read_text

if TYPE_CHECKING:
    from pathlib import Path

__all__ = ["is_led_parameters", "read_led_parameters"]

HEADER = ("n_img", "mean_distance")
CAMERA_FIELDS = 7
POSITION, INTENSITY = slice(0, 3), slice(6, 9)
FIELDS = (10, 11)
PLAIN = Style(None, decimal_comma=False)


def is_led_parameters(path: Path) -> bool:
    """True for a file whose first line is the header of such parameters."""
    first = read_text(path).content.lstrip("#% ").partition("\n")[0].lower()
    return all(word in first for word in HEADER)


def read_led_parameters(path: Path) -> LightTable:
    """Read LED parameters: a header, ``N_img columns rows f x0 y0 mean_distance``, then a line per light.

    A line holds the position in mm, the principal axis, the red, green and blue intensity and the exponent of the
    emission. Axes as of the camera: x right, y down, z away from it. The emission pattern is not modelled, which is
    said.

    Raises
    ------
    FileFormatError
        Other lines, or another number of them.
    """
    lines = data_lines(read_text(path).content)
    if lines and all(word in lines[0].text.lower() for word in HEADER):
        lines = lines[1:]
    rows: list[list[float]] = []
    for line in lines:
        numbers = [as_number(field, PLAIN) for field in line.text.split()]
        expected = FIELDS if rows else (CAMERA_FIELDS,)
        if None in numbers or len(numbers) not in expected:
            what = "position, axis, intensity and exponent of an LED" if rows else "N_img columns rows f x0 y0 distance"
            msg = f"{path}: line {line.number} must hold {expected[0]} numbers ({what}), got {line.text[:100]!r}"
            raise FileFormatError(msg)
        rows.append([number for number in numbers if number is not None])
    if not rows or len(rows) - 1 != rows[0][0]:
        msg = f"{path}: announces {rows[0][0] if rows else 0:g} lights, but {max(len(rows) - 1, 0)} follow"
        raise FileFormatError(msg)
    _, columns, image_rows, focal_px, x0, y0, distance_mm = rows[0]
    if abs(x0 - image_rows / 2) + abs(y0 - columns / 2) < abs(x0 - columns / 2) + abs(y0 - image_rows / 2):
        columns, image_rows = image_rows, columns  # the header of the data set names them the other way round
    if not (np.isfinite(rows[0]).all() and focal_px > 0 and distance_mm > 0 and columns > 0 and image_rows > 0):
        msg = (
            f"{path}: focal length, image size and mean distance must be above 0, got {focal_px:g} and {distance_mm:g}"
        )
        raise FileFormatError(msg)
    table = np.array([row[: FIELDS[0]] for row in rows[1:]], dtype=np.float64).reshape(-1, FIELDS[0])
    return LightTable(
        checked_vectors(np.ascontiguousarray(table[:, POSITION]), path),
        "camera_mm",
        np.ascontiguousarray(table[:, INTENSITY]),
        notes=("the LEDs taken to shine alike in all directions, and the camera to see all parts from straight above",),
        plane_mm=distance_mm,
        focal_px=focal_px,
        principal_px=(x0, y0),
        size_px=(columns, image_rows),
    )
