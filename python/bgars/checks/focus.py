"""Images blurred against the others: the share of fine detail in each, whatever the detail is.

Of every image two bands of detail are taken, one of about a pixel and one of about two. Blur takes more of the finer
one; contrast, albedo and the strength of a lamp act on both alike. Edges of parts and shadows are as sharp under every
lamp, so that the images are compared with each other. The same bands of the other images, blurred step by step, turn
what is missing into the variance of a blur. Noise is in both bands, of a blurred image too, as the camera adds it last:
what of it is certain (``noise_levels``) is subtracted first.
"""

from __future__ import annotations

from math import comb
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bgars.checks.evidence import critical_t
from bgars.checks.noise_levels import MIN_SAMPLES, noise_curve
from bgars.checks.patches import cut_patches
from bgars.records.findings import Finding

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from bgars.checks.noise_levels import NoiseCurve
    from bgars.checks.patches import Patch
    from bgars.records.capture import Capture

__all__ = ["check_focus"]

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

BLURRED_PX2 = 0.5
"""Variance of added blur that is told: three quarters of that of a sharp lens and its pixels. In a good capture,
an image under a lamp unlike the others (the lowest of a dome) may look blurred by nearly as much."""
OF_OTHERS = 5.0
"""Times the usual difference between the other images."""
EQUAL = 0.003
"""Logarithm of the share of fine detail to which images are equal, at best."""
NOISE_KNOWN = 0.05
"""Of the noise of one image, what is not known: a quantile of 60,000 pixels says it to 2 %, if it is normal."""
MIN_IMAGES = 4
PASS_PX2 = 0.5
"""Variance of one binomial filter of three pixels."""
STEPS = (0, 1, 2, 4, 6)
"""Passes after which the bands are taken."""
BAND, NEXT_BAND, PASSES = (1, 3), (2, 6), 12
"""Passes between which lie the finer and the coarser band; passes in all."""
TILE_PX = 48
LEAST = 1e-12
"""Energy of a band without detail, of full scale squared."""
COVERED = 0.3
"""Share of a tile that must be inside the mask and unclipped."""
MIN_TILES = 4


def check_focus(capture: Capture, kept: NDArray[np.intp], names: Sequence[str]) -> list[Finding]:
    """Find an image that is less sharp than the others.

    Parameters
    ----------
    capture : Capture
    kept : (K,) intp
        Images with light of their own.
    names : sequence of str
        Of these.
    """
    if len(kept) < MIN_IMAGES:
        return []
    curve = noise_curve(capture)
    if curve is None or curve.samples.max() < MIN_SAMPLES:
        return []
    both = [each for patch in cut_patches(capture) for each in _energies(patch.levels[kept], _bad(patch), curve)]
    if len(both) < MIN_TILES:
        return []
    tiles, noise = (np.array(each) for each in zip(*both, strict=True))
    total = tiles.sum(axis=0)
    detail = _detail(total)
    apart = _apart(detail[0])
    left_out = np.array([_apart(_detail(total - each)[0]) for each in tiles])
    unknown = NOISE_KNOWN * noise.sum(axis=0)[0, 0] / np.maximum(total[0, 0], LEAST)
    error = np.sqrt((len(tiles) - 1) * left_out.var(axis=0) + np.square(unknown))
    index = int(np.argmin(apart))
    others = np.delete(apart, index)
    usual = max(float(1.4826 * np.median(np.abs(others - np.median(others)))), EQUAL)
    sharp = np.median(np.delete(detail, index, axis=1), axis=1)
    if not (np.diff(sharp) < 0.0).all():
        return []
    blur_px2 = float(np.interp(-detail[0, index], -sharp, PASS_PX2 * np.array(STEPS)))
    certain = -apart[index] > critical_t(len(tiles), len(kept)) * error[index] and -apart[index] > OF_OTHERS * usual
    if blur_px2 < BLURRED_PX2 or not certain:
        return []
    more = "at least " if blur_px2 >= PASS_PX2 * STEPS[-1] else "about "
    return [
        Finding(
            "focus",
            "warning",
            f"{names[index]} is blurred compared with the others ({more}{blur_px2**0.5:.1f} px more)",
            "look for vibration, a moved focus ring, or autofocus between the images, and take it again",
            image=index,
            value=blur_px2**0.5,
            limit=BLURRED_PX2**0.5,
            unit="px",
        )
    ]


def _detail(energy: Array) -> Array:
    """(S, L) logarithm of finer over coarser detail, at each step of blur."""
    ratio: Array = np.log(np.maximum(energy[:, 0], LEAST) / np.maximum(energy[:, 1], LEAST))
    return ratio


def _apart(detail: Array) -> Array:
    """(L,) each image against the median of all."""
    apart: Array = detail - np.median(detail)
    return apart


def _bad(patch: Patch) -> Mask:
    """(h, w) pixels near something clipped, or outside."""
    bad: Mask = patch.clipped.any(axis=0) | ~patch.inside
    for _ in range(PASSES // 2):
        wider = bad.copy()
        wider[1:] |= bad[:-1]
        wider[:-1] |= bad[1:]
        wider[:, 1:] |= bad[:, :-1]
        wider[:, :-1] |= bad[:, 1:]
        bad = wider
    return bad


def _energies(levels: Floats, bad: Mask, curve: NoiseCurve) -> Iterator[tuple[Array, Array]]:
    """(S, 2, L) sums of squares of both bands, at each step of blur, of every tile without noise; the same of noise."""
    if min(bad.shape) <= 2 * PASSES:
        return
    smooth: list[Floats] = [levels]
    for _ in range(PASSES):
        smooth.append(_binomial(smooth[-1]))
    rows, cols = (each - 2 * PASSES for each in bad.shape)
    inner = [
        each[..., PASSES - done : PASSES - done + rows, PASSES - done : PASSES - done + cols]
        for done, each in enumerate(smooth)
    ]
    use = ~bad[PASSES:-PASSES, PASSES:-PASSES]
    bands = [[(step + low, step + high) for low, high in (BAND, NEXT_BAND)] for step in STEPS]
    squares = np.array([[np.square(inner[low] - inner[high]) * use for low, high in each] for each in bands])
    passed = np.array([[_noise_passed(low, high) for low, high in each] for each in bands])[..., None]
    enough = curve.samples >= MIN_SAMPLES
    noise = use * np.interp(inner[NEXT_BAND[0]], curve.level[enough], np.maximum(curve.noise[enough], 0.0))
    for row in range(0, rows, TILE_PX):
        for col in range(0, cols, TILE_PX):
            at = np.s_[..., row : row + TILE_PX, col : col + TILE_PX]
            if use[at].mean() >= COVERED:
                of_noise = passed * noise[at].sum(axis=(-2, -1))
                yield squares[at].sum(axis=(-2, -1), dtype=np.float64) - of_noise, of_noise


def _noise_passed(low: int, high: int) -> float:
    """Variance of white noise, of variance 1, between `low` and `high` passes of (1, 2, 1) / 4 along both axes.

    Filters of n and m passes are binomial, their product summed over all pixels is C(2 k, k) / 4^k, k = n + m.
    """
    both, first, second = ((comb(2 * k, k) / 4.0**k) ** 2 for k in (low + high, 2 * low, 2 * high))
    return first + second - 2.0 * both


def _binomial(stack: Floats) -> Floats:
    """Filter (1, 2, 1) / 4 along both axes, where it fits."""
    quarter, half = np.float32(0.25), np.float32(0.5)
    rows = quarter * (stack[..., :-2, :] + stack[..., 2:, :]) + half * stack[..., 1:-1, :]
    return np.asarray(quarter * (rows[..., :-2] + rows[..., 2:]) + half * rows[..., 1:-1], np.float32)
