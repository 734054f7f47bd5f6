"""Clipped highlights of a few pixels, fitted together: one lamp's size, one lens and one grid of pixels for all lights.

A pixel of such a spot is black, clipped, or on the tail of what blurs it, and the tail says where the middle is: by how
much one side is brighter than the other, and by how steep the tail is. So what blurs is fitted, too: the lens before
the pixels, the share of a pixel that sees light, and a filter after the pixels (resampling, colour filters, renderers).
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from bgars.station.highlights import blurred_disc, spread_of
from bgars.station.mirror import reflected

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bgars.station.highlights import Spot
    from bgars.station.mirror import Sphere

__all__ = ["FittedSpots", "fit_spots"]

Array = NDArray[np.float64]

SUBPIXELS = 4
MARGIN_PX = 3.0
"""Pixels around a spot that its tail reaches."""
BOUNDS_PX = ((0.15, 12.0), (0.12, 2.0), (0.15, 2.0))
"""Of the disc's radius, the width of the lens's blur, and that of the filter after the pixels (its least is none)."""
STARTS_PX = ((0.5, 0.2), (0.2, 0.5))
"""Both blurs: either can be the larger."""
MODEL_PX = 0.04
"""What lenses and lamps that are neither Gaussian nor a disc leave of a place, seen on rendered balls."""
EFFORT, MOST_DAMPING, LEAST_GAIN = 25, 1e6, 0.02
SHARED, OWN = 3, 3
"""Unknowns of all lights together, and of each: its place and the logarithm of its level."""


class FittedSpots(NamedTuple):
    """Places (L, 2), their covariances (L, 2, 2) and misfits (L,) of lights; radius of their disc on the ball."""

    places_px: Array
    covariances_px2: Array
    misfits: Array
    extent_px: float


def fit_spots(
    images: Sequence[Array],
    still: Array,
    spots: Sequence[Spot],
    starts_px: Array,
    sphere: Sphere,
    clip: float,
    noise: float,
    camera_px: float,
    extent_px: float,
) -> FittedSpots:
    """Fit discs of one size, blurred alike, to the spots of L lights, from places (L, 2) and a radius on the ball."""
    seen = _Patches(images, still, spots, sphere, clip, noise, camera_px)
    own = np.column_stack([starts_px, np.full(len(seen), math.log(4.0 * clip))]).ravel()
    fits = [
        _solve(seen, np.concatenate([np.log([max(extent_px, 0.3), lens, filter_px]), own]))
        for lens, filter_px in STARTS_PX
    ]
    values, normal, _ = min(fits, key=lambda fit: fit[2])
    misfits = np.array([math.sqrt(float(np.mean(np.minimum(part**2, 100.0)))) for part in seen.residuals(values)])
    whole = np.linalg.pinv(normal)
    blocks = [slice(SHARED + OWN * light, SHARED + OWN * light + 2) for light in range(len(seen))]
    raised = np.maximum(misfits, 1.0)[:, None, None] ** 2
    covariances = np.array([whole[block, block] for block in blocks]) * raised + MODEL_PX**2 * np.eye(2)
    return FittedSpots(values[SHARED:].reshape(-1, OWN)[:, :2], covariances, misfits, math.exp(values[0]))


class _Patches:
    """Pixels around the spots, and what a disc in the mirror makes of them."""

    def __init__(
        self,
        images: Sequence[Array],
        still: Array,
        spots: Sequence[Spot],
        sphere: Sphere,
        clip: float,
        noise: float,
        camera_px: float,
    ) -> None:
        self.sphere, self.clip, self.noise, self.camera_px = sphere, clip, noise, camera_px
        sub = (np.arange(SUBPIXELS) + 0.5) / SUBPIXELS - 0.5
        inner = np.stack(np.meshgrid(sub, -sub), axis=-1).reshape(-1, 2)
        height, width = still.shape
        self.levels, self.grounds, self.toward = [], [], []
        for image, spot in zip(images, spots, strict=True):
            half = math.ceil(spot.extent_px + MARGIN_PX)
            row, col = round(spot.row), round(spot.col)
            window = (
                slice(max(row - half, 0), min(row + half + 1, height)),
                slice(max(col - half, 0), min(col + half + 1, width)),
            )
            rows, cols = np.mgrid[window]
            centres = np.stack([cols + 0.5 - width / 2.0, height / 2.0 - rows - 0.5], axis=-1)
            self.levels.append(image[window])
            self.grounds.append(still[window])
            self.toward.append(reflected(centres[:, :, None, :] + inner, sphere, camera_px)[1])

    def __len__(self) -> int:
        return len(self.levels)

    def residuals(self, values: Array) -> list[Array]:
        """Of each light, in standard deviations."""
        extent, lens, filter_px = np.exp(values[:SHARED])
        own = values[SHARED:].reshape(-1, OWN)
        _, middles = reflected(own[:, :2], self.sphere, self.camera_px)
        found = []
        for seen, ground, toward, middle, log_level in zip(
            self.levels, self.grounds, self.toward, middles, own[:, 2], strict=True
        ):
            # Half of an angle between directions is an angle between normals; radius times that are pixels of the ball.
            apart = np.sqrt(2.0 * np.maximum(1.0 - toward @ middle, 0.0)) * 0.5 * self.sphere.radius_px
            cover = ndimage.gaussian_filter(blurred_disc(apart, extent, lens).mean(axis=-1), filter_px, mode="nearest")
            disc = math.exp(min(log_level, 20.0)) * cover
            spread = spread_of(disc, cover, self.clip, self.noise)
            found.append(((seen - np.minimum(ground + disc, self.clip)) / spread).ravel())
        return found

    def jacobian(self, values: Array) -> Array:
        """Differences: a light's own unknowns change its own pixels only, so those of all lights are moved at once."""
        here, step = self.residuals(values), 1e-4
        whole = np.concatenate(here)
        ends = np.cumsum([0, *[len(part) for part in here]])
        found = np.zeros((len(whole), len(values)))
        for index in range(SHARED):
            moved = values.copy()
            moved[index] += step
            found[:, index] = (np.concatenate(self.residuals(moved)) - whole) / step
        for index in range(OWN):
            moved = values.copy()
            moved[SHARED + index :: OWN] += step
            off = (np.concatenate(self.residuals(moved)) - whole) / step
            for light, (start, end) in enumerate(pairwise(ends)):
                found[start:end, SHARED + index + OWN * light] = off[start:end]
        return found


def _solve(seen: _Patches, start: Array) -> tuple[Array, Array, float]:
    """Unknowns, normal matrix and cost (Levenberg 1944; residuals weighted as soft L1 asks, each round anew)."""
    low, high = np.full(len(start), -np.inf), np.full(len(start), np.inf)
    low[:SHARED], high[:SHARED] = np.log(BOUNDS_PX).T
    values, damping = np.clip(start, low, high), 1e-2
    residuals = np.concatenate(seen.residuals(values))
    cost = _cost(residuals)
    normal = np.eye(len(start))
    for _ in range(EFFORT):
        jacobian = seen.jacobian(values)
        weight = 1.0 / np.sqrt(1.0 + residuals**2)
        normal = jacobian.T @ (weight[:, None] * jacobian)
        right = jacobian.T @ (weight * residuals)
        while damping < MOST_DAMPING:
            damped = normal + damping * np.diag(np.diag(normal) + 1e-9)
            ahead = np.clip(values - np.linalg.solve(damped, right), low, high)
            there = np.concatenate(seen.residuals(ahead))
            if _cost(there) < cost:
                break
            damping *= 8.0
        else:
            break
        gain = cost - _cost(there)
        values, residuals, cost, damping = ahead, there, _cost(there), max(damping / 8.0, 1e-6)
        if gain < LEAST_GAIN:
            break
    return values, normal, cost


def _cost(residuals: Array) -> float:
    return float(np.sum(2.0 * (np.sqrt(1.0 + residuals**2) - 1.0)))
