"""All highlights of all balls at once: directions or positions of the lights, and the outlines between their errors."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from bgars.errors import CalibrationError
from bgars.station.lamp_distance import highlights_of
from bgars.station.mirror import reflected, sphere_of_outline

if TYPE_CHECKING:
    from collections.abc import Callable

    from bgars.station.lamp_distance import LampDistance

__all__ = ["LightSolution", "solve_lights"]

Array = NDArray[np.float64]

NEAR_SIGMAS = 4.0
"""Lights are near where one over their distance is, for half of them, so many standard deviations from 0."""
LEAST_U_RAD = 1e-6
LENS_SIDES = 0.2
"""One over the distance of a camera of which nothing is stated, standard deviation, in sides of the image: telecentric
lenses stand at 0, macro lenses at 0.1 to 0.2, ordinary ones at 0.3 to 0.7."""
ALIKE_SHARE = 0.45
"""Share of the variance of highlights and outlines that is the same at each place, and so does not fall with their
number: what the laws of edges and spots leave is alike on balls that are alike. Directions of rendered balls scatter by
0.038 degrees at one place, and by 0.030, not 0.022, as means of three."""
ASKED = 4.0
"""Fall of chi square, for each of its parameters, from which on the balls ask for a lens."""
VIEW_RAD = math.radians(0.3)
"""Angle by which such a camera looks aside at the middle of its image: mounted by hand, or a picture that was cut."""


@dataclass(frozen=True, eq=False)
class LightSolution:
    """Lights with covariance.

    Attributes
    ----------
    directions : (L, 3)
        Unit vectors from the origin.
    nearness : (L,)
        One over distance, 1 / px; 0 for distant lights.
    covariance : (L, 3, 3)
        Of two turns (radians, across the direction) and nearness.
    own : (L, 3, 3)
        The part that is left with perfect outlines.
    tangents : (L, 2, 3)
        The axes of the two turns.
    residuals_px : (B, L, 2)
        NaN where not seen.
    outlines_px : (B, 3)
        Outlines after the fit.
    u_lens_deg : (L,)
        The part that comes from a camera of which nothing is stated; 0 of one that is.
    u_distance_deg : (L,)
        The part that comes from the distance that all lamps have in common; 0 of positions and of distant lamps.
    views_deg : (B, 2)
        By how much each ball is seen from another side than the camera says; standard deviations `u_views_deg` (B,)
        were expected.
    reduced_chi_square : float
        1 is as stated; NaN where nothing is to spare.
    """

    directions: Array
    nearness: Array
    covariance: Array
    own: Array
    tangents: Array
    residuals_px: Array
    outlines_px: Array
    reduced_chi_square: float
    u_lens_deg: Array
    u_distance_deg: Array
    views_deg: Array
    u_views_deg: Array

    @property
    def u_deg(self) -> Array:
        """(L,) standard uncertainty on either axis."""
        return _u_deg(self.covariance)

    @property
    def u_own_deg(self) -> Array:
        """(L,) the part of each light alone."""
        return np.minimum(_u_deg(self.own), self.u_deg)

    @property
    def u_at_ball_deg(self) -> Array:
        """(L,) without the part of the lamps' distance, which tilts all lights alike: as the ball sees them."""
        u_deg: Array = np.sqrt(np.maximum(self.u_deg**2 - self.u_distance_deg**2, self.u_own_deg**2))
        return u_deg


def solve_lights(
    places_px: Array,
    covariances_px2: Array,
    outlines_px: Array,
    u_outlines_px: Array,
    camera_px: float,
    near: bool | None,
    side_px: float | None = None,
    lamps: LampDistance | None = None,
) -> LightSolution:
    """Fit the lights to highlights.

    Parameters
    ----------
    places_px, covariances_px2 : (B, L, 2), (B, L, 2, 2)
        Highlights of L lights on B balls; NaN where not seen. Each light is seen on a ball.
    outlines_px, u_outlines_px : (B, 3)
        Circles and their standard uncertainties.
    camera_px : float
        Distance of the camera.
    near : bool or None
        Positions or directions; None: positions where the highlights ask for them.
    side_px : float, optional
        Longer side of the image, where nothing is known of the camera: it may then stand at some such sides.
    lamps : LampDistance, optional
        How far lamps are where no positions are fitted; without it they are distant.

    Raises
    ------
    CalibrationError
        Positions are asked for, but a light is seen on one ball only.
    """
    seen: NDArray[np.bool_] = np.asarray(np.isfinite(places_px).all(axis=2))
    if near and int(seen.sum(axis=0).min()) < 2:  # noqa: PLR2004 - rays that cross
        index = int(seen.sum(axis=0).argmin())
        msg = (
            f"light {index} (counted from 0): its position needs its highlight on two balls or more, got "
            f"{int(seen[:, index].sum())}"
        )
        raise CalibrationError(msg)
    given = places_px, covariances_px2, outlines_px, u_outlines_px, camera_px
    distant = _solve(*given, near=False, side_px=side_px, lamps=lamps)
    if near is False or int(seen.sum(axis=0).min()) < 2:  # noqa: PLR2004
        return distant
    placed = _solve(*given, near=True, side_px=side_px, lamps=None)
    if near:
        return placed
    sure = placed.nearness / np.sqrt(placed.covariance[:, 2, 2])
    return placed if float(np.median(sure)) > NEAR_SIGMAS else distant


def _solve(
    places: Array,
    covariances: Array,
    outlines: Array,
    u_outlines: Array,
    camera_px: float,
    near: bool,
    side_px: float | None,
    lamps: LampDistance | None,
) -> LightSolution:
    balls, lights = places.shape[:2]
    seen: NDArray[np.bool_] = np.asarray(np.isfinite(places).all(axis=2))
    first = np.array([_first(places[:, light], outlines, camera_px) for light in range(lights)])
    across = _tangents(first)
    whiten = np.zeros((balls, lights, 2, 2))
    whiten[seen] = np.linalg.inv(np.linalg.cholesky(covariances[seen]))
    size = 3 if near else 2
    scale_px = float(np.max(np.abs(outlines)))

    part = lights * size
    of_lamps = part + 3 * balls
    rest_of = of_lamps + (lamps is not None)
    taken = [None] * balls if lamps is None or lamps.taken is None else lamps.taken
    u_lens = 0.0 if side_px is None else LENS_SIDES / side_px
    # A ball aside is seen from aside, by its distance over the camera's.
    u_views = np.hypot(VIEW_RAD, u_lens * np.hypot(*outlines[:, :2].T)) if side_px is not None else np.zeros(balls)

    def unpack(values: Array) -> tuple[Array, Array, Array]:
        turns = values[:part].reshape(lights, size)
        directions = first + np.einsum("lk,lkc->lc", turns[:, :2], across)
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        nearness = turns[:, 2] / scale_px if near else np.zeros(lights)
        if lamps is not None:
            nearness = np.full(lights, lamps.mean + lamps.u * values[of_lamps])
        circles = outlines + u_outlines * values[part:of_lamps].reshape(balls, 3)
        return directions, nearness, circles

    def off(values: Array) -> Array:
        directions, nearness, circles = unpack(values)
        lens = camera_px
        views = np.zeros((balls, 2))
        if side_px is not None:
            # No camera stands behind the board: the sign of its inverse distance has no meaning.
            lens = 1.0 / max(u_lens * abs(float(values[rest_of])), 1e-9)
            views = u_views[:, None] * values[rest_of + 1 :].reshape(balls, 2)
        rest: Array = places - np.array(
            [
                highlights_of(_turned(directions, view), nearness, sphere_of_outline(circle, lens), lens, one)
                for circle, view, one in zip(circles, views, taken, strict=True)
            ]
        )
        return rest

    def residuals(values: Array) -> Array:
        scaled = np.einsum("blij,blj->bli", whiten, np.where(seen[..., None], off(values), 0.0))
        rows: Array = np.concatenate([scaled[seen].ravel(), values[part:]])
        return rows

    spare = 2 * int(seen.sum()) - part
    start = np.zeros(rest_of + (0 if side_px is None else 1 + 2 * balls))
    scales = np.where(np.arange(len(start)) < part, 0.01, 1.0)
    fitted, left, jacobian = _fitted(residuals, start, scales, rest_of if spare > 0 else len(start))
    directions, nearness, circles = unpack(fitted)
    chi = float(np.square(left).sum() / spare) if spare > 0 else math.nan
    raised = (max(1.0, chi) if spare > 0 else 1.0) * (1.0 + ALIKE_SHARE * (float(seen.sum(axis=0).mean()) - 1.0))
    normal = jacobian.T @ jacobian
    number = np.arange(len(start))
    whole, stated, far, alone = (
        _blocks(np.asarray(np.linalg.pinv(normal[np.ix_(free, free)]) * raised, np.float64), lights, size, scale_px)
        for free in (number, number[:rest_of], np.delete(number, range(of_lamps, rest_of)), number[:part])
    )
    views = np.zeros((balls, 2)) if side_px is None else u_views[:, None] * fitted[rest_of + 1 :].reshape(balls, 2)
    return LightSolution(
        directions,
        nearness if near else np.zeros(lights),
        whole,
        alone,
        across,
        np.where(seen[..., None], off(fitted), np.nan),
        circles,
        chi,
        np.sqrt(np.maximum(_u_deg(whole) ** 2 - _u_deg(stated) ** 2, 0.0)),
        np.sqrt(np.maximum(_u_deg(whole) ** 2 - _u_deg(far) ** 2, 0.0)),
        np.degrees(views),
        np.degrees(u_views),
    )


def _fitted(
    residuals: Callable[[Array], Array], start: Array, scales: Array, rest_of: int
) -> tuple[Array, Array, Array]:
    """Parameters, residuals and their Jacobian; those from `rest_of` on, of a lens, only where the balls ask for it.

    What the balls can be explained without needs no explaining.
    """
    fit = least_squares(residuals, start, x_scale=scales, max_nfev=60)
    if rest_of < len(start):

        def by_the_rest(values: Array) -> Array:
            return residuals(np.append(values, start[rest_of:]))

        stiff = least_squares(by_the_rest, start[:rest_of], x_scale=scales[:rest_of], max_nfev=60)
        if 2.0 * (stiff.cost - fit.cost) < ASKED * (len(start) - rest_of):
            values = np.append(stiff.x, start[rest_of:])
            return values, residuals(values), _jacobian(residuals, values)
    return fit.x, fit.fun, np.asarray(fit.jac, dtype=np.float64)


def _jacobian(residuals: Callable[[Array], Array], at: Array) -> Array:
    """Forward differences: at a lens of which nothing is known only one side exists."""
    here, step = residuals(at), 1e-4
    columns = [(residuals(at + step * axis) - here) / step for axis in np.eye(len(at))]
    return np.column_stack(columns)


def _turned(directions: Array, view_rad: Array) -> Array:
    """Directions as a camera that looks aside by two small angles (toward x, toward y) sees them."""
    turned = directions.copy()
    turned[:, :2] -= directions[:, 2:] * view_rad
    turned[:, 2] += directions[:, :2] @ view_rad
    turned /= np.linalg.norm(turned, axis=1, keepdims=True)
    return turned


def _first(places: Array, outlines: Array, camera_px: float) -> Array:
    """Mean of what the balls show of one light."""
    total = np.zeros(3)
    for place, outline in zip(places, outlines, strict=True):
        if np.isfinite(place).all():
            total += reflected(place, sphere_of_outline(outline, camera_px), camera_px)[1]
    return total / np.linalg.norm(total)


def _tangents(directions: Array) -> Array:
    """(L, 2, 3) unit vectors across: one level, one upward."""
    level = np.cross(np.array([0.0, 0.0, 1.0]), directions)
    flat = np.linalg.norm(level, axis=1) < 1e-9  # noqa: PLR2004 - straight above
    level[flat] = [1.0, 0.0, 0.0]
    level /= np.linalg.norm(level, axis=1, keepdims=True)
    return np.stack([level, np.cross(directions, level)], axis=1)


def _blocks(covariance: Array, lights: int, size: int, scale_px: float) -> Array:
    blocks = np.zeros((lights, 3, 3))
    for light in range(lights):
        part = slice(light * size, (light + 1) * size)
        blocks[light, :size, :size] = covariance[part, part]
    blocks[:, 2, :] /= scale_px
    blocks[:, :, 2] /= scale_px
    return blocks


def _u_deg(covariance: Array) -> Array:
    variance = 0.5 * (covariance[:, 0, 0] + covariance[:, 1, 1])
    u: Array = np.degrees(np.sqrt(np.maximum(variance, LEAST_U_RAD**2)))
    return u
