"""Trend and capability of a process, from the results of many parts."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from bgars.errors import InputError
from bgars.records.short import Short
from bgars.studies.capability import Capability, capability
from bgars.studies.characteristics import CHARACTERISTICS, Characteristic, part_readings
from bgars.studies.control_chart import D2, MIN_VALUES, ControlChart, control_chart, individuals_chart
from bgars.studies.plain import plain

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from bgars.records.ball_result import Verdict
    from bgars.records.part_result import PartResult

__all__ = ["DEFAULT_SUBGROUP", "TARGET", "ProcessTrend", "Trend", "process_trend"]

FORMAT = "bgars-spc"
FORMAT_VERSION = 1
DEFAULT_SUBGROUP = 5
TARGET = 1.33
TYPICAL_SUBGROUPS = 25
MIN_SUBGROUPS = 2
SINGLE_CHARTS = {"mean": "value", "spread": "moving range"}
MOVING_RANGE_DF = 0.6
"""Degrees of freedom a value of a sigma from moving ranges: of m normal values, its relative variance is 0.826 / m."""


@dataclass(frozen=True, eq=False, repr=False)
class Trend(Short):
    """One characteristic over time.

    Attributes
    ----------
    characteristic, title, unit : str
    lowest, highest : float or None
        Limits.
    chart : ControlChart
        Of the parts' values: for a reading of each ball, its mean over the balls of the part.
    values : (m, size) float64
        What the chart is made of.
    readings : int
        Single readings behind the capability: every ball counts.
    effective : float
        How many independent readings they are worth.
    mean, sigma_overall, sigma_within : float
        Of the single readings: all of them, and within subgroups.
    overall, within : Capability
        Pp and Ppk; Cp and Cpk.
    outside : int
        Readings outside the limits.
    left_out : tuple of str
        Balls without a reading in some part.
    verdict : Verdict or None
        None without limits.
    reason : str
    """

    characteristic: str
    title: str
    unit: str
    lowest: float | None
    highest: float | None
    chart: ControlChart
    values: NDArray[np.float64]
    readings: int
    effective: float
    mean: float
    sigma_overall: float
    sigma_within: float
    overall: Capability
    within: Capability
    outside: int
    left_out: tuple[str, ...]
    verdict: Verdict | None
    reason: str


@dataclass(frozen=True, eq=False, repr=False)
class ProcessTrend(Short):
    """Trend and capability of a process, from many results.

    Attributes
    ----------
    results : tuple of str
        Files, in the order of time.
    times : tuple of str
        When each was inspected; empty = not stamped.
    serials : tuple of str
        Serial number of each; empty = not known.
    part : str
        Name of the part.
    subgroup : int
        1: charts of single parts and their moving ranges.
    target : float
    trends : tuple of Trend
    verdict : {"pass", "fail", "undecided"}
    reasons : tuple of str
    warnings : tuple of str
    """

    results: tuple[str, ...]
    times: tuple[str, ...]
    serials: tuple[str, ...]
    part: str
    subgroup: int
    target: float
    trends: tuple[Trend, ...]
    verdict: Verdict
    reasons: tuple[str, ...]
    warnings: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain Python values; None where something is not known."""
        heading = {"format": FORMAT, "format_version": FORMAT_VERSION}
        values = {name: plain(value) for name, value in vars(self).items() if name != "trends"}
        trends = []
        for trend in self.trends:
            told = {name: value for name, value in vars(trend).items() if name not in {"chart", "values"}}
            chart = {**vars(trend.chart), "means": trend.chart.means.tolist(), "spreads": trend.chart.spreads.tolist()}
            trends.append(
                {name: plain(value) for name, value in told.items()}
                | {"chart": {k: plain(v) for k, v in chart.items()}}
            )
        return heading | values | {"trends": trends}


def process_trend(
    results: Sequence[tuple[str, PartResult]],
    *,
    subgroup: int = DEFAULT_SUBGROUP,
    target: float = TARGET,
    zone_rules: bool = False,
    nelson: Sequence[int] = (),
    warnings: Sequence[str] = (),
) -> ProcessTrend:
    """Chart a process and state its capability.

    A chart follows one value per part, the mean over its balls, in subgroups of consecutive parts: balls of a part
    share its causes, so that limits from the spread within a part would flag every part. Capability counts every
    ball, because every ball must be within its limits; its interval counts how many independent readings they are
    worth, n / (1 + (b - 1) rho) with b balls per part and their intraclass correlation rho.

    Parameters
    ----------
    results : sequence of (str, PartResult)
        In the order of time, from :func:`bgars.read_results`.
    subgroup : int
        Consecutive parts of a subgroup; 1: single parts and moving ranges (I-MR).
    target : float
        Ppk that is wanted.
    zone_rules : bool
        Also look for the Western Electric patterns.
    nelson : sequence of int
        Also look for these of Nelson's rules, 1 to 8.
    warnings : sequence of str
        Put before the own ones.

    Returns
    -------
    ProcessTrend
        "pass" only if every characteristic with limits was measured in every part, is in control, and has the lower
        end of the interval of Ppk at the target or above; "fail" if the upper end is below, or a reading is outside.

    Raises
    ------
    InputError
        Too few results, or nothing that was measured in all of them.

    References
    ----------
    ISO 22514-2 (Pp, Ppk, Cp, Cpk); L. Kish, Survey Sampling, 1965, section 5.4 (the design effect of clusters).
    """
    if subgroup < 1:
        msg = f"subgroup: must be 1 or more parts, got {subgroup}"
        raise InputError(msg)
    if not (math.isfinite(target) and target > 0):
        msg = f"target: must be above 0, got {target}"
        raise InputError(msg)
    count = len(results) // subgroup
    if subgroup == 1 and count < MIN_VALUES:
        msg = f"results: must be at least {MIN_VALUES} for a chart of single parts, got {len(results)}"
        raise InputError(msg)
    if count < MIN_SUBGROUPS:
        msg = f"results: must be at least {MIN_SUBGROUPS * subgroup} (2 subgroups of {subgroup}), got {len(results)}"
        raise InputError(msg)
    told = list(warnings)
    points = "subgroups" if subgroup > 1 else "parts"
    if count < TYPICAL_SUBGROUPS:
        told.append(f"{count} {points}: control limits and capability are rough; {TYPICAL_SUBGROUPS} or more are usual")
    rest = len(results) - count * subgroup
    if rest:
        told.append(f"the last {rest} results do not fill a subgroup and are left out; first: {results[-rest][0]}")
    used = [result for _, result in results[: count * subgroup]]
    trends = [_trend(used, each, subgroup, target, zone_rules, nelson) for each in CHARACTERISTICS]
    known = tuple(trend for trend in trends if isinstance(trend, Trend))
    recipe = used[0].recipe
    missing = [
        f"{each.title}: has a limit, but was not measured in every part"
        for each, trend in zip(CHARACTERISTICS, trends, strict=True)
        if trend is None and each.limits(recipe) != (None, None)
    ]
    if not known:
        msg = f"{results[0][0]}: nothing was measured in all of the {len(used)} results"
        raise InputError(msg)
    verdict, reasons = _verdict(known, missing)
    return ProcessTrend(
        tuple(name for name, _ in results),
        tuple(result.inspected_utc for _, result in results),
        tuple(result.serial for _, result in results),
        used[0].name,
        subgroup,
        target,
        known,
        verdict,
        reasons,
        tuple(told),
    )


def _verdict(trends: Sequence[Trend], missing: list[str]) -> tuple[Verdict, tuple[str, ...]]:
    judged = [trend for trend in trends if trend.verdict is not None]
    reasons = [
        trend.reason for wanted in ("fail", "undecided") for trend in judged if trend.verdict == wanted
    ] + missing
    if not judged:
        reasons.append("no limits: charts are known, capability is not; give a recipe with a [limits] table")
    verdicts = {trend.verdict for trend in judged}
    if "fail" in verdicts:
        return "fail", tuple(reasons)
    return ("undecided" if reasons else "pass"), tuple(reasons)


def _trend(
    results: list[PartResult],
    characteristic: Characteristic,
    subgroup: int,
    target: float,
    zone_rules: bool,
    nelson: Sequence[int],
) -> Trend | None:
    tables = [part_readings(result, characteristic) for result in results]
    names = dict.fromkeys(name for table in tables for name in table)
    complete = [name for name in names if all(math.isfinite(table.get(name, math.nan)) for table in tables)]
    if not complete:
        return None
    rows = np.array([[table[name] for name in complete] for table in tables], dtype=np.float64)
    values = rows.mean(axis=1).reshape(-1, subgroup)
    groups = rows.reshape(len(values), -1)
    n, mean = rows.size, float(rows.mean())
    effective = n / (1.0 + (len(complete) - 1) * _correlation(rows))
    overall = float(rows.std(ddof=1))
    if subgroup == 1:  # from part to part, ball by ball
        within = float(np.abs(np.diff(rows, axis=0)).mean()) / D2
        df_within = MOVING_RANGE_DF * effective
    else:
        within = float(math.sqrt(groups.var(axis=1, ddof=1).mean()))
        df_within = (n - len(values)) * effective / n
    limits = characteristic.limits(results[0].recipe)
    lowest, highest = limits
    outside = int(np.sum(rows < (-math.inf if lowest is None else lowest)))
    outside += int(np.sum(rows > (math.inf if highest is None else highest)))
    if subgroup == 1:
        chart = individuals_chart(values[:, 0], zone_rules=zone_rules, nelson=nelson)
    else:
        chart = control_chart(values, zone_rules=zone_rules, nelson=nelson)
    left_out = tuple(name for name in names if name not in complete)
    figures = capability(mean, overall, limits, count=effective, df=max(effective - 1.0, 1.0))
    verdict, reason = _judged(characteristic, chart, figures, target, left_out, outside, limits)
    return Trend(
        characteristic.name,
        characteristic.title,
        characteristic.unit,
        lowest,
        highest,
        chart,
        values,
        n,
        effective,
        mean,
        overall,
        within,
        overall=figures,
        within=capability(mean, within, limits, count=effective, df=max(df_within, 1.0)),
        outside=outside,
        left_out=left_out,
        verdict=verdict,
        reason=reason,
    )


def _correlation(rows: NDArray[np.float64]) -> float:
    """Intraclass correlation of the balls of a part, in [0, 1], from a one-way analysis of variance."""
    parts, balls = rows.shape
    if balls == 1:
        return 0.0
    # Balls differ by design or tooling (a ball's own mean): that is no correlation within a part.
    residual = rows - rows.mean(axis=0)
    between = balls * float(residual.mean(axis=1).var(ddof=1))
    within = float(np.sum((residual - residual.mean(axis=1, keepdims=True)) ** 2)) / ((parts - 1) * (balls - 1))
    total = between + (balls - 1) * within
    return min(1.0, max(0.0, (between - within) / total)) if total > 0 else 1.0


def _judged(
    characteristic: Characteristic,
    chart: ControlChart,
    figures: Capability,
    target: float,
    left_out: tuple[str, ...],
    outside: int,
    limits: tuple[float | None, float | None],
) -> tuple[Verdict | None, str]:
    title, index = characteristic.title, figures.centred
    if limits == (None, None):
        return None, f"{title}: no limits"
    told = f"{title}: Ppk = {index.value:.2f} ({index.low:.2f} to {index.high:.2f}), wanted {target:g}"
    doubts = []
    if math.isnan(index.value):
        told = f"{title}: no spread at all, so no Ppk"
        doubts.append("check the readings")
    if chart.signals:
        first = chart.signals[0]
        several = f"{len(chart.signals)} signals; first: " if len(chart.signals) > 1 else ""
        name, what = (first.chart, "subgroup") if chart.size > 1 else (SINGLE_CHARTS[first.chart], "part")
        doubts.append(
            f"not in control ({several}{name} of {what} {first.subgroup + 1}: {first.rule}), "
            "so that no index holds for the parts to come"
        )
    if left_out:
        doubts.append(f"not measured in every part: {', '.join(left_out[:8])}")
    if outside:
        doubts.append(f"{outside} readings are outside the limits")
    reason = "; ".join([told, *doubts])
    if index.high < target or outside:
        return "fail", reason
    return ("undecided" if doubts or not index.low >= target else "pass"), reason
