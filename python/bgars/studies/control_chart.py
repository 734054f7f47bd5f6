"""Mean and standard deviation of subgroups over time, with control limits: an X-bar / S chart."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from bgars.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["WESTERN_ELECTRIC", "ControlChart", "Signal", "c4", "control_chart"]

SIGMAS = 3.0
MIN_SIZE, MIN_SUBGROUPS = 2, 2
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
    """An X-bar / S chart.

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
        Within subgroups, S-bar / c4.
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


def control_chart(subgroups: NDArray[np.float64], *, zone_rules: bool = False) -> ControlChart:
    """Return the X-bar / S chart of subgroups in the order of time.

    Limits are centre +- 3 S-bar / (c4 sqrt(size)) for the means and S-bar (1 +- 3 sqrt(1 - c4^2) / c4) for the standard
    deviations, not below 0.

    Parameters
    ----------
    subgroups : (m, size) float64
        At least 2 subgroups of at least 2 values, finite.
    zone_rules : bool
        Also look for the Western Electric patterns in the means.

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
    if zone_rules and half > 0:
        signals += _zones((means - centre) / (half / SIGMAS))
    ordered = tuple(sorted(signals, key=lambda signal: (signal.subgroup, signal.chart, signal.rule)))
    return ControlChart(size, means, spreads, centre, low, high, spread, spread_low, spread_high, sigma, ordered)


def _zones(deviations: NDArray[np.float64]) -> list[Signal]:
    """Patterns in the means, deviations in their sigma; a signal stands at the value that completes its pattern."""
    found = []
    for rule, needed, window, beyond in WESTERN_ELECTRIC:
        for side in (1.0, -1.0):
            outside = side * deviations > beyond
            for at in range(window - 1, len(deviations)):
                if outside[at] and int(outside[at - window + 1 : at + 1].sum()) >= needed:
                    found.append(Signal(at, "mean", rule))
    return found
