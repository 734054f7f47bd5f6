"""Second moments of what the lights show, by tile and by rows: what most checks of single images are made from.

Under a table S, least squares predicts each image from the others, ``pred_k = w_k . M`` with weights from S alone. So
gain, mixture with a neighbour and their scatter over the image all follow from sums of products of images.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bgars.records.light_median import light_median

if TYPE_CHECKING:
    from bgars.checks.view import View

__all__ = ["lit_everywhere", "loo_weights", "moments_by"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

SHADOWED, SHINES = 0.25, 2.2
"""Of the pixel's median: what is darker or brighter under a light is no matt, lit pixel."""
SPREAD = 4.0
"""Most-trusted pixels are those whose misfit is at most so many times the median one."""


def lit_everywhere(view: View, lights: Array, *, matt: bool = True) -> Mask:
    """(h, w) pixels that every light reaches, without highlights; `matt`: that fit the table as most of them do."""
    middle = light_median(view.values)
    ratio = view.values / np.maximum(middle, np.float32(1e-6))
    lit: Mask = view.use & (ratio.min(axis=0) > SHADOWED) & (ratio.max(axis=0) < SHINES) & ~view.clipped.any(axis=0)
    if matt and lit.any() and len(lights) > 4:  # noqa: PLR2004 - with one degree of freedom nothing tells which image is off
        left = np.eye(len(lights)) - lights @ np.linalg.pinv(lights)
        misfit = np.square(np.einsum("kl,lhw->khw", left, ratio.astype(np.float64))).sum(axis=0)
        lit &= misfit <= SPREAD * float(np.median(misfit[lit])) + 1e-9
    return lit


def loo_weights(lights: Array) -> Array:
    """(L, L) weights that predict each image from the others: row k has 0 at k."""
    weights = np.zeros((len(lights), len(lights)))
    for index in range(len(lights)):
        others = np.arange(len(lights)) != index
        weights[index, others] = lights[index] @ np.linalg.pinv(lights[others])
    return weights


def moments_by(view: View, lit: Mask, groups: NDArray[np.intp], count: int) -> Array:
    """(G, L, L) sums of products of values, relative to the pixel's median, by group of pixels."""
    values = view.values[:, lit].astype(np.float64)
    values /= np.maximum(light_median(values), 1e-9)
    number = groups[lit]
    order = np.argsort(number, kind="stable")
    edges = np.searchsorted(number[order], np.arange(count + 1))
    values = values[:, order]
    sums = np.zeros((count, len(values), len(values)))
    for group in range(count):
        part = values[:, edges[group] : edges[group + 1]]
        sums[group] = part @ part.T
    return sums
