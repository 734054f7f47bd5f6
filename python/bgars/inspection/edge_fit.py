"""Linear least squares of many short stretches of outline at once, with Cauchy weights the second time.

Stretches of shadow edges are fitted the same way in the core, `rust/bgars-core/src/shadows/stretch.rs`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["Group", "StretchFit", "fit_stretches", "group_sum"]

Array = NDArray[np.float64]
Index = NDArray[np.intp]

ROUNDS = 2
CAUCHY = 2.5
"""Scale of the Cauchy loss of pixels, in standard deviations."""
CAUCHY_FACTOR = 1.10
"""What weights at 2.5 standard deviations make the formula of least squares too small by, for Gaussian noise: the
square
root of (E[psi^2] / E[psi']^2) over (E[w r^2] / E[w]^2) (Huber 1981, section 7.6).
"""
MIN_PIXELS = 12.0
"""Least sum of weights of a stretch of edge that is measured."""
RIDGE = 1e-9


class Group(NamedTuple):
    """Which stretch each line belongs to: index (M,), number of stretches, and stretches that share one noise level."""

    stretch: Index
    stretches: int
    together: int


class StretchFit(NamedTuple):
    """What was fitted.

    Coefficients (G, C) of every stretch, their standard uncertainties, weights of the pixels (O, M), noise of each
    set of
    stretches that share it, and whether a stretch has pixels enough.
    """

    solution: Array
    deviation: Array
    weight: Array
    noise: Array
    measured: NDArray[np.bool_]


def group_sum(values: Array, group: Index, groups: int) -> Array:
    """Sum of values (M,) by group."""
    total: Array = np.bincount(group, weights=values, minlength=groups).astype(np.float64)
    return total


def fit_stretches(
    columns: list[Array], value: Array, usable: Array, group: Group, *, robust: bool = True
) -> StretchFit:
    """Fit ``value = sum_c solution_c column_c`` in every stretch.

    Parameters
    ----------
    columns : list of (O, M) float64
        O pixels on each of M lines across the edge.
    value : (O, M) float64
    usable : (O, M) float64
        1 for pixels to use, else 0.
    group : Group
    robust : bool
        Fit a second time with Cauchy weights. Not where the model is meant to miss single pixels.
    """
    stretch, size, together = group
    count = len(columns)
    pair, pairs = stretch // together, size // together
    weight = usable
    present = np.bincount(stretch, minlength=size) > 0
    freedom_lost = count * present.reshape(pairs, together).sum(axis=1)
    solution, noise = np.zeros((size, count)), np.zeros(pairs)
    inverse = np.zeros((size, count, count))
    rounds = ROUNDS if robust else 1
    for turn in range(rounds):
        normal, right = np.zeros((size, count, count)), np.zeros((size, count))
        for i, first in enumerate(columns):
            weighted = weight * first
            right[:, i] = group_sum((weighted * value).sum(axis=0), stretch, size)
            for j in range(i, count):
                normal[:, i, j] = normal[:, j, i] = group_sum((weighted * columns[j]).sum(axis=0), stretch, size)
        scale = np.sqrt(np.maximum(np.einsum("sii->si", normal), 1e-30))
        scaled = normal / (scale[:, :, None] * scale[:, None, :]) + RIDGE * np.eye(count)
        scaled[~present] = np.eye(count)
        inverse = np.linalg.inv(scaled) / (scale[:, :, None] * scale[:, None, :])
        solution = np.einsum("sij,sj->si", inverse, right)
        residual = value.copy()
        for i, column in enumerate(columns):
            residual -= solution[stretch, i][None, :] * column
        residual *= usable
        square = group_sum((weight * residual**2).sum(axis=0), pair, pairs)
        points = group_sum(weight.sum(axis=0), pair, pairs)
        noise = np.sqrt(square / np.maximum(points - freedom_lost, 1.0))
        if turn + 1 < rounds:
            spread = np.maximum(noise[pair], 1e-9)[None, :]
            weight = usable / (1.0 + (residual / (CAUCHY * spread)) ** 2)
    enough = group_sum(weight.sum(axis=0), stretch, size) >= MIN_PIXELS
    variance = np.maximum(np.einsum("sii->si", inverse), 0.0)
    deviation: Array = np.sqrt(variance) * np.repeat(noise, together)[:, None] * (CAUCHY_FACTOR if robust else 1.0)
    return StretchFit(solution, deviation, weight, noise, enough & present)
