"""Records of balls: where they are in the image, and what was measured of each."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from bgars.ball_names import ball_name
from bgars.errors import InputError

__all__ = ["BallLayout", "BallMeasurement", "FoundBall", "FoundBalls", "MeasuredBall"]

BallKind = Literal["ball", "extra", "bridged"]


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
    ('B1', 1, 0, 0.0, -800.0)
    """

    rows: int | None = None
    cols: int | None = None
    pitch_um: float | None = None
    depopulated: tuple[str, ...] = ()
    positions: tuple[tuple[str, float, float], ...] = ()

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

    def places(self) -> tuple[tuple[str, int, int, float, float], ...]:
        """Name, row, column, x and y in micrometres of every place with a ball; rows count downward."""
        if self.positions:
            return _listed_places(self.positions)
        pitch_um = self.pitch_um or 0.0
        return tuple(
            (ball_name(row, col), row, col, col * pitch_um, -row * pitch_um)
            for row in range(self.rows or 0)
            for col in range(self.cols or 0)
            if ball_name(row, col) not in self.depopulated
        )


def _listed_places(positions: tuple[tuple[str, float, float], ...]) -> tuple[tuple[str, int, int, float, float], ...]:
    """Listed places with rows and columns: the distinct y from the top, the distinct x from the left."""
    rows = _ranks([-y_um for _, _, y_um in positions])
    cols = _ranks([x_um for _, x_um, _ in positions])
    return tuple((name, row, col, x, y) for (name, x, y), row, col in zip(positions, rows, cols, strict=True))


def _ranks(values: list[float]) -> list[int]:
    """Rank of each value among the distinct ones; values closer than a thousandth of the range are one."""
    tolerance = max(1e-3 * (max(values) - min(values)), 1e-9)
    ranks = [0] * len(values)
    order = sorted(range(len(values)), key=values.__getitem__)
    for before, index in pairwise(order):
        ranks[index] = ranks[before] + (values[index] - values[before] > tolerance)
    return ranks


@dataclass(frozen=True)
class FoundBall:
    """A ball in the image, by its silhouette.

    Attributes
    ----------
    name : str
        JEDEC name of its place, "A1"; "X1", "X2", ... for a ball off the lattice.
    row, col : int or None
        Place in the lattice, from 0 at the top left of the image; None off the lattice.
    x_px, y_px : float
        Centre of the silhouette: x right, y up, origin at the centre of the image.
    radius_px : float
        Radius of the silhouette.
    u_centre_px, u_radius_px : float
        Standard uncertainties of the centre (each axis) and of the radius.
    kind : {"ball", "extra", "bridged"}
        ``extra``: off the lattice or where the layout has none; ``bridged``: its silhouette runs into a neighbour's.
    """

    name: str
    row: int | None
    col: int | None
    x_px: float
    y_px: float
    radius_px: float
    u_centre_px: float
    u_radius_px: float
    kind: BallKind = "ball"


@dataclass(frozen=True)
class FoundBalls:
    """The balls of an image and their lattice.

    Attributes
    ----------
    balls : tuple of FoundBall
        In reading order: by row, then column; balls off the lattice last.
    missing : tuple of (str, int, int)
        Name, row and column of each place of the lattice without a ball that was measured.
    bridges : tuple of (str, str)
        Names of neighbours that are joined.
    rows, cols : int
        Size of the lattice.
    pitch_px : float or None
        Distance of neighbours; None for a single ball.
    angle_deg : float
        Direction of the lattice's rows against the image's, counter-clockwise.
    origin_px : (float, float)
        Place (row 0, col 0) of the lattice, x and y as above.
    odd_sizes : tuple of (str, float)
        Name and radius over the median radius of each ball that differs from it by more than a quarter.
    unclear : tuple of str
        Names of those missing places that are not seen to be empty: something is there whose silhouette could not be
        fitted, or the place is clipped, masked or not wholly in the image.
    """

    balls: tuple[FoundBall, ...]
    missing: tuple[tuple[str, int, int], ...]
    bridges: tuple[tuple[str, str], ...]
    rows: int
    cols: int
    pitch_px: float | None
    angle_deg: float
    origin_px: tuple[float, float]
    odd_sizes: tuple[tuple[str, float], ...] = ()
    unclear: tuple[str, ...] = ()


@dataclass(frozen=True)
class MeasuredBall:
    """What was measured of one ball; NaN where it could not be, with the reason. ``u_..`` are standard uncertainties.

    Attributes
    ----------
    name, row, col
        As in :class:`FoundBall`.
    x_um, y_um : float
        Centre: x right, y up, origin at the centre of the image.
    diameter_um : float
        Horizontal diameter.
    centre_z_um, top_um : float
        Height of the centre and of the top above the local board.
    q : float
        Vertical over horizontal radius: 1 for a sphere.
    flat_um : float
        Height that a flat top lacks against the full spheroid; 0 for none.
    lights_used : int
        Lights whose shadow was usable.
    reasons : tuple of str
        Why something was not measured, or is doubtful; empty when all is well.
    budget : dict of dict of float
        By reading (``x_um y_um diameter_um top_um``) and cause: standard uncertainty by that cause alone, um.
    """

    name: str
    row: int | None
    col: int | None
    x_um: float
    y_um: float
    diameter_um: float
    centre_z_um: float
    top_um: float
    q: float
    flat_um: float
    u_x_um: float
    u_y_um: float
    u_diameter_um: float
    u_centre_z_um: float
    u_top_um: float
    u_q: float
    u_flat_um: float
    lights_used: int
    kind: BallKind = "ball"
    reasons: tuple[str, ...] = ()
    budget: dict[str, dict[str, float]] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class BallMeasurement:
    """Everything measured of one part, before it is judged.

    Attributes
    ----------
    balls : tuple of MeasuredBall
        The balls that are there, in the order of :class:`FoundBalls`.
    board_coefficients_um : (6,) float64
        Board height z = c0 + c1 x + c2 y + c3 x^2 + c4 x y + c5 y^2 over x, y in um (z = 0 at the image centre; only
        its shape can be seen).
    light_directions : (L, 3) float64
        Refined directions to the lights (for near lights: as seen from the centre of the board).
    light_change_deg : (L,) float64
        How far each light was moved from the rig's.
    shadow_residual_rms : float
        RMS residual of the shadow fit over the contrast of lit and shadowed board.
    board_covariance : (6, 6) float64 or None
        Covariance of `board_coefficients_um`, in their units; None when unknown.
    doubts : tuple of str
        Why the numbers may be wrong by more than they say: with any, nothing passes.
    shared_um : dict of (N, M) float64
        By reading (``x_um y_um top_um``): what M independent sources of error put each ball off by, all of them
        together; part of the balls' uncertainties.
    causes : tuple of str
        Names of the M sources; several sources may have one name.
    corner_um : float
        Distance of the image's corner from its middle.
    u_pixel_pitch : float or None
        Relative standard uncertainty of the pixel pitch, where it was declared.
    """

    balls: tuple[MeasuredBall, ...]
    board_coefficients_um: NDArray[np.float64]
    light_directions: NDArray[np.float64]
    light_change_deg: NDArray[np.float64]
    shadow_residual_rms: float
    warnings: tuple[str, ...] = field(default=())
    board_covariance: NDArray[np.float64] | None = None
    doubts: tuple[str, ...] = field(default=())
    shared_um: dict[str, NDArray[np.float64]] = field(default_factory=dict)
    causes: tuple[str, ...] = ()
    corner_um: float = math.nan
    u_pixel_pitch: float | None = None
