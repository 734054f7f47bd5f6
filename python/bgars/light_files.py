"""Text files that describe lights: RTI ``.lp`` and the DiLiGenT triple of files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bgars.errors import FileFormatError

if TYPE_CHECKING:
    from os import PathLike

    from numpy.typing import NDArray

__all__ = ["read_filenames", "read_intensities", "read_lp", "read_numbers"]

LP_FIELDS = 4


def read_text(path: Path) -> str:
    """Return the text of a file; a missing or binary one is a FileFormatError."""
    try:
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        msg = f"{path}: is not a text file ({error.reason} at byte {error.start})"
        raise FileFormatError(msg) from error
    except OSError as error:
        msg = f"{path}: cannot be read ({error.strerror})"
        raise FileFormatError(msg) from error


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
    path = Path(path)
    lines = [line.strip() for line in read_text(path).splitlines() if line.strip()]
    if not lines or not lines[0].isdigit():
        msg = f"{path}: line 1 must be the number of lights, got {lines[0] if lines else 'an empty file'!r}"
        raise FileFormatError(msg)
    if int(lines[0]) != len(lines) - 1:
        msg = f"{path}: line 1 announces {lines[0]} lights, but {len(lines) - 1} follow"
        raise FileFormatError(msg)
    vectors, files = [], []
    for number, line in enumerate(lines[1:], start=2):
        fields = line.rsplit(maxsplit=LP_FIELDS - 1)  # file names may hold blanks
        try:
            vector = [float(value) for value in fields[1:]]
        except ValueError:
            vector = []
        if len(vector) != LP_FIELDS - 1 or not np.linalg.norm(vector) > 0:
            msg = f"{path}: line {number} must read 'file x y z' with a direction that is not zero, got {line!r}"
            raise FileFormatError(msg)
        files.append(fields[0].replace("\\", "/"))
        vectors.append(vector)
    directions = np.array(vectors, dtype=np.float64).reshape(-1, 3)
    return directions / np.linalg.norm(directions, axis=1, keepdims=True), tuple(files)


def read_numbers(path: Path, columns: tuple[int, ...], meaning: str) -> NDArray[np.float64]:
    """Read rows of numbers, separated by blanks or commas; `columns` lists how many a row may have."""
    rows: list[list[float]] = []
    for number, line in enumerate(read_text(path).splitlines(), start=1):
        text = line.split("#", 1)[0].replace(",", " ").split()
        if not text:
            continue
        try:
            row = [float(value) for value in text]
        except ValueError:
            row = []
        if len(row) not in columns or (rows and len(row) != len(rows[0])):
            expected = " or ".join(str(count) for count in columns)
            msg = f"{path}: line {number} must hold {expected} numbers ({meaning}), got {line.strip()!r}"
            raise FileFormatError(msg)
        rows.append(row)
    if not rows:
        msg = f"{path}: is empty; expected {meaning}"
        raise FileFormatError(msg)
    return np.array(rows, dtype=np.float64)


def read_intensities(path: Path) -> NDArray[np.float64]:
    """Read (L, 1) or (L, 3) light intensities: one number a light, or red, green, blue."""
    return read_numbers(path, (1, 3), "one intensity a light, or red green blue")


def read_filenames(path: Path) -> list[str]:
    """Read image file names, one a line."""
    names = [line.strip() for line in read_text(path).splitlines() if line.strip()]
    if not names:
        msg = f"{path}: is empty; expected one image file name a line"
        raise FileFormatError(msg)
    return names
