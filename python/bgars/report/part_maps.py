"""Maps of the deviations: height below the seating plane, and where balls are off their places."""

from __future__ import annotations

import math
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
    label_balls,
    new_figure,
    part_frame,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bgars.part_result import PartResult

__all__ = ["deviation_figure"]

SIDE_IN = 7.2
COLORS = "viridis"
LONGEST_ARROW = 0.9
"""Length of the longest arrow, of the pitch."""
ROUND = (1.0, 2.0, 5.0)
FAIL, OFFSET = VERDICT_COLORS["fail"], "#0072B2"
DISC: dict[str, object] = {"linestyle": "none", "marker": "o", "markersize": 9, "markeredgewidth": 1.2}
DASHED: dict[str, dict[str, object]] = {
    verdict: {"linestyle": DASHES, "color": VERDICT_COLORS[verdict], "linewidth": 1.2} for verdict in ABSENT
}
"""Places without a ball, by verdict."""
HEIGHT_MARKS: tuple[tuple[str, dict[str, object]], ...] = (
    ("filled: see the colour bar", DISC | {"markerfacecolor": "#21918C", "markeredgecolor": "0.3"}),
    ("orange outline: fails", DISC | {"markerfacecolor": "#21918C", "markeredgecolor": FAIL}),
    ("white: no height measured", DISC | {"markerfacecolor": "white", "markeredgecolor": "0.3"}),
    *((f"dashed: {words}", DASHED[verdict]) for verdict, words in ABSENT.items()),
)
OFFSET_MARKS: tuple[tuple[str, dict[str, object]], ...] = (
    ("offset of a ball", {"color": OFFSET, "linewidth": 2.2}),
    ("of a ball that fails", {"color": FAIL, "linewidth": 2.2}),
    *((words, DASHED[verdict]) for verdict, words in ABSENT.items()),
)


def deviation_figure(result: PartResult) -> Figure:
    """Heights by colour, offsets from the grid by arrows of a stated magnification."""
    figure = new_figure(2 * SIDE_IN + 2.0, SIDE_IN + 0.8)
    left, right = figure.subplots(1, 2)
    _heights(figure, left, result)
    _offsets(right, result)
    return figure


def _heights(figure: Figure, axes: Axes, result: PartResult) -> None:
    name, values = ball_deviations(result)
    norm, colors = Normalize(*finite_range(values)), colormaps[COLORS]
    for ball, value in zip(result.balls, values, strict=True):
        place = ball_place_um(ball)
        if place is None:
            continue
        known = math.isfinite(value)
        axes.add_patch(
            Circle(
                place,
                ball_radius_um(ball, result),
                facecolor=colors(norm(value)) if known else "white",
                edgecolor=VERDICT_COLORS[ball.verdict] if ball.verdict == "fail" or not ball.present else "0.3",
                linewidth=1.8 if ball.verdict == "fail" or not ball.present else 0.8,
                linestyle="-" if ball.present else DASHES,
            )
        )
    seats = " / ".join(", ".join(seat.balls[:6]) for seat in result.seatings[:2])
    reading = _reading(result.seating_coplanarity_um, result.u_seating_coplanarity_um, result.seating_noise_bias_um)
    rests = f"rests on {seats}" if seats else "no seating plane"
    axes.set_title(f"{name[0].upper()}{name[1:]} ({rests})\nseating coplanarity {reading}")
    part_frame(axes, result)
    label_balls(axes, result, SIDE_IN - 1.5)
    has_height = [math.isfinite(value) for value in values]
    _legend(
        axes,
        [entry for entry, is_drawn in zip(HEIGHT_MARKS, _height_marks(result, has_height), strict=True) if is_drawn],
    )
    if any(math.isfinite(value) for value in values):
        figure.colorbar(ScalarMappable(norm, COLORS), ax=axes, label=f"{name} (µm)", shrink=0.8)


def _offsets(axes: Axes, result: PartResult) -> None:
    known = [ball for ball in result.balls if math.isfinite(ball.true_position_um)]
    places = np.array([(ball.x_nominal_um, ball.y_nominal_um) for ball in known]).reshape(-1, 2)
    centres = np.array([(ball.x_um, ball.y_um) for ball in known]).reshape(-1, 2)
    offsets = centres - places
    longest = float(np.hypot(*offsets.T).max(initial=0.0))
    pitch_um = result.pitch_um if math.isfinite(result.pitch_um) else _size_um(result)
    magnification = _round_down(LONGEST_ARROW * pitch_um / longest) if longest > 0 else 1.0
    for ball in result.balls:
        place = ball_place_um(ball)
        if place is not None:
            axes.add_patch(
                Circle(
                    place,
                    ball_radius_um(ball, result),
                    facecolor="0.93",
                    edgecolor="0.75" if ball.present else VERDICT_COLORS[ball.verdict],
                    linestyle="-" if ball.present else DASHES,
                )
            )
    part_frame(axes, result)
    if known:
        axes.quiver(
            *places.T,
            *(magnification * offsets).T,
            angles="xy",
            scale_units="xy",
            scale=1.0,
            width=0.004,
            color=[OFFSET if ball.verdict != "fail" else FAIL for ball in known],
            zorder=5,
        )
        _key(axes, magnification, longest)
        drawn = (
            any(ball.verdict != "fail" for ball in known),
            any(ball.verdict == "fail" for ball in known),
            *_absent(result),
        )
        _legend(axes, [entry for entry, is_drawn in zip(OFFSET_MARKS, drawn, strict=True) if is_drawn])
    limit_um = None if result.recipe is None else result.recipe.limits.true_position_um
    limit = "" if limit_um is None else f", limit {limit_um:g} µm"
    axes.set_title(
        f"Offsets from the ideal grid, {magnification:g} times magnified\nlargest true position {longest:.1f} µm{limit}"
        if known
        else "Offsets from the ideal grid: not measured"
    )


def _height_marks(result: PartResult, known: list[bool]) -> tuple[bool, ...]:
    """Which of `HEIGHT_MARKS` the map of heights needs."""
    balls = list(zip(result.balls, known, strict=True))
    return (
        any(ball.present and is_known and ball.verdict != "fail" for ball, is_known in balls),
        any(ball.present and ball.verdict == "fail" for ball, _ in balls),
        any(ball.present and not is_known for ball, is_known in balls),
        *_absent(result),
    )


def _absent(result: PartResult) -> tuple[bool, ...]:
    """Which kinds of `ABSENT` there are."""
    return tuple(any(not ball.present and ball.verdict == verdict for ball in result.balls) for verdict in ABSENT)


def _legend(axes: Axes, entries: list[tuple[str, dict[str, object]]]) -> None:
    """What marks stand for, below the map on the right, beside the key of the arrows."""
    handles = [Line2D([], [], label=words, **look) for words, look in entries]  # type: ignore[arg-type]
    axes.legend(
        handles=handles,
        loc="upper right",
        bbox_to_anchor=(1.0, -0.09),
        ncols=2,
        fontsize=8,
        frameon=False,
        handletextpad=0.4,
        columnspacing=1.2,
    )


def _key(axes: Axes, magnification: float, longest_um: float) -> None:
    """An arrow of a round length, below the map, with what it stands for."""
    length_um = _round_down(longest_um)
    left, right = axes.get_xlim()
    fraction = length_um * magnification / (right - left)
    axes.annotate(
        "",
        (0.02 + fraction, -0.1),
        (0.02, -0.1),
        xycoords="axes fraction",
        arrowprops={"arrowstyle": "-|>", "color": "black", "linewidth": 1.6, "shrinkA": 0, "shrinkB": 0},
        annotation_clip=False,
    )
    axes.annotate(f"{length_um:g} µm", (0.03 + fraction, -0.1), xycoords="axes fraction", va="center", fontsize=10)


def _reading(value: float, u: float, bias: float) -> str:
    if not math.isfinite(value):
        return "not measured"
    parts = [f"{value:.1f} µm"]
    if math.isfinite(u):
        parts.append(f"U = {2 * u:.1f} µm")
    if math.isfinite(bias):
        parts.append(f"noise bias {bias:.1f} µm")
    return ", ".join(parts)


def _round_down(value: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not above `value`."""
    power = 10.0 ** math.floor(math.log10(value))
    return max(step * power for step in ROUND if step * power <= value * (1.0 + 1e-12))


def _size_um(result: PartResult) -> float:
    return 3.0 * max((ball_radius_um(ball, result) for ball in result.balls), default=1.0)
