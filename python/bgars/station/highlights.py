"""The highlight of each light on a mirror ball: found, told from other reflections, and placed to a part of a pixel.

An LED is a disc. Its image on the ball is not, and a saturated one is a clipped disc: so the disc itself, as the ball
shows it, is fitted to the pixels, blurred and clipped as they are.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.optimize import least_squares
from scipy.special import chndtr

from bgars.station.mirror import Sphere, image_of, reflected

__all__ = ["Highlight", "Spot", "blurred_disc", "find_spot", "fit_highlight", "glare", "middle_of", "spread_of"]

Array = NDArray[np.float64]

REACH = 0.74
"""Highlights of lights above the board lie within 0.707 of the radius; farther out the ball shows the board."""
LEAST_SIGNAL = 6.0
"""A highlight is so many times the noise, or there is none."""
HALF = 0.5
SECOND_SHARE = 0.35
"""Area of a second spot, of the first one's, from which on it is unclear which is the lamp."""
BLUR_PX = (0.25, 8.0)
"""Softest and sharpest edge of a highlight."""
MISFIT, TAIL_MISFIT = 0.04, 0.2
"""Share of its level by which a highlight may differ from a blurred disc, inside and on its tail."""
KNOTS = 64
GRID_PX = 0.03
"""What pixels, as areas that are sampled at points, leave of a position."""
CENTROID_GRID_PX = 0.02
"""The same of a centroid: sums over whole pixels are true to the sampling of a blurred spot."""
AROUND, TAIL_PX, RING_PX = 1.5, 3.0, 3.0
"""Light of a highlight reaches so many of its extents, and so many pixels more; around it a ring shows its ground."""
LOPSIDED_SHARE, COARSE_PX = 0.3, 0.25
WINDOW_PX, WINDOW_ROUNDS, LEAST_GAIN = 0.5, 12, 0.2
"""A window as wide as the spot, and half a pixel more, keeps the noise of its surroundings out."""
SUBPIXELS = 3
MOST_PIXELS = 60
"""Half the side of the patch that is fitted, at most."""
EFFORT = 60


@dataclass(frozen=True)
class Spot:
    """Where the highlight of a light is, roughly."""

    row: float
    col: float
    extent_px: float
    peak_level: float
    area_px: float
    second_share: float
    """Area of the next spot, of this one's."""
    second_place: tuple[float, float]
    """Row and column of that; of this one where there is none."""
    pixels: NDArray[np.intp]
    """(N, 2) rows and columns of its bright pixels."""


@dataclass(frozen=True)
class Highlight:
    """Highlight of a light: the point of the image at which the ball shows the middle of the lamp.

    Attributes
    ----------
    x_px, y_px : float
        From the image centre.
    covariance_px2 : (2, 2)
        Of both.
    lamp_deg : float
        Angle of the whole lamp as the fit sees it.
    blur_px : float
        Width of its edge, a standard deviation.
    flux : float
        Level times solid angle; NaN where the highlight is saturated.
    saturated : bool
        Some of it reaches the clip level.
    misfit : float
        Root mean square of the weighted residuals: 1 is as stated.
    """

    x_px: float
    y_px: float
    covariance_px2: Array
    lamp_deg: float
    blur_px: float
    flux: float
    saturated: bool
    misfit: float


def glare(images: Array, circle_px: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Return what every light shows on the ball (the median over lights, (H, W)), and where highlights can be (H, W).

    Reflections of the room do not depend on which light is on.
    """
    height, width = images.shape[1:]
    rows, cols = np.mgrid[:height, :width]
    x, y = cols + 0.5 - width / 2.0, height / 2.0 - rows - 0.5
    usable = np.hypot(x - circle_px[0], y - circle_px[1]) < REACH * circle_px[2]
    few = 4
    still = np.median(images, axis=0) if len(images) >= few else images.min(axis=0)
    return still, usable


def find_spot(image: Array, still: Array, usable: NDArray[np.bool_], clip: float, noise: float) -> Spot | None:
    """Return the largest bright spot of an image on the ball, or None without one."""
    change = np.where(usable, image - still, 0.0)
    smooth = ndimage.gaussian_filter(change, 0.7)
    peak = float(smooth.max())
    if peak < LEAST_SIGNAL * noise:
        return None
    clipped = usable & (image >= clip) & (change > HALF * change.max())
    core = clipped if clipped.sum() > 3 else smooth > HALF * peak  # noqa: PLR2004 - more than a hot pixel
    labels, count = ndimage.label(core, structure=np.ones((3, 3)))
    which = np.arange(1, count + 1)
    areas = ndimage.sum(core, labels, which)
    order = np.argsort(areas)[::-1]
    first = int(which[order[0]])
    where = labels == first
    row, col = ndimage.center_of_mass(np.where(where, 1.0, 0.0))
    rows, cols = np.nonzero(where)
    extent = max(float(np.hypot(rows - row, cols - col).max()) + 0.5, 1.0)
    middles = ((float(areas[one]), *ndimage.center_of_mass(labels == which[one])) for one in order[1:])
    apart = [one for one in middles if math.hypot(one[1] - row, one[2] - col) > 3.0 * extent]
    second, *place = max(apart, default=(0.0, row, col))
    peak_level, area = float(change[where].max()), float(areas[order[0]])
    return Spot(row, col, extent, peak_level, area, second / area, (place[0], place[1]), np.column_stack([rows, cols]))


def fit_highlight(
    image: Array, still: Array, spot: Spot, sphere: Sphere, clip: float, noise: float, camera_px: float = math.inf
) -> Highlight | None:
    """Fit a blurred, clipped disc in the space of directions; None where the fit leaves the spot."""
    height, width = image.shape
    half = int(min(max(4.0, 2.5 * spot.extent_px + 3.0), MOST_PIXELS))
    top, left = max(0, int(spot.row) - half), max(0, int(spot.col) - half)
    window = (slice(top, min(height, int(spot.row) + half + 1)), slice(left, min(width, int(spot.col) + half + 1)))
    seen, base = image[window], still[window]
    rows, cols = np.mgrid[window]
    sub = (np.arange(SUBPIXELS) + 0.5) / SUBPIXELS - 0.5
    x = (cols + 0.5 - width / 2.0)[..., None, None] + sub[None, :]
    y = (height / 2.0 - rows - 0.5)[..., None, None] - sub[:, None]
    grid = np.stack(np.broadcast_arrays(x, y), axis=-1)
    _, directions = reflected(grid, sphere, camera_px)
    # Half of an angle between directions is an angle between normals; radius times that are pixels of the ball.
    to_px = 0.5 * sphere.radius_px
    start = np.array([spot.col + 0.5 - width / 2.0, height / 2.0 - spot.row - 0.5])

    def residuals(values: Array) -> Array:
        x_px, y_px, log_level, log_extent, log_blur, offset = values
        _, middle = reflected(np.array([x_px, y_px]), sphere, camera_px)
        apart = 2.0 * np.arcsin(np.clip(0.5 * np.linalg.norm(directions - middle, axis=-1), 0.0, 1.0)) * to_px
        cover = blurred_disc(apart, math.exp(log_extent), math.exp(log_blur)).mean(axis=(-1, -2))
        disc = math.exp(min(log_level, 20.0)) * cover
        spread = spread_of(disc, cover, clip, noise)
        scaled: Array = ((seen - np.minimum(base + offset + disc, clip)) / spread).ravel()
        return scaled

    first = np.array(
        [*start, math.log(max(spot.peak_level, 1.0)), math.log(max(math.sqrt(spot.area_px / math.pi), 0.6)), 0.0, 0.0]
    )
    low = [start[0] - half, start[1] - half, -5.0, math.log(0.3), math.log(BLUR_PX[0]), -np.inf]
    high = [start[0] + half, start[1] + half, 20.0, math.log(3.0 * half), math.log(BLUR_PX[1]), np.inf]
    fit = least_squares(
        residuals, first, bounds=(low, high), loss="soft_l1", x_scale=[0.1, 0.1, 0.1, 0.1, 0.1, 1.0], max_nfev=EFFORT
    )
    misfit = float(np.sqrt(np.mean(np.minimum(fit.fun**2, 100.0))))
    jacobian = np.asarray(fit.jac, dtype=np.float64)
    normal = jacobian.T @ jacobian
    covariance = np.linalg.pinv(normal)[:2, :2] * max(1.0, misfit**2) + GRID_PX**2 * np.eye(2)
    x_px, y_px, _, log_extent, log_blur, _ = fit.x
    saturated = bool((seen[np.hypot(rows - spot.row, cols - spot.col) < spot.extent_px + 2.0] >= clip).any())
    lamp_deg, blur_px = math.degrees(2.0 * math.exp(log_extent) / to_px), math.exp(log_blur)
    if not saturated:
        place, covariance, total = _centroid(image - still, spot, sphere, noise, camera_px)
        return Highlight(
            float(place[0]), float(place[1]), covariance, lamp_deg, blur_px, total / to_px**2, False, misfit
        )
    if np.hypot(x_px - start[0], y_px - start[1]) > max(2.0, spot.extent_px):
        return None
    return Highlight(float(x_px), float(y_px), covariance, lamp_deg, blur_px, math.nan, True, misfit)


def _centroid(change: Array, spot: Spot, sphere: Sphere, noise: float, camera_px: float) -> tuple[Array, Array, float]:
    """Place of the mean direction of the light of a whole highlight, its covariance, and the sum of its levels.

    Noise of every pixel counts; so do a slope of what lies around, and a middle of the bright pixels elsewhere, for a
    disc has both in one place.
    """
    rows, cols = np.mgrid[: change.shape[0], : change.shape[1]]
    apart = np.hypot(rows - spot.row, cols - spot.col)
    reach = AROUND * spot.extent_px + TAIL_PX
    inside, ring = apart <= reach, (apart > reach) & (apart <= reach + RING_PX)
    points = np.stack([cols + 0.5 - change.shape[1] / 2.0, change.shape[0] / 2.0 - rows - 0.5], axis=-1)
    middle = points[inside].mean(axis=0)
    # A plane through the ring: what the board, seen in the ball, changes with the light.
    plane = np.column_stack([np.ones(int(ring.sum())), points[ring] - middle])
    level, *slope = np.linalg.lstsq(plane, change[ring], rcond=None)[0]
    light = change[inside] - level - (points[inside] - middle) @ slope
    total = max(float(light.sum()), noise)
    _, directions = reflected(points[inside], sphere, camera_px)
    wide = spot.extent_px + WINDOW_PX
    place = middle_of(spot, change.shape, sphere, camera_px)
    # Under a Gaussian window the mean moves by less than the spot: repeated until both are in one place.
    for _ in range(WINDOW_ROUNDS):
        off = points[inside] - place
        window = np.exp(-0.5 * np.square(off).sum(axis=1) / wide**2)
        mean = (window * light) @ directions
        place = image_of((mean / np.linalg.norm(mean))[None, :], np.zeros(1), sphere, camera_px)[0]
    off = points[inside] - place
    window = np.exp(-0.5 * np.square(off).sum(axis=1) / wide**2)
    seen = max(float(window @ light), noise)
    spread = 0.5 * float(window * light @ np.square(off).sum(axis=1)) / seen
    gain = 1.0 / max(1.0 - spread / wide**2, LEAST_GAIN)
    covariance = (gain * noise / seen) ** 2 * (window**2 * off.T) @ off + CENTROID_GRID_PX**2 * np.eye(2)
    sloping = gain * np.square(off).T @ window * np.array(slope) / seen
    lopsided = LOPSIDED_SHARE * (middle_of(spot, change.shape, sphere, camera_px) - place)
    # The bright pixels of a small spot are few: their middle is no better than a share of a pixel.
    lopsided = np.sign(lopsided) * np.maximum(np.abs(lopsided) - LOPSIDED_SHARE * COARSE_PX, 0.0)
    return place, covariance + np.outer(sloping, sloping) + np.outer(lopsided, lopsided), total


def middle_of(spot: Spot, shape: tuple[int, ...], sphere: Sphere, camera_px: float = math.inf) -> Array:
    """(2,) place of the mean direction of the bright pixels: equal areas of a ball's image are equal solid angles."""
    x = spot.pixels[:, 1] + 0.5 - shape[1] / 2.0
    y = shape[0] / 2.0 - spot.pixels[:, 0] - 0.5
    _, directions = reflected(np.column_stack([x, y]), sphere, camera_px)
    mean = directions.mean(axis=0)
    place: Array = image_of((mean / np.linalg.norm(mean))[None, :], np.zeros(1), sphere, camera_px)[0]
    return place


def blurred_disc(apart_px: Array, radius_px: float, blur_px: float) -> Array:
    """Share of the light of a disc at a distance from its middle, after a Gaussian blur: 1 - Q_1 (Marcum 1950)."""
    top = radius_px + 6.0 * blur_px
    knots = np.linspace(0.0, top, KNOTS)
    table = chndtr((radius_px / blur_px) ** 2, 2.0, (knots / blur_px) ** 2)
    cover: Array = np.interp(apart_px, knots, table, right=0.0)
    return cover


def spread_of(disc: Array, cover: Array, clip: float, noise: float) -> Array:
    """Standard deviation of a pixel against the model: nobody knows the far tail of a lens."""
    share = MISFIT + TAIL_MISFIT * (1.0 - np.minimum(cover, 1.0)) ** 4
    spread: Array = np.sqrt(noise**2 + (share * np.minimum(disc, clip)) ** 2)
    return spread
