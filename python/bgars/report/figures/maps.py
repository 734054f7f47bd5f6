"""Maps of the deviations: height below the seating plane, and where balls are off their places."""

from __future__ import annotations

import math
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
    label_balls,
    new_figure,
    part_frame,
    part_window,
    window_size_in,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bgars.records.part_result import PartResult

__all__ = ["deviation_figure"]

SIDE_IN = 6.4
LEFT_IN, BETWEEN_IN, BELOW_IN, ABOVE_IN, LEAST_WIDTH_IN = 0.95, 2.3, 1.25, 0.6, 4.6
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
    window = part_window(result)
    wide_in, tall_in = window_size_in(window, SIDE_IN)
    wide_in = max(wide_in, LEAST_WIDTH_IN)
    figure = new_figure(LEFT_IN + wide_in + BETWEEN_IN + wide_in + 0.3, BELOW_IN + tall_in + ABOVE_IN)
    left = add_axes(figure, LEFT_IN, BELOW_IN, wide_in, tall_in)
    right = add_axes(figure, LEFT_IN + wide_in + BETWEEN_IN, BELOW_IN, wide_in, tall_in)
    bar = add_axes(figure, LEFT_IN + wide_in + 0.25, BELOW_IN + 0.1 * tall_in, 0.28, 0.8 * tall_in)
    _heights(figure, left, bar, result)
    _offsets(right, result)
    return figure


def _heights(figure: Figure, axes: Axes, bar: Axes, result: PartResult) -> None:
    name, values = ball_deviations(result)
    norm, colors = Normalize(*finite_range(values)), colormaps[COLORS]
    drawn = [(place, ball, value) for ball, value in zip(result.balls, values, strict=True)
             if (place := ball_place_um(ball)) is not None]  # fmt: skip
    for present, dashes in ((True, "-"), (False, DASHES)):
        these = [each for each in drawn if each[1].present == present]
        marked = [ball.verdict == "fail" or not present for _, ball, _ in these]
        discs(
            axes,
            [place for place, _, _ in these],
            [ball_radius_um(ball, result) for _, ball, _ in these],
            facecolors=[colors(norm(value)) if math.isfinite(value) else "white" for *_, value in these],
            edgecolors=[
                VERDICT_COLORS[ball.verdict] if is_marked else "0.3"
                for is_marked, (_, ball, _) in zip(marked, these, strict=True)
            ],
            linewidths=[1.8 if is_marked else 0.8 for is_marked in marked],
            linestyles=dashes,
        )
    seats = " / ".join(", ".join(seat.balls[:6]) for seat in result.seatings[:2])
    reading = _reading(result.seating_coplanarity_um, result.u_seating_coplanarity_um, result.seating_noise_bias_um)
    rests = f"rests on {seats}" if seats else "no seating plane"
    axes.set_title(f"{name[0].upper()}{name[1:]} ({rests})\nseating coplanarity {reading}")
    window = part_window(result)
    part_frame(axes, window)
    label_balls(axes, result, window_size_in(window, SIDE_IN)[0])
    has_height = [math.isfinite(value) for value in values]
    _legend(
        axes,
        [entry for entry, is_drawn in zip(HEIGHT_MARKS, _height_marks(result, has_height), strict=True) if is_drawn],
    )
    if any(math.isfinite(value) for value in values):
        figure.colorbar(ScalarMappable(norm, COLORS), cax=bar, label=f"{name} (µm)")
    else:
        bar.set_visible(False)


def _offsets(axes: Axes, result: PartResult) -> None:
    known = [ball for ball in result.balls if math.isfinite(ball.true_position_um)]
    places = np.array([(ball.x_nominal_um, ball.y_nominal_um) for ball in known]).reshape(-1, 2)
    centres = np.array([(ball.x_um, ball.y_um) for ball in known]).reshape(-1, 2)
    offsets = centres - places
    longest = float(np.hypot(*offsets.T).max(initial=0.0))
    pitch_um = result.pitch_um if math.isfinite(result.pitch_um) else _size_um(result)
    magnification = _round_down(LONGEST_ARROW * pitch_um / longest) if longest > 0 else 1.0
    for present, dashes in ((True, "-"), (False, DASHES)):
        drawn = [(place, ball) for ball in result.balls if ball.present == present and (place := ball_place_um(ball))]
        discs(
            axes,
            [place for place, _ in drawn],
            [ball_radius_um(ball, result) for _, ball in drawn],
            facecolors="0.93",
            edgecolors="0.75" if present else [VERDICT_COLORS[ball.verdict] for _, ball in drawn],
            linestyles=dashes,
        )
    part_frame(axes, part_window(result))
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
        marks = (
            any(ball.verdict != "fail" for ball in known),
            any(ball.verdict == "fail" for ball in known),
            *_absent(result),
        )
        _legend(axes, [entry for entry, is_drawn in zip(OFFSET_MARKS, marks, strict=True) if is_drawn])
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
