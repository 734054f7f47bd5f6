"""Records of balls: where they are in the image, and what was measured of each."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

__all__ = ["BallLayout", "BallMeasurement", "FoundBall", "FoundBalls", "MeasuredBall"]

BallKind = Literal["ball", "extra", "bridged"]


@dataclass(frozen=True)
class BallLayout:
    """Where balls should be: a lattice, or a list of places.

    Attributes
    ----------
    rows, cols : int or None
        Size of the lattice; None for a list of places.
    pitch_um : float or None
        Distance of neighbours in the lattice.
    depopulated : tuple of str
        Names of places of the lattice that have no ball.
    positions : tuple of (str, float, float)
        Name, x and y in um of each place, as the image shows them but for a shift and a turn; empty for a lattice.
    """

    rows: int | None = None
    cols: int | None = None
    pitch_um: float | None = None
    depopulated: tuple[str, ...] = ()
    positions: tuple[tuple[str, float, float], ...] = ()


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
        Name, row and column of each place of the lattice without a ball.
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
    """

    balls: tuple[FoundBall, ...]
    missing: tuple[tuple[str, int, int], ...]
    bridges: tuple[tuple[str, str], ...]
    rows: int
    cols: int
    pitch_px: float | None
    angle_deg: float
    origin_px: tuple[float, float]


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
    """

    balls: tuple[MeasuredBall, ...]
    board_coefficients_um: NDArray[np.float64]
    light_directions: NDArray[np.float64]
    light_change_deg: NDArray[np.float64]
    shadow_residual_rms: float
    warnings: tuple[str, ...] = field(default=())
    board_covariance: NDArray[np.float64] | None = None
