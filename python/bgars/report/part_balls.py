"""The part as the camera sees it, every ball outlined, named and coloured by its deviation."""

from __future__ import annotations

import math
from textwrap import wrap
from typing import TYPE_CHECKING

import numpy as np
from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.lines import Line2D
from matplotlib.patches import Circle

from bgars.report.part_style import (
    ABSENT,
    DASHES,
    VERDICT_COLORS,
    ball_deviations,
    ball_place_um,
    ball_radius_um,
    finite_range,
    image_extent_um,
    label_balls,
    new_figure,
    part_frame,
    part_title,
    shown_image,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from bgars.part_result import PartResult
    from bgars.records import Capture

__all__ = ["part_figure"]

SIDE_IN = 9.0
FILL = 0.55
MAX_LINES = 8
MAX_LETTERS = 118
COLORS = "viridis"


def part_figure(result: PartResult, capture: Capture) -> Figure:
    """Draw the balls over the mean of the images; colour = distance of the apex below the seating plane."""
    figure = new_figure(SIDE_IN + 2.2, SIDE_IN + 0.9)
    axes = figure.subplots()
    figure.suptitle(part_title(result), fontsize=14, color=_title_color(result))
    axes.set_title("\n".join(_reasons(result)), fontsize=9, loc="left")
    axes.imshow(
        np.sqrt(shown_image(capture, _mean_image(capture))),
        extent=image_extent_um(capture),
        cmap="gray",
        vmin=0.0,
        vmax=1.3,
        interpolation="nearest",
    )
    name, values = ball_deviations(result)
    norm = Normalize(*finite_range(values))
    colors = colormaps[COLORS]
    for ball, value in zip(result.balls, values, strict=True):
        place = ball_place_um(ball)
        if place is None:
            continue
        radius = ball_radius_um(ball, result)
        if ball.present:
            if math.isfinite(value):
                axes.add_patch(Circle(place, radius, facecolor=colors(norm(value)), alpha=FILL, edgecolor="none"))
            axes.add_patch(
                Circle(
                    place, radius, fill=False, edgecolor=VERDICT_COLORS[ball.verdict], linewidth=_width(ball.verdict)
                )
            )
        else:
            axes.add_patch(
                Circle(
                    place,
                    radius,
                    fill=False,
                    edgecolor=VERDICT_COLORS[ball.verdict],
                    linewidth=2.0,
                    linestyle=DASHES,
                )
            )
    _draw_bridges(axes, result)
    part_frame(axes, result, image_extent_um(capture))
    label_balls(axes, result, SIDE_IN)
    if any(math.isfinite(value) for value in values):
        figure.colorbar(ScalarMappable(norm, COLORS), ax=axes, label=f"{name} (µm)", shrink=0.8)
    _legend(axes, result)
    return figure


def _mean_image(capture: Capture) -> NDArray[np.float32]:
    total: NDArray[np.float32] = np.zeros(capture.mask.shape, dtype=np.float32)
    for image in capture.images:
        total += image
    return total / np.float32(len(capture.images))


def _reasons(result: PartResult) -> list[str]:
    lines = [line for reason in result.reasons for line in wrap(reason, MAX_LETTERS, subsequent_indent="      ")]
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


def _legend(axes: Axes, result: PartResult) -> None:
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
        axes.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.07), ncols=len(handles))
