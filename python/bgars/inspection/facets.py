"""The facet of the upper hull over a point: the linear program of the seating plane, for many parts at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bgars.errors import ConvergenceError

__all__ = ["FAKES", "hull_facets"]

Array = NDArray[np.float64]
FAKES = 3
"""Made-up apexes far below and far outside that the search starts from."""
FAR = 16.0
DEEP = -1.0e5
FEASIBLE = 1e-11
MAX_PIVOTS = 1000


def hull_facets(points: Array, heights: Array, place: Array) -> tuple[NDArray[np.intp], Array]:
    """Find the three apexes whose triangle holds a place and whose plane lies above all apexes.

    Minimising the plane's height at `place` subject to lying above every apex is a linear program in three unknowns;
    its dual walks from triangle to triangle around the place, each higher than the last, by exchanging one apex for
    the one that sticks out most (simplex method; Dantzig 1963, ch. 5). All parts walk at the same time.

    Parameters
    ----------
    points : (d, n, 2) float64
        Apexes of d parts seen from above, of size about 1.
    heights : (d, n) float64
        Heights of the apexes, of size about 1.
    place : (2,) float64
        Inside the hull; not on a line through two apexes, or the walk may stop at its limit.

    Returns
    -------
    corners : (d, 3) intp
        Indices of the apexes; n and more are made-up apexes: then the place is outside the hull.
    shares : (d, 3) float64
        Barycentric coordinates of the place in the triangle.

    Raises
    ------
    ConvergenceError
        The walk did not end within its limit.

    Examples
    --------
    >>> points = np.array([[[-1.0, -1], [1, -1], [1, 1], [-1, 1]]])
    >>> corners, _ = hull_facets(points, np.array([[0.0, 0, 0, -1]]), np.array([0.1, 0.0]))
    >>> sorted(corners[0].tolist())
    [0, 1, 2]
    """
    parts, count = heights.shape
    angles = 0.3 + np.arange(FAKES) * (2.0 * np.pi / FAKES)
    fake_points = np.broadcast_to(FAR * np.column_stack([np.cos(angles), np.sin(angles)]), (parts, FAKES, 2))
    ground = np.concatenate([points - place, fake_points], axis=1)
    z = np.concatenate([heights, np.full((parts, FAKES), DEEP)], axis=1)
    corners = np.tile(np.arange(count, count + FAKES, dtype=np.intp), (parts, 1))
    active = np.arange(parts)
    most = MAX_PIVOTS + count
    for pivots in range(most + 1):
        at = corners[active]
        lift, slopes = _planes(ground[active], z[active], at)
        room = lift[:, None] + np.einsum("dni,di->dn", ground[active], slopes) - z[active]
        np.put_along_axis(room, at, 0.0, axis=1)
        entering = room.argmin(axis=1)
        # Steep planes, as through a made-up apex, are known to fewer digits.
        going = room[np.arange(len(active)), entering] < -FEASIBLE * (1.0 + np.abs(slopes).max(axis=1))
        if not going.any():
            break
        if pivots == most:
            worst = float(-room.min())
            msg = f"seating plane: no facet after {pivots} exchanges of apexes, {worst:.3g} of the range sticks out"
            raise ConvergenceError(msg, pivots, worst)
        active, entering, at = active[going], entering[going], at[going]
        triangles = np.take_along_axis(ground[active], at[:, :, None], axis=1)
        here = _shares(triangles, np.zeros(2))
        there = _shares(triangles, ground[active, entering])
        with np.errstate(divide="ignore", invalid="ignore"):
            steps = np.where(there > FEASIBLE, np.maximum(here, 0.0) / there, np.inf)
        corners[active, steps.argmin(axis=1)] = entering
    triangles = np.take_along_axis(ground, corners[:, :, None], axis=1)
    return corners, _shares(triangles, np.zeros(2))


def _planes(ground: Array, z: Array, corners: NDArray[np.intp]) -> tuple[Array, Array]:
    """Height at the place (d,) and slopes (d, 2) of the planes through three apexes each."""
    triangles = np.take_along_axis(ground, corners[:, :, None], axis=1)
    tops = np.take_along_axis(z, corners, axis=1)
    one, two = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    rise_one, rise_two = tops[:, 1] - tops[:, 0], tops[:, 2] - tops[:, 0]
    area = one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]
    slope_x = (rise_one * two[:, 1] - rise_two * one[:, 1]) / area
    slope_y = (one[:, 0] * rise_two - two[:, 0] * rise_one) / area
    slopes = np.column_stack([slope_x, slope_y])
    lift: Array = tops[:, 0] - np.einsum("di,di->d", slopes, triangles[:, 0])
    return lift, slopes


def _shares(triangles: Array, point: Array) -> Array:
    """(d, 3) barycentric coordinates of points (d, 2) or (2,) in triangles (d, 3, 2)."""
    one, two = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    here = point - triangles[:, 0]
    area = one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]
    second = (here[:, 0] * two[:, 1] - here[:, 1] * two[:, 0]) / area
    third = (one[:, 0] * here[:, 1] - one[:, 1] * here[:, 0]) / area
    shares: Array = np.column_stack([1.0 - second - third, second, third])
    return shares
