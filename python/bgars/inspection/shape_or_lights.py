"""What the fit says of the set-up as a whole: lamps, balls, camera or response that are not as they should be."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bgars.inspection.common_terms import EDGE, ELEVATION, PERSPECTIVE, ROUNDNESS

if TYPE_CHECKING:
    from bgars.inspection.settle import Settled

__all__ = ["silhouettes_or_shadows", "what_is_odd"]

Array = NDArray[np.float64]

PROBABLE = 0.5
"""Probability from which on a cause is named."""
MIN_RADIUS_OFF, MIN_RADIUS_OFF_PX = 0.05, 1.0
"""By how much radii must differ: silhouettes of dark balls on blurred images are a per cent or two off."""


def what_is_odd(settled: Settled, pitch_um: float) -> tuple[str, ...]:
    """Say which common term of the set-up is probably not as it should be; its uncertainty holds it already.

    Parameters
    ----------
    settled : Settled
    pitch_um : float
        Of a pixel.
    """
    common, odd = settled.solution.common, settled.odd
    texts = []
    raised, round_ = odd.get(ELEVATION, 0.0), odd.get(ROUNDNESS, 0.0)
    if max(raised, round_) > PROBABLE:
        percent = 100.0 * abs(float(common[ROUNDNESS])) + 100.0 * abs(float(np.tan(common[ELEVATION])))
        texts.append(
            f"either all balls are {'flatter' if common[ROUNDNESS] < 0 else 'taller'} than spheres, or all lamps stand "
            f"{'higher' if common[ELEVATION] > 0 else 'lower'} than the rig states (probability {100 * round_:.0f} and "
            f"{100 * raised:.0f} %): heights are uncertain by about {percent:.1f} %. A calibrated rig ([lights] u_deg) "
            "or the balls' shape (aspect_ratio, u_aspect_ratio of the recipe) would decide"
        )
    if odd.get(PERSPECTIVE, 0.0) > PROBABLE:
        distance_mm = 1e-3 * pitch_um / max(float(common[PERSPECTIVE]), 1e-12)
        texts.append(
            f"the camera sees balls at the rim from the side, as from {distance_mm:.0f} mm: positions are corrected; "
            "state camera in capture.toml"
        )
    if odd.get(EDGE, 0.0) > PROBABLE:
        texts.append(
            f"all edges of shadows lie {abs(float(common[EDGE])):.2f} pixels "
            f"{'outside' if common[EDGE] > 0 else 'inside'} of their place by the outlines: check that the "
            "response is linear and the board not overexposed"
        )
    return tuple(texts)


def silhouettes_or_shadows(silhouette_px: Array, shadow_px: Array) -> tuple[str, ...]:
    """Say where balls look larger or smaller than their shadows on the whole.

    Parameters
    ----------
    silhouette_px, shadow_px : (N,) float64
        Radii of the same balls.

    Returns
    -------
    tuple of str
        One text, or none.

    Examples
    --------
    >>> silhouettes_or_shadows(np.full(9, 29.8), np.full(9, 30.0))
    ()
    >>> silhouettes_or_shadows(np.full(9, 25.0), np.full(9, 30.0))[0][:45]
    'the balls look 17 % smaller than their shadow'
    """
    off = float(np.median(silhouette_px / shadow_px)) - 1.0
    if abs(off) <= max(MIN_RADIUS_OFF, MIN_RADIUS_OFF_PX / float(np.median(shadow_px))):
        return ()
    word = "smaller" if off < 0.0 else "larger"
    return (
        f"the balls look {100.0 * abs(off):.0f} % {word} than their shadows indicate: one of the two is wrong, and "
        "so are the heights (too little contrast, or highlights taken for outlines)",
    )
