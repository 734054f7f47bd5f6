"""Columns under a header that names them: the file of a light and its x, y, z, wherever they stand."""

from __future__ import annotations

import csv
import re
from typing import TYPE_CHECKING, NamedTuple

from bgars.files.image_endings import are_image_names
from bgars.files.light_formats.columns import Line, Row, Style, as_number, by_number

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["INDICES", "SORTED", "Headed", "axes_of", "fields_of", "rows_under"]

AXIS = re.compile(r"(?:.*[^a-z])?[a-z]?([xyz])(?:\s*[\[(](mm|cm|um|µm|μm|m)[\])]|[\s_](mm|cm|um|µm|μm|m))?")
LENGTHS_MM = {"mm": 1.0, "cm": 10.0, "m": 1000.0}
MICROMETRE_MM = 1e-3
NAMES = ("file", "filename", "file_name", "image", "image_name", "img", "name", "path", "photo", "picture")
STRENGTHS = ("intensity", "strength", "brightness")
COLORS = (("r", "g", "b"), ("red", "green", "blue"))
INDICES = ("", "#", "id", "index", "lamp", "light", "led", "no", "no.", "nr", "number")
SORTED = "lights sorted by their numbers"


class Headed(NamedTuple):
    """The rows under a header, and what was left out; `unit_mm` is the unit that x, y and z have, None without one."""

    rows: list[Row]
    lines: list[Line]
    notes: tuple[str, ...]
    unit_mm: float | None


def fields_of(text: str, style: Style) -> list[str]:
    """Fields of a line, the empty ones too, without their quotes."""
    if style.separator is None:
        parts = text.split()
    else:
        try:
            parts = next(csv.reader([text], delimiter=style.separator, skipinitialspace=True), [])
        except csv.Error:  # a field of more than 100,000 characters
            return [text]
    return [part.strip().strip("\"'") for part in parts]


def axes_of(header: Sequence[str]) -> list[str]:
    """x, y and z in the order in which a header names them.

    Examples
    --------
    >>> axes_of(["file", "Lx", "Ly", "Lz"]), axes_of(["azimuth", "elevation"])
    (['x', 'y', 'z'], [])
    """
    return [match[1] for field in header if (match := AXIS.fullmatch(field.lower()))]


def _file_column(names: Sequence[str], fields: Sequence[Sequence[str]]) -> int | None:
    """Place of the column of the images: by its name and what it holds, else by what it holds, else by its name."""
    called = [names.index(name) for name in NAMES if name in names]
    holding = [place for place in range(len(names)) if are_image_names([each[place] for each in fields])]
    return next((place for place in (*(each for each in called if each in holding), *holding, *called)), None)


def rows_under(header: Line, lines: Sequence[Line], style: Style) -> Headed | None:
    """Return the rows of a table, in the order of their numbers; None where its columns are not those of its header."""
    names = [field.lower() for field in fields_of(header.text, style)]
    found = [(match, place) for place, name in enumerate(names) if (match := AXIS.fullmatch(name))]
    axes = {match[1]: place for match, place in found}
    units = {match[2] or match[3] for match, _ in found}
    fields = [fields_of(line.text, style) for line in lines]
    if len(axes) != len(axes_of(names)) or len(axes) != 3 or any(len(each) != len(names) for each in fields):  # noqa: PLR2004 - x, y, z
        return None
    file = _file_column(names, fields)
    strengths = [names.index(name) for name in STRENGTHS if name in names][:1]
    for colors in COLORS:
        if set(colors) <= set(names):
            strengths = [names.index(name) for name in colors]
    places = [*(axes[axis] for axis in "xyz"), *strengths]
    rows = []
    for each in fields:
        numbers = [as_number(each[place], style) for place in places]
        if None in numbers or (file is not None and not each[file]):
            return None
        rows.append(Row("" if file is None else each[file], tuple(number for number in numbers if number is not None)))
    used = {*places, *([] if file is None else [file])}
    left = [name for place, name in enumerate(names) if place not in used and name not in INDICES]
    notes = [f"columns that are not used: {', '.join(left)[:200]}"] if left else []
    index = next((place for place, name in enumerate(names) if place not in used and name in INDICES), None)
    order = None if index is None or file is not None else by_number([each[index] for each in fields])
    if order is not None and order != sorted(order):
        rows, lines = [rows[place] for place in order], [lines[place] for place in order]
        notes.append(SORTED)
    unit = units.pop() if len(units) == 1 else None
    return Headed(rows, list(lines), tuple(notes), None if unit is None else LENGTHS_MM.get(unit, MICROMETRE_MM))
