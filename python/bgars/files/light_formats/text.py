"""Lights as lines of text: RTI ``.lp``, ``light_directions.txt``, ``lights.txt``, CSV, three rows of L numbers."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from bgars.errors import FileFormatError
from bgars.files.light_formats.angles import read_angle_table
from bgars.files.light_formats.columns import AXES, Line, Row, Style, as_number, data_lines, find_style, parse_row
from bgars.files.light_formats.headed import SORTED, axes_of, rows_under
from bgars.files.light_formats.table import MAX_LIGHTS, LightTable, checked_vectors
from bgars.files.safe_files import read_text

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

__all__ = ["Rows", "read_lp_table", "read_rows", "read_text_table"]

ROW = "'file x y z' with a direction that is not zero"
ENCODINGS_TO_SAY = {"cp1252": "Windows-1252 (no valid UTF-8)", "utf-16": "UTF-16", "utf-16-le": "UTF-16"} | {
    "utf-16-be": "UTF-16",
    "utf-32-le": "UTF-32",
    "utf-32-be": "UTF-32",
}
NUMBERED = re.compile(r"(?P<index>\d{1,6})\s+(?P<name>\S.*\.[A-Za-z]\w{1,4})", re.ASCII)
VECTOR = "x y z of a light, or its file and x y z"
WITH_INTENSITY, WITH_RGB, ANGLES = 4, 6, 2


class Rows(NamedTuple):
    """Lines of a file, parsed."""

    rows: list[Row]
    lines: list[Line]
    notes: tuple[str, ...]
    counted: bool
    unit_mm: float | None = None


def read_rows(path: Path, *, named: bool = False) -> Rows:
    """Return the rows of a file, after a count and a header where there are such.

    Raises
    ------
    FileFormatError
        The file is empty, no text, or announces another number of lines than follow; or it has too many.
    """
    text = read_text(path)
    lines = data_lines(text.content)
    notes = [f"read as {ENCODINGS_TO_SAY[text.encoding]}"] if text.encoding in ENCODINGS_TO_SAY else []
    if not lines:
        msg = f"{path}: line 1 must be the number of lights, got 'an empty file'"
        raise FileFormatError(msg)
    if len(lines) > MAX_LIGHTS + 2:
        msg = f"{path}: {len(lines)} lines are more than a capture may have lights (at most {MAX_LIGHTS})"
        raise FileFormatError(msg)
    first, counted = lines[0], _is_count(lines[0].text)
    if counted:
        lines = lines[1:]
        follow = len(lines) - int(bool(lines) and _is_header(lines[0], find_style(lines)))
        if int(first.text) != follow:
            commented = text.content.count("\n#")
            hidden = f" (lines that begin with # are comments: {commented})" if commented else ""
            msg = f"{path}: line {first.number} announces {first.text} lights, but {follow} follow{hidden}"
            raise FileFormatError(msg)
    style = find_style(lines)
    if style.decimal_comma:
        notes.append("commas taken as decimal commas")
    if lines and _is_header(lines[0], style):
        _refuse_order(path, lines[0])
        header, lines = lines[0], lines[1:]
        headed = rows_under(header, lines, style)
        if headed is not None and lines:
            return Rows(headed.rows, headed.lines, (*notes, *headed.notes), counted, headed.unit_mm)
    if not lines:
        msg = f"{path}: holds no light"
        raise FileFormatError(msg)
    rows: list[Row] = []
    for line in lines:
        row = parse_row(line.text, style)
        if row is None:
            is_first = named and not counted and not rows
            expected = "be the number of lights" if is_first else f"read {ROW}" if named else f"hold {VECTOR}"
            msg = f"{path}: line {line.number} must {expected}, got {_short(line.text)}"
            if not rows and not any(character.isdigit() for character in line.text):
                msg += "; columns are known by the names x, y, z, or azimuth, elevation (slant, tilt, zenith)"
            raise FileFormatError(msg)
        rows.append(row)
    return Rows(rows, lines, tuple(notes), counted)


def read_lp_table(path: Path) -> LightTable:
    """Read an RTI ``.lp`` file: a count, then ``file x y z`` a line.

    Also read, and said: no count, decimal commas, other encodings, a column of intensities (or three, red green blue).

    Raises
    ------
    FileFormatError
        A line that is not ``file x y z``, a count that does not fit, or a zero vector.
    """
    return read_text_table(path, names_needed=True)


def read_text_table(path: Path, *, names_needed: bool = False) -> LightTable:
    """Read lights from lines ``[file] x y z [intensity | red green blue]``, or from three lines of L numbers.

    Also read: azimuth and elevation, or slant and tilt, under a header that names them.

    Raises
    ------
    FileFormatError
        Other lines, a zero vector, or a count that does not fit.
    """
    of_angles = read_angle_table(path)
    if of_angles is not None:
        return of_angles
    parsed = read_rows(path, named=names_needed)
    notes = list(parsed.notes)
    rows = _without_index(parsed.rows, notes)
    if names_needed:
        rows = _with_names_of_digits(rows, parsed.lines)
    columns = len(rows[0].numbers) if rows else 0
    named = bool(rows) and bool(rows[0].name)
    if not named and not names_needed and len(rows) == AXES and columns > AXES and _equal(rows):
        vectors = np.array([row.numbers for row in rows], dtype=np.float64).T
        notes.append(f"3 rows of {columns} numbers taken as x, y and z of the lights")
        return LightTable(checked_vectors(np.ascontiguousarray(vectors), path), notes=tuple(notes))
    allowed = (AXES, WITH_INTENSITY, WITH_RGB)
    for row, line in zip(rows, parsed.lines, strict=True):
        if len(row.numbers) not in allowed or len(row.numbers) != columns or bool(row.name) != named:
            _refuse_line(path, line, names_needed or named)
        if names_needed and not row.name:
            _refuse_line(path, line, names_needed)
        if not (np.isfinite(row.numbers[:AXES]).all() and any(row.numbers[:AXES])):
            _refuse_line(path, line, names_needed or named)
    if names_needed and not parsed.counted:
        notes.append(f"no count on the first line, so {len(rows)} lights were counted")
    numbers = np.array([row.numbers for row in rows], dtype=np.float64).reshape(len(rows), columns or AXES)
    if columns == WITH_INTENSITY and not named and _is_index(numbers[:, 0]):
        order = np.argsort(numbers[:, 0])
        notes.append("the first column taken as the number of the light")
        notes.extend([SORTED] if (np.diff(order) < 0).any() else [])
        numbers, columns = numbers[order, 1:], AXES
    intensities = None if columns == AXES else numbers[:, AXES:]
    if columns == WITH_INTENSITY:
        notes.append("the fourth number of a line taken as the intensity of the light")
    elif columns == WITH_RGB:
        notes.append("the last three numbers of a line taken as red, green and blue intensity of the light")
    files = tuple(row.name for row in rows) if named else ()
    _refuse_twice(path, files)
    vectors = checked_vectors(np.ascontiguousarray(numbers[:, :AXES] * (parsed.unit_mm or 1.0)), path, files)
    return LightTable(
        vectors,
        "directions" if parsed.unit_mm is None else "positions_mm",
        intensities,
        files,
        free_length=names_needed,
        notes=tuple(notes),
    )


def _without_index(rows: list[Row], notes: list[str]) -> list[Row]:
    """Rows whose names do not begin with the number of the light, where all did."""
    numbers = [NUMBERED.fullmatch(row.name) for row in rows]
    found = [int(number["index"]) for number in numbers if number]
    if len(rows) <= AXES or sorted(found) not in (list(range(len(rows))), list(range(1, len(rows) + 1))):
        return rows
    notes.append("the first column taken as the number of the light")
    return [Row(number["name"], row.numbers) for number, row in zip(numbers, rows, strict=True) if number]


def _with_names_of_digits(rows: list[Row], lines: list[Line]) -> list[Row]:
    """Rows ``1 x y z``: a name is needed, and 1 may be that of 1.png."""
    names = [re.split(r"[\s,;]", line.text, maxsplit=1)[0] for line in lines]
    if all(not row.name and len(row.numbers) == WITH_INTENSITY for row in rows) and all(map(str.isdecimal, names)):
        return [Row(name, row.numbers[1:]) for name, row in zip(names, rows, strict=True)]
    return rows


def _refuse_line(path: Path, line: Line, named: bool) -> None:
    expected = f"read {ROW}" if named else "hold 3 numbers (x y z of a light, not all zero)"
    msg = f"{path}: line {line.number} must {expected}, got {_short(line.text)}"
    if not named and len(line.text.replace(",", " ").split()) == ANGLES:
        msg += "; azimuth and elevation are given as lights.angles_deg in capture.toml"
    raise FileFormatError(msg)


def _refuse_twice(path: Path, files: tuple[str, ...]) -> None:
    seen: set[str] = set()
    for name in files:
        if name in seen:
            msg = f"{path}: names {name!r} twice; each light has an image of its own"
            raise FileFormatError(msg)
        seen.add(name)


def _is_count(text: str) -> bool:
    longest = 9
    return text.isascii() and text.isdecimal() and len(text) <= longest


def _is_header(line: Line, style: Style) -> bool:
    """True for a line of names only, such as ``x,y,z``."""
    fields = line.text.replace(style.separator or " ", " ").split()
    words = all(as_number(field, style) is None for field in fields)
    return words and len(fields) >= AXES and {"x", "y", "z"} <= set(axes_of([field.strip("\"'") for field in fields]))


def _refuse_order(path: Path, header: Line) -> None:
    """Refuse columns that are named in another order, such as y, x, z."""
    order = axes_of([field.strip("\"'") for field in re.split(r"[\s,;]+", header.text)])
    if sorted(order[:AXES]) == ["x", "y", "z"] != order[:AXES]:
        msg = f"{path}: line {header.number}: the columns must stand in the order x, y, z, got {_short(header.text)}"
        raise FileFormatError(msg)


def _is_index(column: NDArray[np.float64]) -> bool:
    counted = np.sort(column) - np.arange(len(column))
    return len(column) > AXES and bool((counted == 0).all() or (counted == 1).all())


def _equal(rows: list[Row]) -> bool:
    return len({len(row.numbers) for row in rows}) == 1 and not any(row.name for row in rows)


def _short(text: str) -> str:
    longest = 100
    return repr(text if len(text) <= longest else f"{text[:longest]}...")
