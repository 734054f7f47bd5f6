"""Nominal positions of balls: a CSV of name, x_um, y_um."""

from __future__ import annotations

import csv
import math
from collections import Counter
from typing import TYPE_CHECKING

import numpy as np
import scipy  # loads its modules when they are used

from bgars.errors import FileFormatError, InputError

if TYPE_CHECKING:
    from pathlib import Path

__all__ = ["read_positions"]

COLUMNS = ["name", "x_um", "y_um"]
MILLIMETRES = ["x", "y", "diameter"]
UM_PER_MM = 1000.0
MAX_BALLS = 32_767


def read_positions(path: Path, diameter_um: float | None = None) -> tuple[tuple[str, float, float], ...]:
    """Read nominal positions, x right and y up.

    Parameters
    ----------
    path : Path
        CSV file with the header ``name,x_um,y_um``; or ``X,Y,Diameter`` in millimetres, whose balls are named by their
        line: 1, 2, ... (the diameters are checked and not used).
    diameter_um : float, optional
        Nominal diameter: places nearer to each other are refused.

    Raises
    ------
    FileFormatError
        The file is missing, or is no such table; the line is named.
    InputError
        A name twice, or places that coincide.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            lines = [[cell.strip() for cell in row] for row in csv.reader(file)]
    except OSError as error:
        msg = f"{path}: cannot be read ({error.strerror})"
        raise FileFormatError(msg) from error
    except (csv.Error, UnicodeDecodeError) as error:
        msg = f"{path}: is not a CSV table ({error})"
        raise FileFormatError(msg) from error
    if lines and [cell.lower() for cell in lines[0]] == MILLIMETRES:
        places = [_place_mm(path, number, cells) for number, cells in enumerate(lines[1:], start=2) if any(cells)]
        lines = [COLUMNS, *([name, str(x_um), str(y_um)] for name, x_um, y_um in places)]
    if not lines or lines[0] != COLUMNS:
        header = ",".join(lines[0]) if lines else ""
        msg = f"{path}: line 1: must be the header {','.join(COLUMNS)}, got {header!r}"
        raise FileFormatError(msg)
    places = [_place(path, number, cells) for number, cells in enumerate(lines[1:], start=2) if any(cells)]
    if not 0 < len(places) <= MAX_BALLS:
        msg = f"{path}: must hold 1 to {MAX_BALLS} positions, got {len(places)}"
        raise FileFormatError(msg)
    names = [name for name, _, _ in places]
    if len(set(names)) < len(names):
        twice = Counter(names).most_common(1)[0][0]
        msg = f"{path}: name: must be given once, got {twice!r} twice"
        raise InputError(msg)
    _refuse_close(path, places, diameter_um or 0.0)
    return tuple(places)


def _place(path: Path, number: int, cells: list[str]) -> tuple[str, float, float]:
    try:
        name, x_um, y_um = cells[0], float(cells[1]), float(cells[2])
        if not (name and len(cells) == len(COLUMNS) and math.isfinite(x_um) and math.isfinite(y_um)):
            raise ValueError
    except (ValueError, IndexError):
        msg = f"{path}: line {number}: must be a name and two finite numbers, got {','.join(cells)!r}"
        raise FileFormatError(msg) from None
    return name, x_um, y_um


def _place_mm(path: Path, number: int, cells: list[str]) -> tuple[str, float, float]:
    try:
        x_mm, y_mm, diameter_mm = (float(cell) for cell in cells)
        if not (math.isfinite(x_mm) and math.isfinite(y_mm) and math.isfinite(diameter_mm) and diameter_mm > 0):
            raise ValueError
    except ValueError:
        msg = f"{path}: line {number}: must be x, y and a diameter above 0 in mm, got {','.join(cells)!r}"
        raise FileFormatError(msg) from None
    return str(number - 1), round(x_mm * UM_PER_MM, 6), round(y_mm * UM_PER_MM, 6)


def _refuse_close(path: Path, places: list[tuple[str, float, float]], least_um: float) -> None:
    points_um = np.array([place[1:] for place in places])
    if len(places) < len(("one", "other")):
        return
    found = scipy.spatial.KDTree(points_um).query(points_um, k=2)
    distances_um, neighbours = (np.asarray(values) for values in found)
    distances_um = distances_um[:, 1]
    index = int(np.argmin(distances_um))
    # Of two at one place, either may come first.
    nearest = next(int(other) for other in neighbours[index] if other != index)
    if distances_um[index] <= least_um:
        one, other = sorted((index, nearest))
        rule = f"must be more than {least_um:g} um apart" if least_um else "must be at different places"
        msg = f"{path}: {places[one][0]} and {places[other][0]}: {rule}, got {distances_um[index]:g} um"
        raise InputError(msg)
