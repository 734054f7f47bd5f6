"""Whether balls are round on the whole and lights err each on its own: what absolute heights rest on.

With all balls flattened by a share and all lights lowered to match, every shadow stays where it is. The bundle decides
by two assumptions: balls round on the whole, errors of the rig independent from light to light. Where the result itself
contradicts one of them, or where silhouettes and shadows see balls of different size, heights may be wrong by far more
than the fit says.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["shape_or_lights", "silhouettes_or_shadows"]

Array = NDArray[np.float64]

MIN_Q_OFF = 0.01
MIN_RAISE_DEG = 0.3
SIGMAS = 3.0
MIN_RADIUS_OFF, MIN_RADIUS_OFF_PX = 0.05, 1.0
"""By how much radii must differ: silhouettes of dark balls on blurred images are a per cent or two off."""
MEDIAN_FACTOR = 1.2533
"""Standard error of a median over that of a mean, for normal errors."""


def shape_or_lights(q: Array, rig: Array, refined: Array) -> tuple[str, ...]:
    """Say where roundness of the balls and elevation of the lights cannot be told apart.

    Parameters
    ----------
    q : (N,) float64
        Vertical over horizontal radius of every measured ball.
    rig, refined : (L, 3) float64
        Directions or positions of the lights, before and after the fit.

    Returns
    -------
    tuple of str
        One text for each assumption that does not hold; empty when both do.

    Examples
    --------
    >>> import bgars
    >>> rig = bgars.LightRig.ring(8, elevation_deg=45.0).directions
    >>> shape_or_lights(np.full(9, 1.001), rig, rig)
    ()
    >>> len(shape_or_lights(np.full(9, 0.965), rig, rig))
    1
    """
    texts = []
    middle = float(np.median(q))
    scatter = 1.4826 * float(np.median(np.abs(q - middle)))
    if abs(middle - 1.0) > max(MIN_Q_OFF, SIGMAS * MEDIAN_FACTOR * scatter / np.sqrt(len(q))):
        texts.append(
            f"the balls' median q is {middle:.3f}: either all are {'flattened' if middle < 1.0 else 'stretched'}, or "
            f"the elevations of all lights are wrong together, and heights by about {100.0 * abs(middle - 1.0):.1f} %"
        )
    raised_deg = np.degrees(_elevation_rad(refined) - _elevation_rad(rig))
    common_deg, own_deg = float(raised_deg.mean()), float(raised_deg.std())
    if abs(common_deg) > max(MIN_RAISE_DEG, SIGMAS * own_deg / np.sqrt(len(rig))):
        percent = 100.0 * np.radians(abs(common_deg)) * 2.0 / abs(np.sin(2.0 * _elevation_rad(rig).mean()))
        texts.append(
            f"all lights were moved together, by {common_deg:+.2f} degrees of elevation, to make the balls round: if "
            f"it is the balls that are not, heights are wrong by about {percent:.1f} %"
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
        f"the balls look {100.0 * abs(off):.0f} % {word} than their shadows say: one of both is wrong, and heights "
        "with it (too little contrast, or highlights taken for outlines)",
    )


def _elevation_rad(vectors: Array) -> Array:
    """(L,) elevations."""
    elevation: Array = np.arctan2(vectors[:, 2], np.hypot(vectors[:, 0], vectors[:, 1]))
    return elevation
