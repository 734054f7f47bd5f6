"""The median over the lights of every pixel."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["light_median"]

Value = TypeVar("Value", np.float32, np.float64)


def light_median(values: NDArray[Value]) -> NDArray[Value]:
    """The same as ``numpy.median(values, axis=0)``, which takes three to five times as long where lights are few.

    Parameters
    ----------
    values : (L, ...) floating

    Returns
    -------
    (...) floating
        NaN where a value is.

    Examples
    --------
    >>> light_median(np.array([[1.0, 5.0], [4.0, np.nan], [2.0, 6.0]])).tolist()
    [2.0, nan]
    """
    ordered = np.sort(values, axis=0)
    middle = ordered[(len(values) - 1) // 2 : len(values) // 2 + 1].mean(axis=0)
    # NaN is sorted last.
    median: NDArray[Value] = np.where(np.isnan(ordered[-1]), ordered[-1], middle)
    return median
