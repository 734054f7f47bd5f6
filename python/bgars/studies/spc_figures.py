"""Figures of a process trend."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from bgars.report.figures.style import VERDICT_COLORS, new_figure
from bgars.studies.svg import PLACEMENT_COLORS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from bgars.studies.query_chart import QueryChart
    from bgars.studies.trend import Trend

__all__ = ["trend_figure"]

WIDTH_IN, HEIGHT_IN = 9.0, 4.2
LINE = PLACEMENT_COLORS[0]
LABEL_IN = 0.15
"""Height of a label of 8 points with the space above it."""
LABEL_X = 1.025
"""Where labels start, in widths of the axes."""
MOST_LABELS = 8


def trend_figure(trend: Trend | QueryChart, labels: Sequence[str] = ()) -> Figure:
    """X-bar chart over S chart, or values over moving ranges, signals marked; `labels` name parts on the axis."""
    figure = new_figure(WIDTH_IN, HEIGHT_IN, "constrained")
    top, bottom = figure.subplots(2, 1, sharex=True, gridspec_kw={"height_ratios": [3, 2]})
    chart = trend.chart
    unit = f" ({trend.unit})" if trend.unit else ""
    above, below = ("mean", "std. deviation") if chart.size > 1 else ("value", "moving range")
    _chart(top, chart.means, (chart.low, chart.centre, chart.high), above + unit)
    _chart(bottom, chart.spreads, (chart.spread_low, chart.spread_centre, chart.spread_high), below + unit)
    for name, axes, values in (("mean", top, chart.means), ("spread", bottom, chart.spreads)):
        at = sorted({signal.subgroup for signal in chart.signals if signal.chart == name})
        if at:
            axes.plot(np.array(at) + 1, values[at], "o", color=VERDICT_COLORS["fail"], markersize=8, label="signal")
            axes.legend(loc="upper left")
    bottom.set_xlabel(f"subgroup of {chart.size} consecutive parts" if chart.size > 1 else "part")
    if labels:
        _name_parts(bottom, labels[:: chart.size][: len(chart.means)])
    else:
        bottom.xaxis.get_major_locator().set_params(integer=True)
    return figure


def _name_parts(axes: Axes, labels: Sequence[str]) -> None:
    """Serial number and time of some parts, evenly spread, below the axis."""
    step = max(1, -(-len(labels) // MOST_LABELS))
    places = list(range(0, len(labels), step))
    axes.set_xticks([place + 1 for place in places], [labels[place] for place in places], fontsize=7)


def _chart(axes: Axes, values: NDArray[np.float64], lines: tuple[float, float, float], title: str) -> None:
    x = np.arange(1, len(values) + 1)
    digits = _digits([*values, *lines])
    axes.plot(x, values, "o-", color=LINE, markersize=4, linewidth=1.0)
    named = zip(lines, ("LCL", "centre", "UCL"), ("--", "-", "--"), strict=True)
    known = [(value, name, style) for value, name, style in named if math.isfinite(value)]
    for value, _, style in known:
        axes.axhline(value, color="0.35", linestyle=style, linewidth=1.0)
    axes.set_ylabel(title)
    axes.ticklabel_format(axis="y", useOffset=False)
    axes.margins(x=0.02, y=0.15)
    axes.spines[["top", "right"]].set_visible(False)
    _label_lines(axes, [(value, f"{name} {value:.{digits}f}") for value, name, _ in known])


def _label_lines(axes: Axes, labels: list[tuple[float, str]]) -> None:
    """Name lines at the right edge; labels of lines that lie close together are spread, a thin stroke joins each."""
    low, high = axes.get_ylim()
    axes.set_ylim(low, high)
    room = LABEL_IN / (axes.get_position().height * HEIGHT_IN)
    heights = [(value - low) / (high - low) for value, _ in labels]
    places = _spread(heights, room)
    style = {"arrowstyle": "-", "color": "0.35", "linewidth": 0.6, "shrinkA": 0.0, "shrinkB": 0.0}
    for (_, text), height, place in zip(labels, heights, places, strict=True):
        axes.annotate(
            text,
            (1.0, height),
            (LABEL_X, place),
            xycoords="axes fraction",
            textcoords="axes fraction",
            va="center",
            fontsize=8,
            arrowprops=style,
        )


def _spread(heights: list[float], room: float) -> list[float]:
    """Places near rising heights, at least `room` apart; heights that crowd share the middle of their labels.

    Examples
    --------
    >>> [round(place, 3) for place in _spread([0.1, 0.5, 0.9], 0.1)]
    [0.1, 0.5, 0.9]
    >>> [round(place, 3) for place in _spread([0.49, 0.5, 0.51], 0.1)]
    [0.4, 0.5, 0.6]
    """
    groups: list[list[float]] = []
    for height in heights:
        groups.append([height])
        while len(groups) > 1 and _first(groups[-1], room) < _first(groups[-2], room) + room * len(groups[-2]):
            last = groups.pop()
            groups[-1] += last
    return [_first(group, room) + room * at for group in groups for at in range(len(group))]


def _first(group: list[float], room: float) -> float:
    """Place of the lowest label of a group, the others `room` apart above it."""
    return sum(group) / len(group) - room * (len(group) - 1) / 2


def _digits(values: Sequence[float]) -> int:
    """Decimals that tell apart what a chart shows: a hundredth of its height.

    Examples
    --------
    >>> _digits([599.0, 601.05, math.nan]), _digits([0.9996, 1.001])
    (2, 5)
    """
    known = [value for value in values if math.isfinite(value)]
    span = max(known, default=0.0) - min(known, default=0.0)
    return max(0, 2 - math.floor(math.log10(span))) if span > 0 else 3
