"""Figures of a gauge study."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.lines import Line2D

from bgars.report.figures.style import VERDICT_COLORS, new_figure
from bgars.studies.gauge import ACCEPTABLE_PERCENT, UNACCEPTABLE_PERCENT
from bgars.studies.svg import PLACEMENT_COLORS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

    from bgars.studies.accuracy import Accuracy
    from bgars.studies.gauge import GaugeFigures
    from bgars.studies.readings import Readings

__all__ = ["deviation_figure", "linearity_figure", "share_figure"]

WIDTH_IN = 9.0
MAX_PART_TICKS = 40
SOURCES = (("EV", "repeatability (EV)", "#0072B2"), ("AV", "placement (AV)", "#E69F00"))
INTERACTION = ("interaction", "part x placement", "#CC79A7")


def share_figure(figures: Sequence[GaugeFigures], titles: Sequence[str]) -> Figure:
    """Bars: GRR and its sources in percent of the tolerance, of the total variation where there is no tolerance."""
    figure = new_figure(WIDTH_IN, 1.4 + 0.62 * len(figures), "constrained")
    axes = figure.add_subplot()
    sources = (("GRR", "gauge R&R", "#444444"), *SOURCES, INTERACTION)
    height = 0.8 / len(sources)
    names = []
    for row, each in enumerate(figures):
        of_tolerance = each.tolerance is not None
        for at, (name, label, colour) in enumerate(sources):
            spread = each.spread(name)
            percent = spread.percent_tolerance if of_tolerance else spread.percent_study
            if math.isfinite(percent):
                y = row + (at - (len(sources) - 1) / 2) * height
                axes.barh(y, percent, height, color=colour, label=label if label not in names else None)
                names.append(label)
                if name == "GRR":
                    axes.annotate(f" {percent:.1f} %", (percent, y), va="center", fontsize=8)
    axes.set_yticks(
        range(len(figures)),
        [
            f"{t}\n({'of tolerance' if f.tolerance is not None else 'of total variation'})"
            for f, t in zip(figures, titles, strict=True)
        ],
    )
    axes.invert_yaxis()
    for percent, verdict in ((ACCEPTABLE_PERCENT, "pass"), (UNACCEPTABLE_PERCENT, "fail")):
        axes.axvline(percent, color=VERDICT_COLORS[verdict], linestyle="--", linewidth=1.2)
        axes.annotate(
            f"{percent:g} %", (percent, 1.0), xycoords=("data", "axes fraction"), ha="center", va="bottom", fontsize=8
        )
    axes.set_xlim(0, max(UNACCEPTABLE_PERCENT * 1.15, axes.get_xlim()[1] * 1.08))
    axes.set_xlabel("6 sigma, in percent")
    axes.spines[["top", "right"]].set_visible(False)
    figure.legend(loc="outside lower center", ncols=len(sources))
    return figure


def deviation_figure(readings: Readings, figures: GaugeFigures, placements: Sequence[str]) -> Figure:
    """Every reading less the mean of its ball or part, coloured by placement."""
    values = readings.values
    n, k, r = values.shape
    figure = new_figure(WIDTH_IN, 3.0, "constrained")
    axes = figure.add_subplot()
    deviations = values - values.mean(axis=(1, 2), keepdims=True)
    for place in range(k):
        shift = 0.0 if k == 1 else 0.6 * (place / (k - 1) - 0.5)
        x = np.repeat(np.arange(n) + shift, r)
        colour = PLACEMENT_COLORS[place % len(PLACEMENT_COLORS)]
        axes.plot(x, deviations[:, place].ravel(), ".", color=colour, markersize=4, alpha=0.8)
    ev = figures.spread("EV").sigma
    axes.axhspan(-3 * ev, 3 * ev, color="0.92", zorder=0)
    reach = 1.12 * max(3 * ev, float(np.abs(deviations).max()))
    if reach > 0:
        axes.set_ylim(-reach, reach)
    axes.axhline(0.0, color="0.5", linewidth=0.8)
    parts = [part for part, _ in readings.labels]
    starts = [at for at in range(n) if at == 0 or parts[at] != parts[at - 1]]
    for at in starts[1:]:
        axes.axvline(at - 0.5, color="0.8", linewidth=0.8)
    if len(starts) <= MAX_PART_TICKS:
        ends = [*starts[1:], n]
        axes.set_xticks([(a + b - 1) / 2 for a, b in zip(starts, ends, strict=True)], [parts[at] for at in starts])
    else:
        axes.set_xticks([])
    axes.tick_params(axis="x", length=0)
    axes.set_xlim(-0.6, n - 0.4)
    of = "balls in order, by part" if readings.characteristic.of == "ball" else "parts"
    axes.set_xlabel(of)
    unit = f" ({figures.unit})" if figures.unit else ""
    axes.set_ylabel(f"deviation from\nits own mean{unit}")
    marks = [
        Line2D(
            [],
            [],
            marker="o",
            linestyle="",
            markersize=4,
            color=PLACEMENT_COLORS[at % len(PLACEMENT_COLORS)],
            label=name,
        )
        for at, name in enumerate(placements[: len(PLACEMENT_COLORS)])
    ]
    marks.append(Line2D([], [], color="0.85", linewidth=6, label="± 3 EV"))
    axes.legend(handles=marks, loc="upper left", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.2)
    axes.spines[["top", "right"]].set_visible(False)
    return figure


def linearity_figure(accuracy: Accuracy, figures: GaugeFigures, title: str) -> Figure:
    """Bias against reference, with the line through it."""
    figure = new_figure(WIDTH_IN, 3.0, "constrained")
    axes = figure.add_subplot()
    x, y = (np.array(each) for each in zip(*accuracy.points, strict=True))
    axes.plot(x, y, "o", color=PLACEMENT_COLORS[0], markersize=4, label="a ball or part, mean of its runs")
    axes.axhline(0.0, color="0.5", linewidth=0.8)
    axes.axhline(accuracy.bias, color=PLACEMENT_COLORS[1], linestyle="--", linewidth=1.2, label="mean bias")
    if math.isfinite(accuracy.slope):
        ends = np.array([x.min(), x.max()])
        line = accuracy.intercept + accuracy.slope * ends
        axes.plot(ends, line, color=PLACEMENT_COLORS[2], linewidth=1.4, label="line of linearity")
    unit = f" ({figures.unit})" if figures.unit else ""
    axes.set_xlabel(f"reference {title}{unit}")
    axes.set_ylabel(f"bias{unit}")
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.2)
    return figure
