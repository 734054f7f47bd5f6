"""Look of the inspection pictures: one meaning a colour, everywhere."""

from __future__ import annotations

import math
from operator import add, sub
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from matplotlib import style as matplotlib_style
from matplotlib.collections import EllipseCollection
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator

from bgars.records.shown import ABSENT, VERDICT_COLORS, counted

if TYPE_CHECKING:
    from collections.abc import Sequence
    from contextlib import AbstractContextManager

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from bgars.records.ball_result import BallResult
    from bgars.records.capture import Capture
    from bgars.records.part_result import PartResult

__all__ = [
    "ABSENT",
    "DASHES",
    "VERDICT_COLORS",
    "add_axes",
    "ball_deviations",
    "ball_place_um",
    "ball_radius_um",
    "discs",
    "figure_style",
    "finite_range",
    "image_extent_um",
    "label_balls",
    "new_figure",
    "part_frame",
    "part_title",
    "part_window",
    "shown_image",
    "window_size_in",
]

DASHES = (0, (3, 2))
DPI = 110
LEAST_SIDE = 0.25
"""Of a picture's shorter side, in the longer one: one row of balls is drawn, too."""
SETTINGS: dict[str, float | bool] = {
    **{"font.size": 10, "axes.titlesize": 11, "axes.labelsize": 10, "legend.fontsize": 9, "legend.frameon": False},
    "axes.titley": 1.0,  # where it is: matplotlib else measures every tick label to place a title
}
SMALLEST_NAME_PT = 5.5
LARGEST_NAME_PT = 11.0
FAILED_NAME = "#FFB27F"
NAME_WIDTH = 0.62
"""Width of a character over its size."""


def figure_style() -> AbstractContextManager[None]:
    """The settings to draw and save under, whatever the user's own are."""
    context: AbstractContextManager[None] = matplotlib_style.context(["default", SETTINGS])
    return context


def new_figure(width_in: float, height_in: float, layout: Literal["constrained"] | None = None) -> Figure:
    """Return an empty white figure; without a layout engine, which draws everything twice, axes have their places."""
    return Figure(figsize=(width_in, height_in), dpi=DPI, layout=layout, facecolor="white")


def add_axes(figure: Figure, left_in: float, bottom_in: float, width_in: float, height_in: float) -> Axes:
    """Add axes at a place of the figure that is given in inches."""
    width, height = (float(side) for side in figure.get_size_inches())
    return figure.add_axes((left_in / width, bottom_in / height, width_in / width, height_in / height))


def discs(axes: Axes, places: Sequence[tuple[float, float]], radii: Sequence[float], **look: Any) -> None:  # noqa: ANN401
    """Circles of one collection: a patch apiece costs ten times as much."""
    if len(places):
        wide = 2.0 * np.asarray(radii)
        circles = EllipseCollection(
            wide, wide, np.zeros(len(wide)), units="xy", offsets=places, offset_transform=axes.transData, **look
        )
        axes.add_collection(circles, autolim=False)


def part_window(
    result: PartResult, extent_um: tuple[float, float, float, float] | None = None, *, margin: float = 1.2
) -> tuple[float, float, float, float]:
    """Left, right, bottom, top of the balls and a margin of so many radii, within the image's extent."""
    left, right, bottom, top = extent_um or (-math.inf, math.inf, -math.inf, math.inf)
    places = [(place, ball_radius_um(ball, result)) for ball in result.balls if (place := ball_place_um(ball))]
    if not places:
        return extent_um or (0.0, 1.0, 0.0, 1.0)
    rim = margin * max(radius for _, radius in places)
    reach = [radius + rim for _, radius in places]
    x, y = ([place[axis] for place, _ in places] for axis in (0, 1))
    return (
        max(left, min(map(sub, x, reach))),
        min(right, max(map(add, x, reach))),
        max(bottom, min(map(sub, y, reach))),
        min(top, max(map(add, y, reach))),
    )


def window_size_in(window: tuple[float, float, float, float], longest_in: float) -> tuple[float, float]:
    """Width and height of a window, true to scale, its longer side of this length."""
    wide, tall = window[1] - window[0], window[3] - window[2]
    scale = longest_in / max(wide, tall, 1e-9)
    return max(wide * scale, LEAST_SIDE * longest_in), max(tall * scale, LEAST_SIDE * longest_in)


def part_title(result: PartResult) -> str:
    """Name and verdict, and how many balls are which."""
    told = ", ".join(counted(result.balls))
    return f"{result.name}: {result.verdict.upper()}   ({told or 'no balls'})"


def shown_image(image: NDArray[np.generic]) -> NDArray[np.float32]:
    """An image, 1 = its 99.5th percentile."""
    values = np.asarray(image, dtype=np.float32)
    dark, top = (float(level) for level in np.percentile(values, [0.5, 99.5]))
    if not top > dark:
        return np.full(values.shape, 0.5, np.float32)
    scaled: NDArray[np.float32] = np.clip((values - dark) / (top - dark), 0.0, 1.0)
    return scaled


def image_extent_um(capture: Capture) -> tuple[float, float, float, float]:
    """Left, right, bottom, top of the image; origin at its centre."""
    rows, cols = capture.mask.shape
    pitch_um = capture.pixel_pitch_um or 1.0
    return (-cols / 2 * pitch_um, cols / 2 * pitch_um, -rows / 2 * pitch_um, rows / 2 * pitch_um)


def ball_place_um(ball: BallResult) -> tuple[float, float] | None:
    """Where a ball is, or should be; None when neither is known."""
    for place in ((ball.x_um, ball.y_um), (ball.x_nominal_um, ball.y_nominal_um)):
        if all(math.isfinite(value) for value in place):
            return place
    return None


def ball_radius_um(ball: BallResult, result: PartResult) -> float:
    """Its radius; where it is missing or was not measured, that of its fellows."""
    if math.isfinite(ball.diameter_um):
        return ball.diameter_um / 2
    known = [other.diameter_um for other in result.balls if math.isfinite(other.diameter_um)]
    if known:
        return float(np.median(known)) / 2
    nominal_um = None if result.recipe is None else result.recipe.diameter_um
    return (nominal_um or 10.0 * result.pixel_pitch_um) / 2


def ball_deviations(result: PartResult) -> tuple[str, list[float]]:
    """What colours the balls: distance below the seating plane, or the height where the part does not stand."""
    seating = [ball.seating_deviation_um for ball in result.balls]
    if any(math.isfinite(value) for value in seating):
        return "apex below the seating plane", seating
    return "height above the local board", [ball.top_um for ball in result.balls]


def part_frame(axes: Axes, window: tuple[float, float, float, float]) -> None:
    """Show a window of the part, to scale, axes in micrometres."""
    axes.set_xlim(window[0], window[1])
    axes.set_ylim(window[2], window[3])
    axes.set_aspect("equal")
    axes.set_xlabel("x (µm)")
    axes.set_ylabel("y (µm)")
    axes.xaxis.set_major_locator(MaxNLocator(6))
    axes.yaxis.set_major_locator(MaxNLocator(6))


def name_size_pt(axes: Axes, result: PartResult, width_in: float) -> float:
    """Size at which the longest name fits on a ball, for axes of this width."""
    left, right = axes.get_xlim()
    radii = [ball_radius_um(ball, result) for ball in result.balls] or [1.0]
    room_pt = 2.0 * float(np.median(radii)) / max(right - left, 1e-9) * width_in * 72.0
    longest = max((len(ball.name) for ball in result.balls), default=2)
    return min(room_pt / (NAME_WIDTH * longest), LARGEST_NAME_PT)


def label_balls(axes: Axes, result: PartResult, width_in: float) -> None:
    """Write the names on the balls, and beside them where they do not fit, then only of balls that fail."""
    size_pt = name_size_pt(axes, result, width_in)
    crowded = size_pt < SMALLEST_NAME_PT
    for ball in result.balls:
        place = ball_place_um(ball)
        failed = ball.verdict == "fail"
        if place is None or (crowded and not failed):
            continue
        if crowded:
            place = (place[0], place[1] + 1.2 * ball_radius_um(ball, result))
        axes.text(
            *place,
            ball.name,
            ha="center",
            va="bottom" if crowded else "center",
            fontsize=SMALLEST_NAME_PT + 1.5 if crowded else size_pt,
            color=FAILED_NAME if failed else "white",
            fontweight="bold" if failed else "normal",
            path_effects=[withStroke(linewidth=1.8, foreground="0.1")],
            clip_on=True,
            zorder=6,
        )


def finite_range(values: list[float]) -> tuple[float, float]:
    """Least and largest finite value, never the same; (0, 1) when there is none."""
    known = [value for value in values if math.isfinite(value)]
    if not known:
        return 0.0, 1.0
    low, high = min(known), max(known)
    return low, high if high > low else low + 1.0
