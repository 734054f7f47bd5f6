"""Variance components of repeated measurements: parts x placements x repeats, by analysis of variance."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from bgars.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["POOL_ABOVE_P", "Anova", "AnovaRow", "crossed_anova"]

POOL_ABOVE_P = 0.25
"""An interaction with a larger p-value is pooled with the repeatability (AIAG MSA, 4th ed., appendix A)."""
AXES = 3
MIN_REPEATS = 2


@dataclass(frozen=True)
class AnovaRow:
    """A line of the table; NaN where a line has no test.

    Attributes
    ----------
    source : str
        "part", "placement", "part x placement", "repeatability" or "total".
    df : int
        Degrees of freedom.
    ss, ms : float
        Sum of squares and mean square, in the squared unit of the readings.
    f, p : float
        F ratio and its p-value.
    """

    source: str
    df: int
    ss: float
    ms: float
    f: float
    p: float


@dataclass(frozen=True)
class Anova:
    """Table and variance components, in the squared unit of the readings; negative estimates are zero.

    Attributes
    ----------
    rows : tuple of AnovaRow
    pooled : bool
        Whether the interaction was pooled with the repeatability.
    repeatability, placement, interaction, part : float
        Variances; NaN where the design does not show them (one placement, one part).
    repeatability_df : int
        Degrees of freedom behind the repeatability.
    """

    rows: tuple[AnovaRow, ...]
    pooled: bool
    repeatability: float
    placement: float
    interaction: float
    part: float
    repeatability_df: int


def crossed_anova(readings: NDArray[np.float64], *, pool_above_p: float = POOL_ABOVE_P) -> Anova:
    """Split the variance of a balanced crossed design with random factors.

    Parameters
    ----------
    readings : (n, k, r) float64
        n parts, k placements, r repeats; finite. One part or one placement leaves a one-way analysis.
    pool_above_p : float
        The interaction is pooled with the repeatability when its p-value is larger.

    Returns
    -------
    Anova

    Raises
    ------
    InputError
        Not three axes, fewer than two repeats, or readings that are not finite.

    References
    ----------
    AIAG, Measurement Systems Analysis, 4th ed., 2010, appendix A (expected mean squares of the crossed design).

    Examples
    --------
    >>> import numpy as np
    >>> two = crossed_anova(np.array([[[1.0, 1.2]], [[3.0, 3.2]]]))
    >>> round(two.repeatability, 3), round(two.part, 3)
    (0.02, 1.99)
    """
    values = np.asarray(readings, dtype=np.float64)
    if values.ndim != AXES or 0 in values.shape or values.shape[2] < MIN_REPEATS:
        msg = f"readings: must be (parts, placements, repeats) with at least 2 repeats, got {values.shape}"
        raise InputError(msg)
    if not np.isfinite(values).all():
        msg = "readings: must be finite"
        raise InputError(msg)
    n, k, r = values.shape
    values = values - values.mean()
    cells, parts, placements = values.mean(axis=2), values.mean(axis=(1, 2)), values.mean(axis=(0, 2))
    ss = {
        "part": k * r * float(np.sum(parts**2)),
        "placement": n * r * float(np.sum(placements**2)),
        "part x placement": r * float(np.sum((cells - parts[:, None] - placements[None, :]) ** 2)),
        "repeatability": float(np.sum((values - cells[:, :, None]) ** 2)),
    }
    df = {
        "part": n - 1,
        "placement": k - 1,
        "part x placement": (n - 1) * (k - 1),
        "repeatability": n * k * (r - 1),
    }
    ms = {name: ss[name] / df[name] if df[name] else math.nan for name in ss}
    p_interaction = _p(ms["part x placement"], ms["repeatability"], df["part x placement"], df["repeatability"])[1]
    pooled = p_interaction > pool_above_p
    error, error_df = ms["repeatability"], df["repeatability"]
    if pooled:
        error_df += df["part x placement"]
        error = (ss["repeatability"] + ss["part x placement"]) / error_df
    # What a part or a placement is tested against: the interaction where it is kept and exists.
    base, base_df = error, error_df
    if not pooled and df["part x placement"]:
        base, base_df = ms["part x placement"], df["part x placement"]
    tests = {
        "part": _p(ms["part"], base, df["part"], base_df),
        "placement": _p(ms["placement"], base, df["placement"], base_df),
        "part x placement": _p(
            ms["part x placement"], ms["repeatability"], df["part x placement"], df["repeatability"]
        ),
        "repeatability": (math.nan, math.nan),
    }
    rows = [AnovaRow(name, df[name], ss[name], ms[name], *tests[name]) for name in ss if df[name]]
    total = float(np.sum(values**2))
    rows.append(AnovaRow("total", values.size - 1, total, math.nan, math.nan, math.nan))
    return Anova(
        tuple(rows),
        pooled,
        repeatability=error,
        placement=_component(ms["placement"], base, n * r),
        interaction=0.0 if pooled else _component(ms["part x placement"], error, r),
        part=_component(ms["part"], base, k * r),
        repeatability_df=error_df,
    )


def _p(ms: float, base: float, df: int, base_df: int) -> tuple[float, float]:
    """F ratio and p-value; NaN where there is nothing to compare with."""
    if not df or not base > 0:
        return math.nan, math.nan
    f = ms / base
    return f, float(special.fdtrc(df, base_df, f))


def _component(ms: float, base: float, count: int) -> float:
    return max(0.0, (ms - base) / count) if math.isfinite(ms) else math.nan
