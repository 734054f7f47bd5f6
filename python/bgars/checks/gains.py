"""Lamps that are brighter or dimmer than the rig says."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bgars.checks.evidence import critical_t
from bgars.checks.moments import loo_weights
from bgars.records.findings import Finding

if TYPE_CHECKING:
    from bgars.checks.view import View

__all__ = ["check_gains", "gains_of"]

Array = NDArray[np.float64]

U_TABLE = 0.025
"""Relative standard uncertainty of what a table of lights says of a lamp on level ground: intensity to 2 %, and a
degree of direction, which changes the light at 45 degrees by as much."""
OF_OTHERS = 4.0
"""Times the usual deviation of the other lamps: where all are off, it is the table, or the light's fall-off."""
MOST = 3
"""Lamps that are told, and taken out, one after the other."""
MIN_LIGHTS = 6
"""Of fewer, what is left over does not tell which image is off."""


def gains_of(moments: Array, lights: Array) -> tuple[Array, Array]:
    """(L,) each image over its prediction from the others, and the standard error of that over tiles."""
    weights = loo_weights(lights)
    measured = np.einsum("kl,tlk->tk", weights, moments)
    predicted = np.einsum("kl,tlm,km->tk", weights, moments, weights)
    gain = measured.sum(axis=0) / np.maximum(predicted.sum(axis=0), 1e-12)
    left = measured - gain * predicted
    error = np.sqrt((left**2).sum(axis=0)) / np.maximum(predicted.sum(axis=0), 1e-12)
    return gain, error


def check_gains(view: View, moments: Array, lights: Array) -> tuple[list[Finding], Array]:
    """Find lamps whose strength is not the stated one.

    Parameters
    ----------
    view : View
    moments : (T, L, L) float64
        Of tiles.
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
    tiles = float((np.trace(moments, axis1=1, axis2=2) > 0).sum())
    leverage = np.einsum("li,il->l", lights, np.linalg.pinv(lights))
    table = U_TABLE / np.sqrt(np.maximum(1.0 - leverage, 0.1))
    critical = critical_t(tiles, len(lights))
    found = []
    for _ in range(MOST):
        gain, error = gains_of(moments, lights * factors[:, None])
        off = np.abs(np.log(np.maximum(gain, 1e-3)))
        off[factors != 1.0] = 0.0
        worst = int(np.argmax(off))
        # One lamp that is off puts the predictions of the others off, too: what is usual shows without it.
        without = np.where(np.arange(len(lights)) == worst, gain[worst], 1.0)
        left, _ = gains_of(moments, lights * (factors * without)[:, None])
        usual = float(np.median(np.delete(np.abs(np.log(np.maximum(left, 1e-3))), worst)))
        if off[worst] < OF_OTHERS * usual or off[worst] < critical * float(np.hypot(error[worst], table[worst])):
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
