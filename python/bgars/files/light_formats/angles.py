"""Lights as two angles a line, under a header that names them."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from bgars.errors import FileFormatError
from bgars.files.image_endings import are_image_names
from bgars.files.light_formats.columns import Row, Style, as_number, by_number, data_lines, find_style, parse_row
from bgars.files.light_formats.headed import INDICES, SORTED, axes_of, fields_of
from bgars.files.light_formats.table import MAX_LIGHTS, LightTable, checked_vectors
from bgars.files.safe_files import read_text

if TYPE_CHECKING:
    from pathlib import Path

__all__ = ["read_angle_table"]

AZIMUTH = re.compile(r"azimuth|azimut|az|tilts?")
ELEVATION = re.compile(r"elevation|altitude|el")
FROM_AXIS = re.compile(r"slants?|zenith")
UNIT = re.compile(r"[ _(\[]*(deg(?:rees?)?|rad(?:ians?)?|°)[)\]]*$")
ANGLES = 2
TURN_RAD = 2.0 * np.pi


def read_angle_table(path: Path) -> LightTable | None:
    """Read lines ``[file] azimuth elevation`` (or HALCON's ``slant tilt``); None where the header names no angles.

    Azimuths count counter-clockwise from the right edge of the image, in degrees or radians: as the header says, or
    else radians where no angle exceeds a turn of them.

    Raises
    ------
    FileFormatError
        A line that does not hold both angles.
    """
    lines = data_lines(read_text(path).content)
    header = [field.strip(" \"'").lower() for field in re.split(r"[,;\t]| +(?=[a-z])", lines[0].text)] if lines else []
    units = {match[1][:3] for field in header if (match := UNIT.search(field))}
    names = [UNIT.sub("", field).strip(" _") for field in header]
    angles = [name for name in names if _kind(name)]
    if {"x", "y", "z"} <= set(axes_of(header)):  # the vectors stand there, too
        return None
    if len(angles) != ANGLES or {_kind(name) for name in angles} not in ({"azimuth", "up"}, {"azimuth", "down"}):
        return None
    if len(lines) > MAX_LIGHTS + 1:
        msg = f"{path}: {len(lines)} lines are more than a capture may have lights (at most {MAX_LIGHTS})"
        raise FileFormatError(msg)
    style = find_style(lines[1:], ANGLES)
    rows = _files_last([fields_of(line.text, style) for line in lines[1:]], names, style)
    if rows is None:
        rows = [parse_row(line.text, style) for line in lines[1:]]
    notes: list[str] = []
    if len(names) == ANGLES + 1 and names[0] in INDICES:
        names, rows = angles, _by_index(rows, notes)
    for row, line in zip(rows, lines[1:], strict=True):
        if row is None or len(row.numbers) != ANGLES or bool(row.name) != (len(names) > ANGLES):
            msg = f"{path}: line {line.number} must hold {' and '.join(angles)}, as the header says, got {line.text!r}"
            raise FileFormatError(msg)
    values = np.array([row.numbers for row in rows if row is not None], dtype=np.float64).reshape(-1, ANGLES)
    is_radian = "rad" in units or (not units and bool((np.abs(values) <= TURN_RAD).all()))
    azimuth, other = values.T if _kind(angles[0]) == "azimuth" else values.T[::-1]
    if not is_radian:
        if len(values) and np.abs(azimuth).max() <= TURN_RAD and np.abs(other).max() <= np.pi / 2.0:
            msg = (
                f"{path}: the header says degrees, but no angle is above {np.abs(values).max():.3g}: are they radians?"
            )
            raise FileFormatError(msg)
        azimuth, other = np.radians(azimuth), np.radians(other)
    elevation = other if "up" in {_kind(name) for name in angles} else np.pi / 2.0 - other
    level = np.cos(elevation)
    vectors = np.column_stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)])
    files = tuple(row.name for row in rows if row is not None) if len(names) > ANGLES else ()
    note = f"{angles[0]} and {angles[1]} taken in {'radians' if is_radian else 'degrees'}, {_way(angles)}"
    return LightTable(checked_vectors(vectors, path, files), files=files, notes=(note, *notes))


def _files_last(fields: list[list[str]], names: list[str], style: Style) -> list[Row | None] | None:
    """Rows whose column of images stands behind an angle; None for others."""
    place = next((place for place, name in enumerate(names) if not _kind(name)), 0)
    if not place or len(names) != ANGLES + 1 or any(len(each) != len(names) for each in fields):
        return None
    if not are_image_names([each[place] for each in fields]):
        return None
    rows: list[Row | None] = []
    for each in fields:
        numbers = [as_number(field, style) for at, field in enumerate(each) if at != place]
        rows.append(Row(each[place], tuple(number for number in numbers if number is not None)))
    return rows


def _by_index(rows: list[Row | None], notes: list[str]) -> list[Row | None]:
    """Rows without the number of the light in front, in the order of these numbers."""
    whole = [row for row in rows if row is not None and len(row.numbers) + bool(row.name) == ANGLES + 1]
    order = by_number([row.name or f"{row.numbers[0]:g}" for row in whole])
    if order is None or len(whole) != len(rows):
        return rows
    notes.extend([SORTED] if order != sorted(order) else [])
    return [Row("", whole[place].numbers[-ANGLES:]) for place in order]


def _kind(name: str) -> str:
    """What an angle of this name is: azimuth, up from the image plane, or down from the camera's axis."""
    if AZIMUTH.fullmatch(name):
        return "azimuth"
    if ELEVATION.fullmatch(name):
        return "up"
    return "down" if FROM_AXIS.fullmatch(name) else ""


def _way(angles: list[str]) -> str:
    name = next(each for each in angles if _kind(each) == "azimuth")
    return f"{name} counter-clockwise from the right edge of the image"
