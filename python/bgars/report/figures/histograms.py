"""How readings are spread over the balls, against their limits."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator

from bgars.report.figures.style import VERDICT_COLORS, new_figure, part_title

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from bgars.records.part_result import PartResult

__all__ = ["histogram_figure"]

BAR = "#0072B2"
COVERAGE_FACTOR = 2.0
LEAST_SPAN_UM = 1.0
SHADED = "undecided: nearer to a limit than U"
PANELS = (
    ("true_position_um", "true_position_um", "u_true_position_um", "true position (µm)"),
    ("diameter_um", "diameter_um", "u_diameter_um", "diameter (µm)"),
    ("height_um", "top_um", "u_top_um", "height: top above the local board (µm)"),
    ("seating_coplanarity_um", "seating_deviation_um", "", "apex below the seating plane (µm)"),
)


def histogram_figure(result: PartResult) -> Figure:
    """Four histograms; limits dashed, the band where nothing is decided (median U on either side) shaded."""
    figure = new_figure(13.0, 8.0)
    figure.suptitle(part_title(result), fontsize=13)
    panels = [axes for row in figure.subplots(2, 2, squeeze=False) for axes in row]
    figure.subplots_adjust(left=0.045, right=0.985, bottom=0.07, top=0.91, hspace=0.27, wspace=0.11)
    bridged = sum(ball.present and ball.kind == "bridged" for ball in result.balls)
    for axes, (limit, name, u_name, label) in zip(panels, PANELS, strict=True):
        values = np.array([getattr(ball, name) for ball in result.balls if ball.present and ball.kind == "ball"])
        u = np.array([getattr(ball, u_name) for ball in result.balls if ball.present]) if u_name else np.zeros(0)
        known = values[np.isfinite(values)]
        limits = None if result.recipe is None else result.recipe.limits.range_of(limit)
        u_um = float(np.median(u[np.isfinite(u)])) if np.isfinite(u).any() else math.nan
        if limit == "seating_coplanarity_um":
            u_um = result.u_seating_coplanarity_um
        _panel(axes, known, limits, u_um, label)
        axes.set_title(_title(known, len(values) - len(known), bridged), fontsize=10)
    shaded = [handle for axes in panels for handle in axes.get_legend_handles_labels()[0]]
    if shaded:
        figure.legend(handles=shaded[:1], loc="upper left", borderaxespad=0.6)
    return figure


def _panel(
    axes: Axes,
    values: NDArray[np.float64],
    limits: tuple[float | None, float | None] | None,
    u_um: float,
    label: str,
) -> None:
    axes.set_xlabel(label)
    axes.set_ylabel("balls")
    axes.yaxis.set_major_locator(MaxNLocator(6, integer=True))
    axes.spines[["top", "right"]].set_visible(False)
    edges = [limit for limit in limits or () if limit is not None]
    if values.size:
        low, high = float(values.min()), float(values.max())
        room = max(0.02 * (high - low), 0.5 * (LEAST_SPAN_UM - (high - low)))
        bins = int(np.clip(np.sqrt(values.size) * 2, 5, 40))
        counts, at = np.histogram(values, bins=bins, range=(max(low - room, min(low, 0.0)), high + room))
        drawn = counts > 0
        # With an edge, which is seen where limits are far away and bars are thinner than a pixel.
        axes.bar(at[:-1][drawn], counts[drawn], np.diff(at)[drawn], align="edge", color=BAR, ec=BAR, lw=3.0, zorder=3)
        axes.ticklabel_format(axis="x", useOffset=False)
    else:
        axes.set_xticks([])
        axes.set_yticks([])
    for edge in edges:
        axes.axvline(edge, color=VERDICT_COLORS["fail"], linestyle="--", linewidth=1.6, zorder=4)
        if math.isfinite(u_um):
            half = COVERAGE_FACTOR * u_um
            color = VERDICT_COLORS["undecided"]
            band = axes.axvspan(edge - half, edge + half, color=color, alpha=0.35, linewidth=0, zorder=3.5)
            band.set_label(SHADED)
        axes.annotate(
            f"limit {edge:g}",
            (edge, 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(-4 if edge == edges[-1] else 4, 0),
            textcoords="offset points",
            ha="right" if edge == edges[-1] else "left",
            va="top",
            fontsize=9,
            color=VERDICT_COLORS["fail"],
            path_effects=[withStroke(linewidth=3, foreground="white")],
            zorder=5,
        )
    if not edges:
        axes.annotate("no limit given", (0.98, 0.97), xycoords="axes fraction", ha="right", va="top", color="0.4")
    axes.margins(x=0.06)
    if values.size and len(edges) < len(("low", "high")):
        axes.set_xlim(left=min(0.0, float(values.min())))  # a distance, which is no less


def _title(known: NDArray[np.float64], missing: int, bridged: int) -> str:
    if not known.size:
        return "not measured"
    gap = f"; {missing} not measured" if missing else ""
    gap += f"; {bridged} bridged left out" if bridged else ""
    if known.size == 1:
        return f"1 ball: {known[0]:.1f} µm{gap}"
    spread = f"mean {known.mean():.1f}, standard deviation {known.std():.1f}, {known.min():.1f} to {known.max():.1f} µm"
    return f"{known.size} balls: {spread}{gap}"
