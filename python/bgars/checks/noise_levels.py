"""Noise against grey level: what tells a camera curve of any part, whatever it is made of.

Light is counted in photons: the variance of a linear camera is a + b level with b >= 0, so it is smallest in the dark.
A curve ``s^(1/g)`` stretches the dark: there the variance is multiplied by ``s^(2/g - 2)``. Noise that *falls* from the
shadows to the lit surface is none of a linear camera.

Noise is what differs between neighbouring pixels of one image over the mean of all: texture goes with the mean, and so
it does under any power law. Relief and edges of shadows do not. Over pixels twice as far apart, noise differs as much
as before, a straight edge has twice the variance (it touches twice as many pixels), and a curved surface more: so what
the wider filter finds beyond the narrow one is at least what is no noise in the narrow one.

References
----------
J. Immerkaer, Fast noise variance estimation, CVIU 64 (1996) 300-302: the filter.
"""

from __future__ import annotations

from statistics import NormalDist
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bgars.checks.evidence import FALSE_ALARMS
from bgars.checks.patches import cut_patches

if TYPE_CHECKING:
    from bgars.records.capture import Capture

__all__ = ["FALLS", "NoiseCurve", "noise_curve", "noise_falls", "noise_share", "own_noise"]

Floats = NDArray[np.float32]

OCTAVES = 6
"""Bins of grey level, each half as bright as the next."""
BRIGHTEST_PERCENT = 98.0
FAINT = 0.01
"""Mean of a pixel, of full scale, below which its ratio to the mean is noise itself."""
QUANTILE = 0.4
"""Of the absolute differences: edges and highlights are in the upper ones."""
MIN_SAMPLES = 500
"""Of a bin: the variance is then known to a quarter."""
U_VARIANCE = 5.2
"""Relative standard error of a variance, times the root of the samples: 2.7 for that quantile of independent normal
values, and 1.9 as the filters overlap (the sum of their squared correlations is 3.8)."""
FALLS = 1.2
"""Ratio of variances, of every bin, from which on noise falls at all: rounding and blur change it by as much."""
QUANTISED = 2.4 / 12.0
"""Variance in grey levels of the file, squared, below which rounding hides the noise."""


class NoiseCurve(NamedTuple):
    """Level and variance of each bin, of full scale (squared), from dark to bright, and how many samples."""

    level: NDArray[np.float64]
    variance: NDArray[np.float64]
    samples: NDArray[np.int64]
    noise: NDArray[np.float64]
    """Variance that is noise for certain: without what relief and edges may add; negative where these rule."""
    error: NDArray[np.float64]
    """Standard error of `noise`."""

    @property
    def lit(self) -> int:
        """The fullest bin."""
        return int(np.argmax(self.samples))


def noise_curve(capture: Capture) -> NoiseCurve | None:
    """Measure noise in bins of grey level; None where nothing is bright enough."""
    near, far, levels = [], [], []
    for patch in cut_patches(capture):
        mean = patch.levels.mean(axis=0)
        if min(mean.shape) < 5:  # noqa: PLR2004 - the wider filter is 5 x 5
            continue
        ratio = patch.levels / np.maximum(mean, np.float32(1e-6))
        mean = mean[2:-2, 2:-2]
        local = _summed(patch.levels, 1.0)[..., 1:-1, 1:-1] / np.float32(9.0)
        usable = patch.inside[2:-2, 2:-2] & (mean > FAINT) & ~_touched(_touched(patch.clipped))
        scale = mean / np.float32(6.0)
        near.append(np.abs(_summed(ratio, -2.0)[..., 1:-1, 1:-1] * scale)[usable])
        far.append(np.abs(_summed(ratio, -2.0, 2) * scale)[usable])
        levels.append(local[usable])
    if not near or sum(each.size for each in near) < MIN_SAMPLES:
        return None
    return _binned(np.concatenate(near), np.concatenate(far), np.concatenate(levels))


def own_noise(capture: Capture, kept: NDArray[np.intp]) -> NDArray[np.float64]:
    """(K,) noise and finest detail of single images, of full scale, as if all were as bright as the usual one.

    Whatever moved or was turned, an image has as much of it as the others. Detail goes with brightness, and noise less.
    """
    near: list[Floats] = []
    levels: list[Floats] = []
    for patch in cut_patches(capture):
        if min(patch.inside.shape) < 3:  # noqa: PLR2004 - the filter is 3 x 3
            continue
        usable = patch.inside[1:-1, 1:-1] & ~_touched(patch.clipped[kept]).any(axis=0)
        near.append(np.abs(_summed(patch.levels[kept] / np.float32(6.0), -2.0))[:, usable])
        levels.append(patch.levels[kept][:, 1:-1, 1:-1][:, usable])
    if not near or sum(each.shape[1] for each in near) < MIN_SAMPLES:
        return np.zeros(len(kept))
    size = np.sqrt([_variance(each) for each in np.concatenate(near, axis=1)])
    level = np.median(np.concatenate(levels, axis=1), axis=1)
    brighter = level / max(float(np.median(level)), 1e-9)
    found: NDArray[np.float64] = size / np.maximum(brighter, 1.0)
    return found


def noise_share(curve: NoiseCurve) -> float:
    """Noise over signal of the fullest bin, 0 where relief and edges hide it."""
    lit = curve.lit
    return float(max(curve.noise[lit], 0.0) ** 0.5 / max(curve.level[lit], 1e-9))


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
        Of the bin that says it most clearly, of those at most half as bright as the fullest one, or else of the next
        darker one. All of them must show it, and one beyond chance and relief: a linear camera may have equal noise
        everywhere.
    """
    lit = curve.lit
    darker = [index for index in range(lit) if curve.samples[index] >= MIN_SAMPLES]
    darker = [index for index in darker if index < lit - 1] or darker
    usual = float(curve.variance[lit])
    if not darker or not usual > 0.0:
        return 0.0
    if float(curve.variance[darker].min()) < max(QUANTISED * level_step**2, FALLS * usual):
        return 0.0
    error = np.hypot(curve.error[darker], usual * U_VARIANCE / float(curve.samples[lit]) ** 0.5)
    certain = (curve.noise[darker] - usual) / error
    best = int(np.argmax(certain))
    critical = NormalDist().inv_cdf(1.0 - FALSE_ALARMS / len(darker))
    return float(curve.noise[darker[best]]) / usual if certain[best] > critical else 0.0


def _binned(near: Floats, far: Floats, levels: Floats) -> NoiseCurve:
    top = float(np.percentile(levels, BRIGHTEST_PERCENT))
    edges = max(top, 1e-6) * 2.0 ** -np.arange(OCTAVES - 1, 0, -1.0)
    number = np.searchsorted(edges, levels)
    level, variance, wide = np.zeros(OCTAVES), np.zeros(OCTAVES), np.zeros(OCTAVES)
    count = np.bincount(number, minlength=OCTAVES).astype(np.int64)
    for index in np.flatnonzero(count):
        chosen = number == index
        level[index] = float(levels[chosen].mean())
        variance[index], wide[index] = _variance(near[chosen]), _variance(far[chosen])
    error = U_VARIANCE / np.sqrt(np.maximum(count, 1)) * np.hypot(2.0 * variance, wide)
    return NoiseCurve(level, variance, count, variance - np.maximum(wide - variance, 0.0), error)


def _variance(steps: Floats) -> float:
    return (float(np.quantile(steps, QUANTILE)) / NormalDist().inv_cdf(0.5 + QUANTILE / 2.0)) ** 2


def _summed(stack: Floats, middle: float, step: int = 1) -> Floats:
    """(L, h - 2 step, w - 2 step) sums over 3 x 3 pixels, `step` apart, with weights 1, middle, 1 along each axis."""
    weight, twice = np.float32(middle), 2 * step
    rows = stack[..., :-twice, :] + weight * stack[..., step:-step, :] + stack[..., twice:, :]
    sums: Floats = rows[..., :-twice] + weight * rows[..., step:-step] + rows[..., twice:]
    return sums


def _touched(clipped: NDArray[np.bool_]) -> NDArray[np.bool_]:
    rows = clipped[..., :-2, :] | clipped[..., 1:-1, :] | clipped[..., 2:, :]
    touched: NDArray[np.bool_] = rows[..., :-2] | rows[..., 1:-1] | rows[..., 2:]
    return touched
