"""Coplanarity of the true apexes, in both JEDEC readings; plain enough to check by eye."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from bgars.simulate.solids import Array

__all__ = ["PlaneTruth", "regression_plane", "seating_plane"]

MIN_BALLS = 3
START_DIRECTIONS = 12
TINY = 1e-9
TOUCH_UM = 1e-6
"""An apex this close to a plane lies on it."""
STEEP = 10.0
"""Slopes that no part rests at."""


@dataclass(frozen=True)
class PlaneTruth:
    """A reference plane ``z = a x + b y + c_um`` above the apexes, and the coplanarity it gives.

    Attributes
    ----------
    a, b : float
        Slopes.
    c_um : float
        Height at the origin.
    balls : tuple of int
        Indices of the apexes that lie on it and define it.
    deviations_um : (n,) float64
        Distance of each apex below the plane.
    coplanarity_um : float
        The largest deviation.
    """

    a: float
    b: float
    c_um: float
    balls: tuple[int, ...]
    deviations_um: Array
    coplanarity_um: float

    @classmethod
    def through(cls, a: float, b: float, c_um: float, balls: tuple[int, ...], apexes_um: Array) -> PlaneTruth:
        """Measure the apexes (n, 3) from a plane."""
        below = (a * apexes_um[:, 0] + b * apexes_um[:, 1] + c_um - apexes_um[:, 2]) / math.sqrt(1.0 + a * a + b * b)
        return cls(a, b, c_um, balls, below, float(below.max()))


def seating_plane(apexes_um: Array, gravity_um: Array) -> PlaneTruth | None:
    """The plane on which the part stands, turned over on its balls.

    Among the triangles of three apexes that contain the centre of gravity, the plane of the one that is highest there
    lies above every apex. Triangles are tried one by one on a few apexes; the apex that sticks out most is added
    until none does, so the result is that of all triples. Where the part can rock, because the centre of gravity is
    above an apex or the line between two, every plane on which it comes to rest has the same height there; the worst
    coplanarity of them is returned.

    Parameters
    ----------
    apexes_um : (n, 3) float64
        Tops of the balls.
    gravity_um : (2,) float64
        Centre of gravity.

    Returns
    -------
    PlaneTruth or None
        None with fewer than 3 apexes, or a centre of gravity outside their hull.

    Examples
    --------
    >>> import numpy as np
    >>> apexes = np.array([[-1.0, -1, 5], [1, -1, 5], [1, 1, 5], [-1, 1, 4]])
    >>> round(seating_plane(apexes, np.zeros(2)).coplanarity_um, 9)
    1.0
    """
    if len(apexes_um) < MIN_BALLS:
        return None
    chosen = _outline(apexes_um)
    for _ in range(len(apexes_um)):
        planes = _highest_triangles(apexes_um, chosen, gravity_um)
        if not planes:
            remaining = [index for index in range(len(apexes_um)) if index not in chosen]
            if not remaining:
                return None
            chosen.append(remaining[0])
            continue
        # Triangles with the centre of gravity on an edge tie; one of them at least is above all that are chosen.
        plane = max(planes, key=lambda plane: plane.deviations_um[chosen].min())
        worst = int(np.argmin(plane.deviations_um))
        if plane.deviations_um[worst] >= -TOUCH_UM:
            others = _rocked(apexes_um, plane, gravity_um)
            other = max(others, key=lambda plane: plane.coplanarity_um, default=plane)
            # Those come from a polygon with a little play; the plane itself is exact.
            return other if other.coplanarity_um > plane.coplanarity_um + TOUCH_UM else plane
        chosen.append(worst)
    return None


def regression_plane(apexes_um: Array) -> PlaneTruth | None:
    """The least-squares plane of all apexes, moved up to the one farthest from the board; None for fewer than 3.

    Examples
    --------
    >>> import numpy as np
    >>> apexes = np.array([[-1.0, -1, 5], [1, -1, 5], [1, 1, 5], [-1, 1, 5]])
    >>> round(regression_plane(apexes).c_um, 9)
    5.0
    """
    if len(apexes_um) < MIN_BALLS:
        return None
    system = np.column_stack([apexes_um[:, :2], np.ones(len(apexes_um))])
    (a, b, c_um), _, rank, _ = np.linalg.lstsq(system, apexes_um[:, 2], rcond=None)
    if rank < MIN_BALLS:
        return None
    residuals = apexes_um[:, 2] - system @ np.array([a, b, c_um])
    highest = int(np.argmax(residuals))
    return PlaneTruth.through(float(a), float(b), float(c_um + residuals[highest]), (highest,), apexes_um)


def _rocked(apexes_um: Array, plane: PlaneTruth, gravity_um: Array) -> list[PlaneTruth]:
    """The other planes above every apex that are as high at the centre of gravity, where the part can rock."""
    shares = _barycentric(apexes_um[None, list(plane.balls), :2], gravity_um)[0]
    if shares.min() > TINY:
        return []
    height_um = plane.a * gravity_um[0] + plane.b * gravity_um[1] + plane.c_um
    # Slopes allowed: a polygon, cut by the half-plane of each apex; what is left of the frame is no place to rest.
    slopes = STEEP * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    for x_um, y_um, z_um in apexes_um - [*gravity_um, height_um]:
        room = slopes @ [x_um, y_um] - (z_um - TINY)
        kept = []
        for index in range(len(slopes)):
            here, before = room[index], room[index - 1]
            if (here >= 0) != (before >= 0):
                share = before / (before - here)
                kept.append(slopes[index - 1] + share * (slopes[index] - slopes[index - 1]))
            if here >= 0:
                kept.append(slopes[index])
        slopes = np.array(kept).reshape(-1, 2)
    planes = []
    for a, b in slopes[np.abs(slopes).max(axis=1, initial=0.0) < 0.99 * STEEP]:
        c_um = float((apexes_um[:, 2] - a * apexes_um[:, 0] - b * apexes_um[:, 1]).max())
        found = PlaneTruth.through(float(a), float(b), c_um, (), apexes_um)
        balls = tuple(int(ball) for ball in np.flatnonzero(found.deviations_um <= TOUCH_UM))
        planes.append(replace(found, balls=balls))
    return planes


def _outline(apexes_um: Array) -> list[int]:
    """Extreme apexes in a few directions, seen from above: together they surround what all surround."""
    angles = np.arange(START_DIRECTIONS) * (2.0 * np.pi / START_DIRECTIONS) + 0.1
    reach = apexes_um[:, :1] * np.cos(angles) + apexes_um[:, 1:2] * np.sin(angles)
    return sorted({int(index) for index in np.argmax(reach, axis=0)})


def _highest_triangles(apexes_um: Array, chosen: list[int], gravity_um: Array) -> list[PlaneTruth]:
    """Planes of the triples of `chosen` around the centre of gravity that are highest there."""
    triples = np.array(list(combinations(sorted(chosen), 3)), dtype=np.intp).reshape(-1, 3)
    corners = apexes_um[triples]
    shares = _barycentric(corners[:, :, :2], gravity_um)
    around = np.isfinite(shares).all(axis=1) & (shares >= -TINY).all(axis=1)
    if not around.any():
        return []
    heights = np.where(around, (np.where(np.isfinite(shares), shares, 0.0) * corners[:, :, 2]).sum(axis=1), -np.inf)
    best = np.flatnonzero(heights >= heights.max() - TINY)
    planes = []
    for index in best:
        matrix = np.column_stack([corners[index, :, :2], np.ones(3)])
        a, b, c_um = np.linalg.solve(matrix, corners[index, :, 2])
        balls = tuple(int(ball) for ball in triples[index])
        planes.append(PlaneTruth.through(float(a), float(b), float(c_um), balls, apexes_um))
    return planes


def _barycentric(corners: NDArray[np.float64], point: Array) -> Array:
    """(m, 3) shares of a point in m triangles (m, 3, 2); NaN for triangles without area."""
    first, second, third = corners[:, 0], corners[:, 1], corners[:, 2]
    one, two, here = second - first, third - first, point - first
    area = one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        size = np.abs(one).max(axis=1) * np.abs(two).max(axis=1)
        area = np.where(np.abs(area) > TINY * size, area, np.nan)
        v = (here[:, 0] * two[:, 1] - here[:, 1] * two[:, 0]) / area
        w = (one[:, 0] * here[:, 1] - one[:, 1] * here[:, 0]) / area
    return np.column_stack([1.0 - v - w, v, w])
