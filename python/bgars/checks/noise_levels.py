"""Noise against grey level: what tells a camera curve of any part, whatever it is made of.

Light is counted in photons: the variance of a linear camera is a + b level with b >= 0, so it is smallest in the dark.
A curve ``s^(1/g)`` stretches the dark: there the variance is multiplied by ``s^(2/g - 2)``. Noise that *falls* from the
shadows to the lit surface is none of a linear camera.

Noise is what differs between neighbouring pixels of one image over the mean of all: texture goes with the mean, and so
it does under any power law.

References
----------
J. Immerkaer, Fast noise variance estimation, CVIU 64 (1996) 300-302: the filter.
"""

from __future__ import annotations

from statistics import NormalDist
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bgars.checks.patches import cut_patches

if TYPE_CHECKING:
    from bgars.records.capture import Capture

__all__ = ["NoiseCurve", "noise_curve", "noise_falls"]

Floats = NDArray[np.float32]

OCTAVES = 6
"""Bins of grey level, each half as bright as the next."""
BRIGHTEST_PERCENT = 98.0
FAINT = 0.01
"""Mean of a pixel, of full scale, below which its ratio to the mean is noise itself."""
QUANTILE = 0.4
"""Of the absolute differences: edges and highlights are in the upper ones."""
MIN_SAMPLES = 500
"""Of a bin: its variance is then known to 10 percent."""
FALLS = 1.2
"""Ratio of variances from which on noise falls: two standard errors of the smallest bin; the least of all is taken."""
QUANTISED = 2.4 / 12.0
"""Variance in grey levels of the file, squared, below which rounding hides the noise."""


class NoiseCurve(NamedTuple):
    """Level and variance of each bin, of full scale (squared), from dark to bright, and how many samples."""

    level: NDArray[np.float64]
    variance: NDArray[np.float64]
    samples: NDArray[np.int64]


def noise_curve(capture: Capture) -> NoiseCurve | None:
    """Measure noise in bins of grey level; None where nothing is bright enough."""
    steps, levels = [], []
    for patch in cut_patches(capture):
        mean = patch.levels.mean(axis=0)
        if min(mean.shape) < 3:  # noqa: PLR2004 - the filter is 3 x 3
            continue
        ratio = patch.levels / np.maximum(mean, np.float32(1e-6))
        local = _summed(patch.levels, 1.0) / np.float32(9.0)
        usable = patch.inside[1:-1, 1:-1] & (mean[1:-1, 1:-1] > FAINT) & ~_touched(patch.clipped)
        step = _summed(ratio, -2.0) / np.float32(6.0) * mean[1:-1, 1:-1]
        steps.append(np.abs(step[usable]))
        levels.append(local[usable])
    if not steps or sum(each.size for each in steps) < MIN_SAMPLES:
        return None
    return _binned(np.concatenate(steps), np.concatenate(levels))


def noise_falls(curve: NoiseCurve, level_step: float) -> float:
    """Return how much noisier the dark is than the lit surface: ratio of variances, 0 where that cannot be said.

    Parameters
    ----------
    curve : NoiseCurve
    level_step : float
        One grey level, of full scale.

    Returns
    -------
    float
        The smallest ratio of all bins at most half as bright as the fullest one, or else of the next darker one.
    """
    lit = int(np.argmax(curve.samples))
    darker = [index for index in range(lit) if curve.samples[index] >= MIN_SAMPLES]
    darker = [index for index in darker if index < lit - 1] or darker
    if not darker or not curve.variance[lit] > 0.0:
        return 0.0
    least = float(curve.variance[darker].min())
    if least < QUANTISED * level_step**2:
        return 0.0
    return least / float(curve.variance[lit])


def _binned(steps: Floats, levels: Floats) -> NoiseCurve:
    top = float(np.percentile(levels, BRIGHTEST_PERCENT))
    edges = max(top, 1e-6) * 2.0 ** -np.arange(OCTAVES - 1, 0, -1.0)
    number = np.searchsorted(edges, levels)
    sigma_of_quantile = NormalDist().inv_cdf(0.5 + QUANTILE / 2.0)
    level, variance, count = np.zeros(OCTAVES), np.zeros(OCTAVES), np.zeros(OCTAVES, dtype=np.int64)
    for index in range(OCTAVES):
        chosen = number == index
        count[index] = int(chosen.sum())
        if count[index]:
            level[index] = float(levels[chosen].mean())
            variance[index] = (float(np.quantile(steps[chosen], QUANTILE)) / sigma_of_quantile) ** 2
    return NoiseCurve(level, variance, count)


def _summed(stack: Floats, middle: float) -> Floats:
    """(L, h - 2, w - 2) sums over 3 x 3 pixels with weights 1, middle, 1 along each axis."""
    weight = np.float32(middle)
    rows = stack[..., :-2, :] + weight * stack[..., 1:-1, :] + stack[..., 2:, :]
    sums: Floats = rows[..., :-2] + weight * rows[..., 1:-1] + rows[..., 2:]
    return sums


def _touched(clipped: NDArray[np.bool_]) -> NDArray[np.bool_]:
    rows = clipped[..., :-2, :] | clipped[..., 1:-1, :] | clipped[..., 2:, :]
    touched: NDArray[np.bool_] = rows[..., :-2] | rows[..., 1:-1] | rows[..., 2:]
    return touched
