"""Balls unlike their fellows: what can be said of sizes when nobody gave a limit."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["odd_sizes"]

MIN_BALLS = 5
"""Balls that have a usual size."""
ODD_SHARE = 0.1
"""Least deviation from the median that is worth a word."""
ODD_SIGMAS = 6.0
"""And in standard deviations of the sizes: once in 5e8 normal ones."""
MAD_TO_SIGMA = 1.4826


def odd_sizes(names: Sequence[str], diameters_um: Sequence[float]) -> list[str]:
    """Say which balls differ from the median diameter by over a tenth and over six robust standard deviations.

    Parameters
    ----------
    names : sequence of str
    diameters_um : sequence of float
        NaN = not measured. With fewer than five balls nothing is odd.

    Examples
    --------
    >>> odd_sizes(["A1", "A2", "A3", "A4", "A5"], [600.0, 602.0, 599.0, 1200.0, 601.0])
    ['A4: its diameter of 1200 um is unlike that of the others (median 601 um)']
    """
    values_um = np.asarray(diameters_um, dtype=np.float64)
    known = np.isfinite(values_um)
    if known.sum() < MIN_BALLS:
        return []
    median_um = float(np.median(values_um[known]))
    off_um = np.abs(values_um - median_um)
    sigma_um = MAD_TO_SIGMA * float(np.median(off_um[known]))
    odd = known & (off_um > max(ODD_SHARE * median_um, ODD_SIGMAS * sigma_um))
    return [
        f"{names[int(index)]}: its diameter of {values_um[index]:.0f} um is unlike that of the others "
        f"(median {median_um:.0f} um)"
        for index in np.flatnonzero(odd)
    ]
