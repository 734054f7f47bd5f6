"""Highlights of a few saturated pixels: all positions, sizes, blurs and levels that explain them, weighed.

Where a small disc is clipped, its pixels say little but whether the disc touches them: there are no slopes to fit.
Size and blur are those of all lights together; position and level each light's own. The position is the mean of the
posterior, its covariance that of the posterior.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from bgars.station.highlights import BLUR_PX, Spot, blurred_disc, spread_of
from bgars.station.mirror import Sphere, reflected

__all__ = ["SMALL_PX", "SmallSpot", "place_small_spots"]

Array = NDArray[np.float64]

SMALL_PX = 4.0
"""Radius up to which a saturated spot is one of these."""
STEP_PX, REACH_PX = 0.12, 1.08
"""Grid of positions around the middle of the clipped pixels."""
SHRINK_PX = (1.2, 0.9, 0.65, 0.45, 0.25, 0.05, -0.2)
"""How much smaller the disc may be than what is clipped of it."""
BLURS_PX = (BLUR_PX[0], 0.45, 0.75, 1.2)
LEVELS = (1.2, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0)
"""Levels of the disc, of the clip level: even chances on a log scale."""
LEAST_RADIUS_PX = 0.35
SUBPIXELS = 3
TEMPER = 3.0
"""Pixels that share their misfit: sizes, blurs and levels come in steps, and no lens blurs like a Gaussian."""
WORST = 25.0
"""Square of a residual from which on a pixel is something else."""


class SmallSpot(NamedTuple):
    """Position and covariance in the image, and the lamp that all share."""

    place_px: Array
    covariance_px2: Array
    lamp_deg: float
    blur_px: float


def place_small_spots(
    images: list[Array], still: Array, spots: list[Spot], sphere: Sphere, clip: float, noise: float, camera_px: float
) -> list[SmallSpot]:
    """Return the place of the highlight of each image."""
    radius = math.sqrt(float(np.median([spot.area_px for spot in spots])) / math.pi)
    sizes = np.unique(np.maximum(radius - np.array(SHRINK_PX), LEAST_RADIUS_PX))
    tables = [
        _log_likelihood(image, still, spot, sphere, clip, noise, camera_px, sizes)
        for image, spot in zip(images, spots, strict=True)
    ]
    own = np.array([logsumexp(table, axis=2) for table in tables])
    found = []
    steps = _steps()
    for index, (table, spot) in enumerate(zip(tables, spots, strict=True)):
        # What the other lights say about size and blur, and this one about everything.
        shape = np.delete(own, index, axis=0).sum(axis=0)
        weights = table + shape[:, :, None]
        weights = np.exp(weights - weights.max())
        weights /= weights.sum()
        mean = weights.sum(axis=(0, 1)) @ steps
        off = steps - mean
        covariance = (weights.sum(axis=(0, 1))[:, None] * off).T @ off + STEP_PX**2 / 12.0 * np.eye(2)
        size = float(weights.sum(axis=(1, 2)) @ sizes)
        blur = float(weights.sum(axis=(0, 2)) @ np.array(BLURS_PX))
        lamp_deg = math.degrees(4.0 * size / sphere.radius_px)
        found.append(SmallSpot(_middle(spot, still.shape) + mean, covariance, lamp_deg, blur))
    return found


def _steps() -> Array:
    """(P, 2) positions against the middle."""
    line = np.arange(-REACH_PX, REACH_PX + STEP_PX / 2, STEP_PX)
    return np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)


def _middle(spot: Spot, shape: tuple[int, ...]) -> Array:
    return np.array([spot.col + 0.5 - shape[1] / 2.0, shape[0] / 2.0 - spot.row - 0.5])


def _log_likelihood(
    image: Array, still: Array, spot: Spot, sphere: Sphere, clip: float, noise: float, camera_px: float, sizes: Array
) -> Array:
    """(sizes, blurs, positions): levels are summed over."""
    height, width = image.shape
    half = math.ceil(spot.extent_px + REACH_PX + 1.0)
    row, col = round(spot.row), round(spot.col)
    window = (
        slice(max(row - half, 0), min(row + half + 1, height)),
        slice(max(col - half, 0), min(col + half + 1, width)),
    )
    rows, cols = np.mgrid[window]
    sub = (np.arange(SUBPIXELS) + 0.5) / SUBPIXELS - 0.5
    middle = _middle(spot, image.shape)
    grid = np.stack(
        np.broadcast_arrays(
            (cols + 0.5 - width / 2.0)[..., None, None] + sub[None, :] - middle[0],
            (height / 2.0 - rows - 0.5)[..., None, None] - sub[:, None] - middle[1],
        ),
        axis=-1,
    ).reshape(-1, SUBPIXELS**2, 2)
    near = np.hypot(*grid.mean(axis=1).T) < half
    grid = grid[near]
    metric = _metric(middle, sphere, camera_px)
    steps = _steps() @ metric.T
    apart = np.linalg.norm((grid @ metric.T)[None] - steps[:, None, None, :], axis=-1)
    seen, base = image[window].ravel()[near], still[window].ravel()[near]
    table = np.zeros((len(sizes), len(BLURS_PX), len(steps)))
    for index, size in enumerate(sizes):
        for place, blur in enumerate(BLURS_PX):
            cover = blurred_disc(apart, size, blur).mean(axis=2)
            sums = [_fit_of(seen, base, cover, level * clip, clip, noise) for level in LEVELS]
            table[index, place] = logsumexp(np.array(sums), axis=0)
    return table


def _fit_of(seen: Array, base: Array, cover: Array, level: float, clip: float, noise: float) -> Array:
    disc = level * cover
    spread = spread_of(disc, cover, clip, noise)
    off = np.minimum(((seen - np.minimum(base + disc, clip)) / spread) ** 2, WORST)
    fit: Array = (-0.5 * off.sum(axis=1) - np.log(spread).sum(axis=1)) / TEMPER
    return fit


def _metric(place: Array, sphere: Sphere, camera_px: float) -> Array:
    """(3, 2) change of direction for a step in the image, in pixels of the ball."""
    step = 0.05
    columns = []
    for axis in np.eye(2):
        _, ahead = reflected(place + step * axis, sphere, camera_px)
        _, behind = reflected(place - step * axis, sphere, camera_px)
        columns.append((ahead - behind) / (2.0 * step))
    return np.column_stack(columns) * 0.5 * sphere.radius_px
