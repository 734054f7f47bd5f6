"""Mean and standard deviation of subgroups over time, with control limits: an X-bar / S chart."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from bgars.errors import InputError
from bgars.studies.nelson import nelson_signals

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

__all__ = ["WESTERN_ELECTRIC", "ControlChart", "Signal", "c4", "control_chart", "individuals_chart"]

SIGMAS = 3.0
MIN_SIZE, MIN_SUBGROUPS = 2, 2
MIN_VALUES = 3
D2, D4 = 1.128, 3.267
"""Of moving ranges of two values (ISO 7870-2, table 2)."""
BEYOND = "beyond 3 sigma"
WESTERN_ELECTRIC = (
    ("2 of 3 beyond 2 sigma on one side", 2, 3, 2.0),
    ("4 of 5 beyond 1 sigma on one side", 4, 5, 1.0),
    ("8 in a row on one side", 8, 8, 0.0),
)
"""Zone rules: so many of so many in a row beyond so many sigma of the mean, on one side."""


@dataclass(frozen=True)
class Signal:
    """A subgroup that shows a change of the process.

    Attributes
    ----------
    subgroup : int
        From 0.
    chart : str
        "mean" or "spread".
    rule : str
    """

    subgroup: int
    chart: str
    rule: str


@dataclass(frozen=True, eq=False)
class ControlChart:
    """An X-bar / S chart; with `size` 1 an I-MR chart, whose spreads are moving ranges (the first is NaN).

    Attributes
    ----------
    size : int
        Values of a subgroup.
    means, spreads : (m,) float64
        Mean and standard deviation of each subgroup.
    centre, low, high : float
        Centre and control limits of the means.
    spread_centre, spread_low, spread_high : float
        Of the standard deviations.
    sigma : float
        Within subgroups, S-bar / c4; of single values, mean moving range / d2.
    signals : tuple of Signal
    """

    size: int
    means: NDArray[np.float64]
    spreads: NDArray[np.float64]
    centre: float
    low: float
    high: float
    spread_centre: float
    spread_low: float
    spread_high: float
    sigma: float
    signals: tuple[Signal, ...]


def c4(size: int) -> float:
    """Mean of the standard deviation of `size` normal values with sigma 1 (ISO 7870-2, table 2).

    Examples
    --------
    >>> round(c4(5), 4)
    0.94
    """
    return math.sqrt(2.0 / (size - 1)) * math.exp(special.gammaln(size / 2) - special.gammaln((size - 1) / 2))


def control_chart(
    subgroups: NDArray[np.float64], *, zone_rules: bool = False, nelson: Sequence[int] = ()
) -> ControlChart:
    """Return the X-bar / S chart of subgroups in the order of time.

    Limits are centre +- 3 S-bar / (c4 sqrt(size)) for the means and S-bar (1 +- 3 sqrt(1 - c4^2) / c4) for the standard
    deviations, not below 0.

    Parameters
    ----------
    subgroups : (m, size) float64
        At least 2 subgroups of at least 2 values, finite.
    zone_rules : bool
        Also look for the Western Electric patterns in the means.
    nelson : sequence of int
        Also look for these of Nelson's rules, 1 to 8, in the means.

    Raises
    ------
    InputError
        Too few subgroups or values, or values that are not finite.

    References
    ----------
    ISO 7870-2:2013, section 6 (X-bar and s charts); Western Electric, Statistical Quality Control Handbook, 1956 (zone
    rules).

    Examples
    --------
    >>> chart = control_chart(np.array([[1.0, 2.0], [2.0, 3.0], [1.5, 2.5]]))
    >>> chart.centre, chart.signals
    (2.0, ())
    """
    values = np.asarray(subgroups, dtype=np.float64)
    if values.ndim != 2 or values.shape[0] < MIN_SUBGROUPS or values.shape[1] < MIN_SIZE:  # noqa: PLR2004 - axes
        msg = f"subgroups: must be at least 2 subgroups of at least 2 values, got {values.shape}"
        raise InputError(msg)
    if not np.isfinite(values).all():
        msg = "subgroups: must be finite"
        raise InputError(msg)
    size = values.shape[1]
    means, spreads = values.mean(axis=1), values.std(axis=1, ddof=1)
    centre, spread = float(means.mean()), float(spreads.mean())
    constant = c4(size)
    sigma = spread / constant
    half = SIGMAS * sigma / math.sqrt(size)
    spread_half = SIGMAS * spread * math.sqrt(1.0 - constant**2) / constant
    low, high = centre - half, centre + half
    spread_low, spread_high = max(0.0, spread - spread_half), spread + spread_half
    signals = [Signal(int(at), "mean", BEYOND) for at in np.flatnonzero((means < low) | (means > high))]
    signals += [
        Signal(int(at), "spread", BEYOND) for at in np.flatnonzero((spreads < spread_low) | (spreads > spread_high))
    ]
    signals += _patterns((means - centre) * (SIGMAS / half) if half > 0 else means * 0.0, zone_rules, nelson)
    return ControlChart(
        size, means, spreads, centre, low, high, spread, spread_low, spread_high, sigma, _in_order(signals)
    )


def individuals_chart(
    values: NDArray[np.float64], *, zone_rules: bool = False, nelson: Sequence[int] = ()
) -> ControlChart:
    """Return the I-MR chart of single values in the order of time.

    Limits are mean +- 3 MR-bar / d2 for the values and D4 MR-bar for the moving ranges of two, with d2 = 1.128 and
    D4 = 3.267.

    Parameters
    ----------
    values : (m,) float64
        At least 3, finite.
    zone_rules, nelson
        As in :func:`control_chart`.

    Raises
    ------
    InputError
        Too few values, or values that are not finite.

    References
    ----------
    ISO 7870-2:2013, section 7 (individuals and moving range).

    Examples
    --------
    >>> chart = individuals_chart(np.array([1.0, 2.0, 1.0, 2.0]))
    >>> round(chart.high, 2), round(chart.spread_high, 3)
    (4.16, 3.267)
    """
    values = np.asarray(values, dtype=np.float64)
    if values.ndim != 1 or len(values) < MIN_VALUES:
        msg = f"values: must be at least {MIN_VALUES} in a row, got {values.shape}"
        raise InputError(msg)
    if not np.isfinite(values).all():
        msg = "values: must be finite"
        raise InputError(msg)
    ranges = np.concatenate([[np.nan], np.abs(np.diff(values))])
    centre, spread = float(values.mean()), float(np.nanmean(ranges))
    sigma = spread / D2
    low, high, spread_high = centre - SIGMAS * sigma, centre + SIGMAS * sigma, D4 * spread
    signals = [Signal(int(at), "mean", BEYOND) for at in np.flatnonzero((values < low) | (values > high))]
    signals += [Signal(int(at), "spread", BEYOND) for at in np.flatnonzero(ranges > spread_high)]
    signals += _patterns((values - centre) / sigma if sigma > 0 else values * 0.0, zone_rules, nelson)
    return ControlChart(1, values, ranges, centre, low, high, spread, 0.0, spread_high, sigma, _in_order(signals))


def _in_order(signals: list[Signal]) -> tuple[Signal, ...]:
    return tuple(sorted(set(signals), key=lambda signal: (signal.subgroup, signal.chart, signal.rule)))


def _patterns(deviations: NDArray[np.float64], zone_rules: bool, nelson: Sequence[int]) -> list[Signal]:
    """Signals of rules over several values; rule 1 of Nelson is the one that is always looked for."""
    found = _zones(deviations) if zone_rules else []
    found += [Signal(at, "mean", rule) for at, rule in nelson_signals(deviations, [n for n in nelson if n != 1])]
    return found


def _zones(deviations: NDArray[np.float64]) -> list[Signal]:
    """Patterns in the means, deviations in their sigma; a signal stands at the value that completes its pattern."""
    found = []
    for rule, needed, window, beyond in WESTERN_ELECTRIC:
        for side in (1.0, -1.0):
            outside = side * deviations > beyond
            for at in range(needed - 1, len(deviations)):
                if outside[at] and int(outside[max(0, at - window + 1) : at + 1].sum()) >= needed:
                    found.append(Signal(at, "mean", rule))
    return found
