"""Capability of a process against its limits, each index with its confidence interval."""

from __future__ import annotations

import math
from dataclasses import dataclass

from scipy import special

__all__ = ["CONFIDENCE", "Capability", "Index", "capability"]

CONFIDENCE = 0.95


@dataclass(frozen=True)
class Index:
    """A capability index; NaN = not defined.

    Attributes
    ----------
    value, low, high : float
        Estimate and its two-sided 95 % confidence interval.
    """

    value: float
    low: float
    high: float


UNKNOWN = Index(math.nan, math.nan, math.nan)


@dataclass(frozen=True)
class Capability:
    """Indices of one standard deviation.

    Attributes
    ----------
    spread : Index
        Cp or Pp: width of the limits over 6 sigma; NaN with one limit.
    centred : Index
        Cpk or Ppk: distance of the nearer limit from the mean over 3 sigma.
    """

    spread: Index
    centred: Index


def capability(
    mean: float, sigma: float, limits: tuple[float | None, float | None], *, count: float, df: float
) -> Capability:
    """Return the indices of a normal process.

    Cp = (U - L) / (6 sigma), with the interval Cp sqrt(chi2(df) / df) of the chi-squared distribution;
    Cpk = min(U - mean, mean - L) / (3 sigma), with Bissell's interval
    Cpk +- z sqrt(1 / (9 count) + Cpk^2 / (2 df)).

    Parameters
    ----------
    mean, sigma : float
    limits : (float or None, float or None)
        Lowest and highest.
    count : float
        Readings behind the mean, as many as are independent.
    df : float
        Degrees of freedom behind sigma.

    References
    ----------
    A. F. Bissell, How reliable is your capability index?, Applied Statistics 39 (1990), 331-340; ISO 22514-2 (indices).

    Examples
    --------
    >>> found = capability(10.0, 1.0, (7.0, 13.0), count=50, df=49)
    >>> round(found.centred.value, 3), round(found.centred.low, 3), round(found.spread.high, 3)
    (1.0, 0.782, 1.197)
    """
    lowest, highest = limits
    distances = [mean - lowest] if lowest is not None else []
    distances += [highest - mean] if highest is not None else []
    if not distances or not sigma > 0 or not df > 0:
        return Capability(UNKNOWN, UNKNOWN)
    cpk = min(distances) / (3.0 * sigma)
    half = float(special.ndtri((1 + CONFIDENCE) / 2)) * math.sqrt(1.0 / (9.0 * count) + cpk**2 / (2.0 * df))
    spread = UNKNOWN
    if lowest is not None and highest is not None:
        cp = (highest - lowest) / (6.0 * sigma)
        low, high = (float(special.chdtri(df, side)) for side in ((1 + CONFIDENCE) / 2, (1 - CONFIDENCE) / 2))
        spread = Index(cp, cp * math.sqrt(low / df), cp * math.sqrt(high / df))
    return Capability(spread, Index(cpk, cpk - half, cpk + half))
