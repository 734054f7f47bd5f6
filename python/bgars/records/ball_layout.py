"""Where balls are expected: a grid or a list of places."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, NamedTuple

from bgars.errors import InputError
from bgars.records.ball_names import ball_name
from bgars.records.keys import Key

__all__ = ["BallLayout", "LayoutPlace"]


class LayoutPlace(NamedTuple):
    """A place with a ball: rows from the top, columns from the left, both from 0."""

    name: str
    row: int
    col: int
    x_um: float
    y_um: float


@dataclass(frozen=True)
class BallLayout:
    """Where balls should be: a square grid, or a list of places.

    Attributes
    ----------
    rows, cols : int or None
        Size of the grid, seen as in the image; None with a list.
    pitch_um : float or None
        Distance of neighbours in the grid.
    depopulated : tuple of str
        JEDEC names of places of the grid without a ball.
    positions : tuple of (str, float, float)
        Or every place: name, x and y in micrometres, x right and y up, any origin.

    Raises
    ------
    InputError
        Neither or both of grid and list, sizes that are not positive, names that are not in the grid or come twice.

    Examples
    --------
    >>> BallLayout(rows=2, cols=3, pitch_um=800.0, depopulated=("B2",)).places()[3]
    LayoutPlace(name='B1', row=1, col=0, x_um=0.0, y_um=-800.0)
    """

    rows: Annotated[int | None, Key("rows of the grid; null with a list of positions")] = None
    cols: Annotated[int | None, Key("columns of the grid; null with a list of positions")] = None
    pitch_um: Annotated[float | None, Key("distance of neighbours, in um; null with a list of positions")] = None
    depopulated: Annotated[tuple[str, ...], Key("names of places without a ball")] = ()
    positions: Annotated[tuple[tuple[str, float, float], ...], Key("name, x and y in um of each place, or empty")] = ()

    def __post_init__(self) -> None:
        if self.positions:
            if (self.rows, self.cols, self.pitch_um, self.depopulated) != (None, None, None, ()):
                msg = "layout: must be a grid (rows, cols, pitch_um) or a list of positions, got both"
                raise InputError(msg)
            names = [name for name, _, _ in self.positions]
            if not all(math.isfinite(x_um) and math.isfinite(y_um) for _, x_um, y_um in self.positions):
                msg = "layout.positions: must be finite"
                raise InputError(msg)
        else:
            for name, value in (("rows", self.rows), ("cols", self.cols), ("pitch_um", self.pitch_um)):
                if value is None or not (math.isfinite(value) and value > 0):
                    msg = f"layout.{name}: must be above 0 (or positions must be given), got {value}"
                    raise InputError(msg)
            names = list(self.depopulated)
            known = {ball_name(row, col) for row in range(self.rows or 0) for col in range(self.cols or 0)}
            unknown = [name for name in names if name not in known]
            if unknown:
                msg = f"layout.depopulated: must name places of the {self.rows} x {self.cols} grid, got {unknown[0]!r}"
                raise InputError(msg)
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            field_name = "positions" if self.positions else "depopulated"
            msg = f"layout.{field_name}: names must differ, got {twice[0]!r} more than once"
            raise InputError(msg)

    def places(self) -> tuple[LayoutPlace, ...]:
        """Name, row, column, x and y in micrometres of every place with a ball; rows count downward."""
        if self.positions:
            return _listed_places(self.positions)
        pitch_um = self.pitch_um or 0.0
        return tuple(
            LayoutPlace(ball_name(row, col), row, col, col * pitch_um, -row * pitch_um)
            for row in range(self.rows or 0)
            for col in range(self.cols or 0)
            if ball_name(row, col) not in self.depopulated
        )


def _listed_places(positions: tuple[tuple[str, float, float], ...]) -> tuple[LayoutPlace, ...]:
    """Listed places with rows and columns: the distinct y from the top, the distinct x from the left."""
    rows = _ranks([-y_um for _, _, y_um in positions])
    cols = _ranks([x_um for _, x_um, _ in positions])
    return tuple(
        LayoutPlace(name, row, col, x, y) for (name, x, y), row, col in zip(positions, rows, cols, strict=True)
    )


def _ranks(values: list[float]) -> list[int]:
    """Rank of each value among the distinct ones; values closer than a thousandth of the range are one."""
    tolerance = max(1e-3 * (max(values) - min(values)), 1e-9)
    ranks = [0] * len(values)
    order = sorted(range(len(values)), key=values.__getitem__)
    for before, index in pairwise(order):
        ranks[index] = ranks[before] + (values[index] - values[before] > tolerance)
    return ranks
