"""Reference planes of coplanarity, in both JEDEC readings.

Balls as the camera sees them: the substrate lies below, the apexes point to the camera. The part is turned over to
stand on them, so its seating plane lies on top of them, and the apex farthest from the substrate is the highest.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bgars.inspection.facets import hull_facets

__all__ = ["ReferencePlane", "off_lines", "regression_plane", "seating_planes"]

Array = NDArray[np.float64]
MIN_BALLS = 3
"""Three carry a plane."""
NUDGE = 1e-6
"""How far the centre of gravity is moved off lines through two apexes, of the part's size."""
TURNS_RAD = (0.05, -0.05, 0.0)
"""Directions of that move, against the one to the middle of the apexes: one of them is inside the hull."""
ON_EDGE = 1e-5
"""Barycentric share below which the centre of gravity may lie on the edge of a facet: both sides are then tried."""
SLACK = 1e-9
"""Room that rounding is given, of the range of heights."""
TOUCH = 1e-8
"""An apex this close to a plane lies on it, of the range of heights."""
SAME = 1e-6
"""Planes that differ by less, of the range of heights, are one."""
STEEP = 1e3
"""Slopes (of normalised heights) that no part comes to rest at."""
FLAT_FIELD = 1e-9


@dataclass(frozen=True, eq=False)
class ReferencePlane:
    """A plane ``z = slope_x x + slope_y y + offset_um`` above all apexes, and the coplanarity it gives.

    Attributes
    ----------
    slope_x, slope_y : float
        Slopes.
    offset_um : float
        Height at the origin.
    balls : tuple of int
        Indices of the apexes that touch it.
    deviations_um : (n,) float64
        Distance of each apex below the plane.
    coplanarity_um : float
        The largest of them.
    """

    slope_x: float
    slope_y: float
    offset_um: float
    balls: tuple[int, ...]
    deviations_um: Array
    coplanarity_um: float


def seating_planes(apexes_um: Array, gravity_um: Array) -> tuple[ReferencePlane, ...]:
    """Every plane on which the part comes to rest, the worst coplanarity first.

    The part rests on three apexes whose triangle holds its centre of gravity, with every other apex on the same side:
    the plane above all apexes that is lowest at the centre of gravity (JESD22-B108; a linear program). Where the
    centre of gravity is right above the line between two such apexes, or above one, the part rocks: all planes with
    that same height there are feasible, and those where it comes to rest are the corners of that set.

    Parameters
    ----------
    apexes_um : (n, 3) float64
        Tops of the balls; heights against any plane, tilted as it may be.
    gravity_um : (2,) float64
        Centre of gravity of the part.

    Returns
    -------
    tuple of ReferencePlane
        Empty with fewer than three apexes, apexes in one line, or a centre of gravity outside their hull: the part
        does not stand.

    References
    ----------
    JEDEC JESD22-B108B, Coplanarity test for surface-mount semiconductor devices.

    Examples
    --------
    A square part with two high corners across the diagonal rocks:

    >>> apexes = np.array([[-1.0, -1, 5], [1, -1, 4], [1, 1, 5], [-1, 1, 4.5]])
    >>> [(plane.balls, round(plane.coplanarity_um, 2)) for plane in seating_planes(apexes, np.zeros(2))]
    [((0, 2, 3), 1.41), ((0, 1, 2), 1.22)]
    """
    apexes_um = np.asarray(apexes_um, dtype=np.float64)
    field = _Field.of(apexes_um, np.asarray(gravity_um, dtype=np.float64))
    if field is None:
        return ()
    for turn_rad in TURNS_RAD:
        corners, shares = hull_facets(field.ground[None], field.z[None], off_lines(field.ground, turn_rad))
        if corners.max() < len(apexes_um):
            break
    else:
        return ()
    slopes = _slopes(field.ground[corners[0]], field.z[corners[0]])[None]
    if shares.min() < ON_EDGE:
        lift = float((field.z - field.ground @ slopes[0]).max())
        found = _resting_slopes(field, lift)
        slopes = found if len(found) else slopes
    planes: list[ReferencePlane] = []
    for slope in slopes:
        plane = field.plane(slope, apexes_um)
        if not any(_is_same(plane, other, field) for other in planes):
            planes.append(plane)
    return tuple(sorted(planes, key=lambda plane: -plane.coplanarity_um))


def regression_plane(apexes_um: Array) -> ReferencePlane | None:
    """The least-squares plane of all apexes, moved up to the apex that is highest above it.

    Parameters
    ----------
    apexes_um : (n, 3) float64
        Tops of the balls.

    Returns
    -------
    ReferencePlane or None
        None with fewer than three apexes, or apexes in one line.

    References
    ----------
    JEDEC JESD22-B108B, Coplanarity test for surface-mount semiconductor devices.

    Examples
    --------
    >>> apexes = np.array([[-1.0, -1, 5], [1, -1, 3], [1, 1, 5], [-1, 1, 3]])
    >>> round(regression_plane(apexes).coplanarity_um, 9)
    2.0
    """
    apexes_um = np.asarray(apexes_um, dtype=np.float64)
    field = _Field.of(apexes_um, apexes_um[:, :2].mean(axis=0) if len(apexes_um) else np.zeros(2))
    return None if field is None else field.plane(np.zeros(2), apexes_um)


@dataclass(frozen=True, eq=False)
class _Field:
    """Apexes against their least-squares plane, scaled to size 1: planes of tilted parts lose no digits."""

    ground: Array
    z: Array
    size_um: float
    range_um: float
    slopes: Array

    @classmethod
    def of(cls, apexes_um: Array, gravity_um: Array) -> _Field | None:
        if len(apexes_um) < MIN_BALLS:
            return None
        ground = apexes_um[:, :2] - gravity_um
        centred = ground - ground.mean(axis=0)
        size_um = float(np.abs(centred).max())
        spread = np.linalg.svd(centred, compute_uv=False)
        if not size_um > 0 or spread[1] <= FLAT_FIELD * spread[0]:
            return None
        slopes = np.linalg.lstsq(centred, apexes_um[:, 2] - apexes_um[:, 2].mean(), rcond=None)[0]
        z = apexes_um[:, 2] - ground @ slopes
        z -= z.mean()
        range_um = float(np.ptp(z))
        floor_um = 1e-9 * max(size_um, float(np.abs(apexes_um[:, 2]).max()))
        range_um = max(range_um, floor_um)
        return cls(ground / size_um, z / range_um, size_um, range_um, slopes)

    def plane(self, slope: Array, apexes_um: Array) -> ReferencePlane:
        """The plane of a normalised slope, moved down onto the apexes."""
        room = self.ground @ slope - self.z
        room -= room.min()
        total = self.slopes + slope * (self.range_um / self.size_um)
        deviations_um = room * self.range_um / math.sqrt(1.0 + float(total @ total))
        touching = tuple(int(ball) for ball in np.flatnonzero(room <= TOUCH))
        offset_um = float((apexes_um[:, 2] - apexes_um[:, :2] @ total).max())
        return ReferencePlane(
            float(total[0]), float(total[1]), offset_um, touching, deviations_um, float(deviations_um.max())
        )


def off_lines(ground: Array, turn_rad: float = TURNS_RAD[0]) -> Array:
    """The centre of gravity (the origin), nudged inward and off every line that symmetry puts through it."""
    inward = ground.mean(axis=0)
    length = float(np.hypot(*inward))
    direction = np.array([0.8, 0.6]) if length < NUDGE else inward / length
    cosine, sine = math.cos(turn_rad), math.sin(turn_rad)
    nudged: Array = NUDGE * np.array([[cosine, -sine], [sine, cosine]]) @ direction
    return nudged


def _is_same(plane: ReferencePlane, other: ReferencePlane, field: _Field) -> bool:
    turned = math.hypot(plane.slope_x - other.slope_x, plane.slope_y - other.slope_y)
    return plane.balls == other.balls or turned * field.size_um < SAME * field.range_um


def _slopes(triangle: Array, tops: Array) -> Array:
    slopes: Array = np.linalg.solve(triangle[1:] - triangle[0], tops[1:] - tops[0])
    return slopes


def _resting_slopes(field: _Field, lift: float) -> Array:
    """(m, 2) corners of the set of slopes whose plane, `lift` high at the centre of gravity, is above every apex.

    Each apex allows a half-plane of slopes; a square of impossibly steep ones is cut by all of them, and what is left
    of its own corners is no place to rest.
    """
    slopes = STEEP * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    for place, height in zip(field.ground, field.z, strict=True):
        room = slopes @ place + (lift + SLACK - height)
        if (room >= 0).all():
            continue
        kept = []
        for index in range(len(slopes)):
            if (room[index] >= 0) != (room[index - 1] >= 0):
                share = room[index - 1] / (room[index - 1] - room[index])
                kept.append(slopes[index - 1] + share * (slopes[index] - slopes[index - 1]))
            if room[index] >= 0:
                kept.append(slopes[index])
        slopes = np.array(kept).reshape(-1, 2)
    corners: Array = slopes[np.abs(slopes).max(axis=1, initial=0.0) < 0.99 * STEEP]
    return corners
