"""Balls found in a capture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from bgars.records.short import Short

__all__ = ["BallKind", "FoundBall", "FoundBalls"]

BallKind = Literal["ball", "extra", "bridged"]


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


@dataclass(frozen=True, repr=False)
class FoundBalls(Short):
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
