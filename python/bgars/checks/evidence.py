"""When a difference is one: the test that every check shares.

An image disagrees with any simple model somewhere, and not by noise alone: highlights, light from neighbours, relief.
So the error of a figure is taken from the figure itself: its scatter over tiles of the image, which are independent
witnesses, and where it can be, its scatter over the other images of the same capture.
"""

from __future__ import annotations

from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

__all__ = ["FALSE_ALARMS", "critical_t", "paired_t"]

Array = NDArray[np.float64]

FALSE_ALARMS = 1e-3
"""Wanted share of captures without a fault in which one check sees one."""


def critical_t(witnesses: float, tests: int = 1) -> float:
    """Value that Student's t of so many witnesses exceeds in `FALSE_ALARMS` of the cases, whichever of `tests` it is.

    The quantile of the normal distribution, and the first two terms of its expansion in 1 / freedom.

    References
    ----------
    M. Abramowitz, I. Stegun, Handbook of Mathematical Functions, 26.7.5.

    Examples
    --------
    >>> round(critical_t(1e9), 2), round(critical_t(30), 2)
    (3.09, 3.39)
    """
    freedom = max(witnesses - 1.0, 3.0)
    z = NormalDist().inv_cdf(1.0 - FALSE_ALARMS / max(tests, 1))
    first = (z**3 + z) / (4.0 * freedom)
    second = (5.0 * z**5 + 16.0 * z**3 + 3.0 * z) / (96.0 * freedom**2)
    return float(z + first + second)


def paired_t(difference: Array, weight: Array) -> tuple[float, float]:
    """Student's t of a weighted mean of paired differences over tiles, and the effective number of tiles.

    Examples
    --------
    >>> t, tiles = paired_t(np.array([1.0, 1.1, 0.9, 1.0]), np.ones(4))
    >>> round(t, 1), tiles
    (24.5, 4.0)
    """
    total = float(weight.sum())
    if total <= 0.0:
        return 0.0, 0.0
    share = weight / total
    count = 1.0 / float((share**2).sum())
    mean = float((share * difference).sum())
    if count <= 2.0:  # noqa: PLR2004 - one or two tiles have no scatter
        return 0.0, count
    variance = float((share**2 * (difference - mean) ** 2).sum()) * count / (count - 1.0)
    return (mean / variance**0.5 if variance > 0.0 else float(np.sign(mean)) * 1e9), count
