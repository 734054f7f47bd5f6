"""The normal distribution function: importing ``scipy.special`` for it takes as long as measuring a small part."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bgars import _bgars

__all__ = ["normal_distribution"]


def normal_distribution(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """The share of the standard normal distribution below each value.

    Parameters
    ----------
    values : (...) float64

    Returns
    -------
    (...) float64

    Examples
    --------
    >>> normal_distribution(np.array([-1.0, 0.0, 1.0])).round(4).tolist()
    [0.1587, 0.5, 0.8413]
    """
    flat = np.ascontiguousarray(values, dtype=np.float64).reshape(1, -1)
    return _bgars.normal_distribution(flat, threads=None).reshape(np.shape(values))
