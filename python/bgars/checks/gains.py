"""Lamps that are brighter or dimmer than the rig says."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

from bgars.checks.evidence import critical_t
from bgars.checks.matt_fit import promised
from bgars.checks.moments import loo_weights
from bgars.checks.view import TILES
from bgars.records.findings import Finding

if TYPE_CHECKING:
    from bgars.checks.view import View

__all__ = ["check_gains", "gains_by_moments", "gains_by_promise", "gains_of"]

Array = NDArray[np.float64]
Measure: TypeAlias = Callable[[Array], tuple[Array, Array, float]]

U_TABLE = 0.025
"""Relative standard uncertainty of what a table of lights says of a lamp on level ground: intensity to 2 %, and a
degree of direction, which changes the light at 45 degrees by as much."""
OF_OTHERS = 4.0
"""Times the usual deviation of the other lamps: where all are off, it is the table, or the light's fall-off."""
ALIKE = 5.0
"""Times the scatter over tiles: a lamp is off all over the image alike. Chosen on a few captures: lamps that were off
had 11 and more, highlights of balls and coins 1.4 to 7.8, few above 5."""
MOST = 3
"""Lamps that are told, and taken out, one after the other."""
MIN_LIGHTS = 6
"""Of fewer, what is left over does not tell which image is off."""
SHADOW = 0.2
"""Of the promised light: less is shadow, five times more a highlight."""
MIN_PIXELS, MIN_TILES = 8, 8
"""Of a tile, and of an image, that tell of its lamp: a median of a handful is chance."""


def gains_of(moments: Array, lights: Array) -> tuple[Array, Array]:
    """(L,) each image over its prediction from the others, and the standard error of that over tiles."""
    weights = loo_weights(lights)
    measured = np.einsum("kl,tlk->tk", weights, moments)
    predicted = np.einsum("kl,tlm,km->tk", weights, moments, weights)
    gain = measured.sum(axis=0) / np.maximum(predicted.sum(axis=0), 1e-12)
    left = measured - gain * predicted
    error = np.sqrt((left**2).sum(axis=0)) / np.maximum(predicted.sum(axis=0), 1e-12)
    return gain, error


def gains_by_moments(moments: Array) -> Measure:
    """Gains from what all lights reach."""
    tiles = float((np.trace(moments, axis1=1, axis2=2) > 0).sum())
    return lambda lights: (*gains_of(moments, lights), tiles)


def gains_by_promise(view: View) -> Measure:
    """Gains from what most lights reach, such as the sides of a ball and the board in its shadows.

    The others promise each pixel its light (`matt_fit.promised`); a tile counts by the median of what it gets of it,
    and an image by the median of its tiles, whose error is 1.25 times that of a mean.
    """

    def measure(lights: Array) -> tuple[Array, Array, float]:
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = view.values / promised(view.with_lights(lights))
        told = (ratio > SHADOW) & (ratio < 1.0 / SHADOW) & view.use & ~view.clipped
        gain, error, fewest = np.ones(len(lights)), np.full(len(lights), np.inf), TILES * TILES
        for index, known in enumerate(told):
            number, size = view.tiles[known], np.log(ratio[index][known])
            full = np.flatnonzero(np.bincount(number, minlength=TILES * TILES) >= MIN_PIXELS)
            fewest = min(fewest, len(full))
            if len(full) >= MIN_TILES:
                medians = np.array([np.median(size[number == tile]) for tile in full])
                gain[index] = np.exp(np.median(medians))
                scatter = 1.4826 * float(np.median(np.abs(medians - np.median(medians))))
                error[index] = 1.25 * gain[index] * scatter / len(full) ** 0.5
        return gain, error, float(fewest)

    return measure


def check_gains(view: View, measure: Measure, lights: Array) -> tuple[list[Finding], Array]:
    """Find lamps whose strength is not the stated one.

    Parameters
    ----------
    view : View
    measure : callable
        Takes a table of lights; returns gains, their errors, and the number of tiles.
    lights : (L, 3) float64

    Returns
    -------
    findings : list of Finding
    gains : (L,) float64
        Factors on the stated strengths, 1 where nothing was found.
    """
    factors = np.ones(len(lights))
    if len(lights) < MIN_LIGHTS:
        return [], factors
    leverage = np.einsum("li,il->l", lights, np.linalg.pinv(lights))
    table = U_TABLE / np.sqrt(np.maximum(1.0 - leverage, 0.1))
    found = []
    for _ in range(MOST):
        gain, error, tiles = measure(lights * factors[:, None])
        critical = critical_t(tiles, len(lights))
        off = np.abs(np.log(np.maximum(gain, 1e-3)))
        off[factors != 1.0] = 0.0
        worst = int(np.argmax(off))
        # One lamp that is off puts the predictions of the others off, too: what is usual shows without it.
        without = np.where(np.arange(len(lights)) == worst, gain[worst], 1.0)
        left, _, _ = measure(lights * (factors * without)[:, None])
        usual = float(np.median(np.delete(np.abs(np.log(np.maximum(left, 1e-3))), worst)))
        scatter = float(error[worst]) * tiles**0.5
        limit = max(OF_OTHERS * usual, critical * float(np.hypot(error[worst], table[worst])), ALIKE * scatter)
        if off[worst] < limit:
            break
        factors[worst] *= gain[worst]
    if (factors != 1.0).sum() >= MOST:
        # Where many lamps are off it is the light that does not fall off as stated, not the lamps.
        return [], np.ones(len(lights))
    for index in np.flatnonzero(factors != 1.0):
        found.append(
            Finding(
                "lamp-uneven",
                "warning",
                f"the lamp of {view.names[index]} gives {factors[index]:.2f} times the light that the rig states",
                f"give it intensity {factors[index]:.2f} (times the stated one) in capture.toml, or adjust the lamp",
                image=int(index),
                value=float(factors[index]),
                limit=float(np.exp(critical * table[index])),
                unit="times",
            )
        )
    return found, factors
