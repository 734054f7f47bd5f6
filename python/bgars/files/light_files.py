"""Text files that describe lights: RTI ``.lp`` and the DiLiGenT triple of files."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bgars.errors import CaptureWarning, FileFormatError
from bgars.files import safe_files
from bgars.files.light_formats.arrays import read_npy_array
from bgars.files.light_formats.columns import Style, as_number, data_lines, find_style
from bgars.files.light_formats.table import MAX_LIGHTS
from bgars.files.light_formats.text import read_lp_table

if TYPE_CHECKING:
    from os import PathLike

    from numpy.typing import NDArray

RGB = 3

__all__ = ["read_filenames", "read_intensities", "read_lp", "read_numbers", "read_text"]


def read_text(path: Path) -> str:
    """Return the text of a file; a missing, endless or binary one is a FileFormatError."""
    return safe_files.read_text(path).content


def read_lp(path: str | PathLike[str]) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Read an RTI ``.lp`` file.

    Returns
    -------
    directions : (L, 3) float64
        Unit vectors, surface to light.
    files : tuple of str
        Image file name of each light.

    Raises
    ------
    FileFormatError
        A line that is not ``file x y z``, a count that does not fit, or a zero vector.
    """
    table = read_lp_table(Path(path))
    for note in table.notes:
        warnings.warn(f"{path}: {note}", CaptureWarning, stacklevel=3)
    files = tuple(name.replace("\\", "/") for name in table.files)
    return table.vectors / np.linalg.norm(table.vectors, axis=1, keepdims=True), files


def read_numbers(path: Path, columns: tuple[int, ...], meaning: str) -> NDArray[np.float64]:
    """Read rows of numbers, separated as people do, or a ``.npy``; `columns` lists how many a row may have.

    A count on a line of its own before the rows and a line of column names are allowed.

    Raises
    ------
    FileFormatError
        The file is empty, or a line holds something else.
    """
    if path.suffix.lower() == ".npy":
        return _fitting(read_npy_array(path), path, columns, meaning)
    lines = data_lines(read_text(path))
    if len(lines) > MAX_LIGHTS + 2:
        msg = f"{path}: {len(lines)} lines are more than a capture may have lights (at most {MAX_LIGHTS})"
        raise FileFormatError(msg)
    style = find_style(lines, least=max(columns))
    if 1 in columns and style.separator == "," and all(line.text.count(",") == 1 for line in lines):
        style = Style(None, decimal_comma=True)
    if len(lines) > 1 and lines[0].text == str(len(lines) - 1) and 1 not in columns:
        lines = lines[1:]
    rows: list[list[float]] = []
    for line in lines:
        fields = line.text.replace(style.separator or " ", " ").split()
        numbers = [as_number(field, style) for field in fields]
        if not rows and line is lines[0] and len(lines) > 1 and all(number is None for number in numbers):
            continue  # the names of the columns
        if None in numbers or len(numbers) not in columns or (rows and len(numbers) != len(rows[0])):
            expected = " or ".join(str(count) for count in columns)
            shown = line.text if len(line.text) < 100 else f"{line.text[:100]}..."  # noqa: PLR2004 - a short line
            msg = f"{path}: line {line.number} must hold {expected} numbers ({meaning}), got {shown!r}"
            raise FileFormatError(msg)
        rows.append([number for number in numbers if number is not None])
    if not rows:
        msg = f"{path}: is empty; expected {meaning}"
        raise FileFormatError(msg)
    return np.array(rows, dtype=np.float64)


def _in_rows(path: Path) -> NDArray[np.float64] | None:
    """Intensities written as one line, or three, of a number per light; None for any other form."""
    if path.suffix.lower() == ".npy":
        return None
    lines = data_lines(read_text(path))
    style = find_style(lines)
    rows = [[as_number(field, style) for field in line.text.replace(",", " ").split()] for line in lines[: RGB + 1]]
    columns = len(rows[0]) if rows else 0
    if len(rows) not in (1, RGB) or columns <= RGB or any(len(row) != columns or None in row for row in rows):
        return None
    return np.array(rows, dtype=np.float64).T


def _fitting(array: NDArray[np.float64], path: Path, columns: tuple[int, ...], meaning: str) -> NDArray[np.float64]:
    rows = array.reshape(-1, 1) if array.ndim == 1 and 1 in columns else array
    if rows.ndim != 2 or rows.shape[1] not in columns or len(rows) > MAX_LIGHTS:  # noqa: PLR2004 - rows and columns
        expected = " or ".join(str(count) for count in columns)
        msg = f"{path}: must have shape (lights, {expected}) ({meaning}), got {array.shape}"
        raise FileFormatError(msg)
    return rows


def read_intensities(path: Path) -> NDArray[np.float64]:
    """Read (L, 1) or (L, 3) light intensities: one number per light, or red, green, blue; or lines of L numbers."""
    in_rows = _in_rows(path)
    if in_rows is not None:
        return in_rows
    return read_numbers(path, (1, 3), "one intensity per light, or red green blue")


def read_filenames(path: Path) -> list[str]:
    """Read image file names, one per line, plain or in quotes; a line that begins with ``# `` is a comment."""
    lines = [line.strip() for line in read_text(path).splitlines()]
    names = [line.strip("\"'") for line in lines if line and not line.startswith("# ")]
    if not names:
        msg = f"{path}: is empty; expected one image file name per line"
        raise FileFormatError(msg)
    if len(names) > MAX_LIGHTS:
        msg = f"{path}: names {len(names)} images, more than a capture may have (at most {MAX_LIGHTS})"
        raise FileFormatError(msg)
    return names
