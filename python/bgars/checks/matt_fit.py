"""Slopes of the small copy by least squares over the lights that show a matt surface: neither shadow nor highlight."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bgars.records.light_median import light_median

if TYPE_CHECKING:
    from bgars.checks.view import View

__all__ = ["COPLANAR", "MIN_LIGHTS", "STEEP", "MattFit", "fit_normals", "matt_lights", "promised"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

SHADOWED = 0.15
"""Of the pixel's median: darker than this under a light is taken as shadow, where no light is linear."""
DROPPED = 4
"""One light in so many, the brightest ones, is left out: highlights are bright. From `DROPS_FROM` lights on."""
DROPS_FROM = 6
MIN_LIGHTS = 4
"""Lights of a pixel that takes part: one more than there are unknowns."""
MOST_LEVERAGE = 0.9
"""Of one light: where the others hardly fix the normal, they promise nothing."""
COPLANAR = 1e-5
"""Determinant of the mean product of directions below which they lie in one plane, to about 5 degrees."""
STEEP = 4.0
"""Largest slope: 76 degrees."""


class MattFit(NamedTuple):
    """Normals times albedo (3, N), relative residuals (L, N), whether solved (N,), and normal matrices (N, 3, 3)."""

    normal: Array
    left: Array
    solved: Mask
    matrix: Array


def matt_lights(view: View) -> Mask:
    """(L, h, w) lights that show the matt part of a pixel."""
    values = view.values
    median = light_median(values)
    keep: Mask = (values > SHADOWED * median) & ~view.clipped & view.use
    if len(values) >= DROPS_FROM:
        last = len(values) - len(values) // DROPPED
        limit = np.partition(values, last - 1, axis=0)[last - 1]
        keep &= values <= limit
    return keep


def fit_normals(values: Array, keep: Mask, lights: Array) -> MattFit:
    """Least squares of (L, N) values under (L, 3) lights, over the lights to keep; what is left over is 0 elsewhere."""
    weight = keep.astype(np.float64)
    products = (lights[:, :, None] * lights[:, None, :]).reshape(len(lights), 9)
    # Products this large would wake the threads of BLAS, which then spin for longer than the work takes.
    normal_matrix = np.einsum("ln,lk->nk", weight, products).reshape(-1, 3, 3)
    right = np.einsum("ln,lk->nk", weight * values, lights)
    number = weight.sum(axis=0)
    scale = np.maximum(number, 1.0)[:, None, None]
    determinant = np.linalg.det(normal_matrix / scale)
    solved: Mask = (number >= MIN_LIGHTS) & (determinant > COPLANAR)
    normal_matrix[~solved] = np.eye(3)
    normal = np.linalg.solve(normal_matrix, right[..., None])[..., 0].T
    mean = (weight * values).sum(axis=0) / np.maximum(number, 1.0)
    left = weight * solved * (values - np.einsum("lk,kn->ln", lights, normal)) / np.maximum(mean, 1e-9)
    return MattFit(np.asarray(normal, np.float64), left, solved, normal_matrix)


def promised(view: View) -> Array:
    """(L, h, w) light that the other images promise each image; NaN where they do not tell.

    Least squares without one row, by the inverse with it (W. W. Hager, Updating the inverse of a matrix, SIAM Review 31
    (1989), eq. 2).
    """
    lights, count = view.lights, len(view.lights)
    keep = matt_lights(view).reshape(count, -1)
    values = view.values.reshape(count, -1).astype(np.float64)
    fit = fit_normals(values, keep, lights)
    leverage = keep * np.einsum("li,nij,lj->ln", lights, np.linalg.inv(fit.matrix), lights, optimize=True)
    told = np.einsum("lk,kn->ln", lights, fit.normal)
    known = fit.solved & (leverage < MOST_LEVERAGE)
    without = told - leverage / np.maximum(1.0 - leverage, 1.0 - MOST_LEVERAGE) * (values - told)
    promise: Array = np.where(known, without, np.nan).reshape(view.values.shape)
    return promise
