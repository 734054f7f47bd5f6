"""The part as the camera sees it, every ball outlined, named and coloured by its deviation."""

from __future__ import annotations

from textwrap import wrap
from typing import TYPE_CHECKING

import numpy as np
from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.lines import Line2D

from bgars.report.figures.style import (
    ABSENT,
    DASHES,
    VERDICT_COLORS,
    add_axes,
    ball_deviations,
    ball_place_um,
    ball_radius_um,
    discs,
    finite_range,
    image_extent_um,
    label_balls,
    new_figure,
    part_frame,
    part_title,
    part_window,
    shown_image,
    window_size_in,
)
from bgars.report.html.units import with_micro

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from bgars.records.capture import Capture
    from bgars.records.part_result import PartResult

__all__ = ["part_figure"]

SIDE_IN = 8.1
LEFT_IN, RIGHT_IN, BELOW_IN, LEAST_WIDTH_IN = 1.15, 1.75, 0.95, 11.0
"""Room around the picture: for its axes, its colour bar, its legend, and for the reasons above it."""
LINE_IN = 0.17
FILL = 0.55
MAX_LINES = 8
MAX_LETTERS = 118
COLORS = "viridis"


def part_figure(result: PartResult, capture: Capture) -> Figure:
    """Draw the balls over the mean of the images; colour = distance of the apex below the seating plane."""
    reasons = _reasons(result)
    window = part_window(result, image_extent_um(capture))
    wide_in, tall_in = window_size_in(window, SIDE_IN)
    over_in = 0.55 + LINE_IN * max(1, len(reasons))
    figure = new_figure(max(LEFT_IN + wide_in + RIGHT_IN, LEAST_WIDTH_IN), BELOW_IN + tall_in + over_in)
    axes = add_axes(figure, LEFT_IN, BELOW_IN, wide_in, tall_in)
    figure.suptitle(part_title(result), fontsize=14, color=_title_color(result))
    axes.set_title("\n".join(reasons), fontsize=9, loc="left")
    axes.imshow(
        np.sqrt(shown_image(_mean_image(capture))),
        extent=image_extent_um(capture),
        cmap="gray",
        vmin=0.0,
        vmax=1.3,
        interpolation="nearest",
    )
    name, values = ball_deviations(result)
    norm = Normalize(*finite_range(values))
    _draw_balls(axes, result, colormaps[COLORS](norm(np.nan_to_num(values))), np.isfinite(values))
    _draw_bridges(axes, result)
    part_frame(axes, window)
    label_balls(axes, result, wide_in)
    if np.isfinite(values).any():
        bar = add_axes(figure, LEFT_IN + wide_in + 0.4, BELOW_IN + 0.1 * tall_in, 0.32, 0.8 * tall_in)
        figure.colorbar(ScalarMappable(norm, COLORS), cax=bar, label=f"{name} (µm)")
    _legend(figure, result, LEFT_IN + wide_in / 2)
    return figure


def _draw_balls(axes: Axes, result: PartResult, colors: NDArray[np.float64], known: NDArray[np.bool_]) -> None:
    """Every ball in the colour of its deviation, outlined in that of its verdict; dashed where none is."""
    drawn = [(*each, place) for *each, place in zip(
        result.balls, colors, known, map(ball_place_um, result.balls), strict=True
    ) if place is not None]  # fmt: skip
    filled = [(place, ball, color) for ball, color, is_known, place in drawn if ball.present and is_known]
    discs(
        axes, [place for place, _, _ in filled], [ball_radius_um(ball, result) for _, ball, _ in filled],
        facecolors=[(*color[:3], FILL) for *_, color in filled], edgecolors="none",
    )  # fmt: skip
    for present, dashes in ((True, "-"), (False, DASHES)):
        balls = [(place, ball) for ball, _, _, place in drawn if ball.present == present]
        discs(
            axes, [place for place, _ in balls], [ball_radius_um(ball, result) for _, ball in balls],
            facecolors="none", edgecolors=[VERDICT_COLORS[ball.verdict] for _, ball in balls],
            linewidths=[_width(ball.verdict) if present else 2.0 for _, ball in balls], linestyles=dashes,
        )  # fmt: skip


def _mean_image(capture: Capture) -> NDArray[np.float32]:
    total: NDArray[np.float32] = np.zeros(capture.mask.shape, dtype=np.float32)
    for image in capture.images:
        total += image
    return total / np.float32(len(capture.images))


def _reasons(result: PartResult) -> list[str]:
    reasons = [with_micro(reason) for reason in result.reasons]
    lines = [line for reason in reasons for line in wrap(reason, MAX_LETTERS, subsequent_indent="      ")]
    more = ["... more in result.json"] if len(lines) > MAX_LINES else []
    return lines[:MAX_LINES] + more


def _title_color(result: PartResult) -> str:
    return {"pass": "#0072B2", "fail": VERDICT_COLORS["fail"], "undecided": "#9a6a00"}[result.verdict]


def _width(verdict: str) -> float:
    return 1.3 if verdict == "pass" else 2.4


def _draw_bridges(axes: Axes, result: PartResult) -> None:
    places = {ball.name: ball_place_um(ball) for ball in result.balls}
    for first, second in result.bridges:
        ends = [place for name in (first, second) if (place := places.get(name))]
        if len(ends) == len((first, second)):
            axes.plot(*zip(*ends, strict=True), color=VERDICT_COLORS["fail"], linewidth=5.0, alpha=0.8, zorder=4)


def _legend(figure: Figure, result: PartResult, middle_in: float) -> None:
    handles = [
        Line2D([], [], color=color, marker="o", markersize=9, fillstyle="none", linestyle="none", label=verdict)
        for verdict, color in VERDICT_COLORS.items()
        if any(ball.verdict == verdict and ball.present for ball in result.balls)
    ]
    handles += [
        Line2D([], [], color=VERDICT_COLORS[verdict], linestyle=DASHES, linewidth=2.0, label=words)
        for verdict, words in ABSENT.items()
        if any(ball.verdict == verdict and not ball.present for ball in result.balls)
    ]
    if result.bridges:
        handles.append(Line2D([], [], color=VERDICT_COLORS["fail"], linewidth=5.0, label="bridge"))
    if handles:
        width_in, height_in = figure.get_size_inches()
        place = (middle_in / width_in, 0.35 / height_in)
        figure.legend(handles=handles, loc="upper center", bbox_to_anchor=place, ncols=len(handles))
