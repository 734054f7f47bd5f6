"""Look of the inspection pictures: one meaning a colour, everywhere."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from matplotlib import style as matplotlib_style
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

if TYPE_CHECKING:
    from contextlib import AbstractContextManager
    from pathlib import Path

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from bgars.part_result import BallResult, PartResult
    from bgars.records import Capture

__all__ = [
    "VERDICT_COLORS",
    "ball_place_um",
    "ball_radius_um",
    "figure_style",
    "finite_range",
    "image_extent_um",
    "label_balls",
    "new_figure",
    "part_frame",
    "part_title",
    "save",
    "shown_image",
]

VERDICT_COLORS = {"pass": "#56B4E9", "fail": "#D55E00", "undecided": "#E69F00"}
"""Okabe and Ito, Color universal design, 2008: told apart by colour-blind readers."""
DPI = 110
MAX_PICTURE_PX = 1600
SETTINGS = {"font.size": 10, "axes.titlesize": 11, "axes.labelsize": 10, "legend.fontsize": 9, "legend.frameon": False}
SMALLEST_NAME_PT = 5.5
LARGEST_NAME_PT = 11.0
NAME_WIDTH = 0.62
"""Width of a character over its size."""


def figure_style() -> AbstractContextManager[None]:
    """The settings to draw and save under, whatever the user's own are."""
    context: AbstractContextManager[None] = matplotlib_style.context(["default", SETTINGS])
    return context


def new_figure(width_in: float, height_in: float) -> Figure:
    """Return an empty white figure, laid out by constraints."""
    return Figure(figsize=(width_in, height_in), dpi=DPI, layout="constrained", facecolor="white")


def save(figure: Figure, path: Path) -> None:
    """Write a PNG without the traces of the software that made it: the same figure, the same file."""
    figure.savefig(path, format="png", metadata={"Software": None}, pil_kwargs={"optimize": True})


def part_title(result: PartResult) -> str:
    """Name and verdict, and how many balls are which."""
    counts = {verdict: sum(ball.verdict == verdict for ball in result.balls) for verdict in VERDICT_COLORS}
    told = ", ".join(f"{count} {verdict}" for verdict, count in counts.items() if count)
    return f"{result.name}: {result.verdict.upper()}   ({told or 'no balls'})"


def shown_image(capture: Capture, image: NDArray[np.generic]) -> NDArray[np.float32]:
    """An image thinned to a drawable size, 1 = its 99.5th percentile."""
    step = max(1, math.ceil(max(capture.mask.shape) / MAX_PICTURE_PX))
    values = np.asarray(image[::step, ::step], dtype=np.float32)
    dark = float(np.percentile(values, 0.5))
    top = float(np.percentile(values, 99.5))
    scaled: NDArray[np.float32] = np.clip((values - dark) / max(top - dark, 1e-9), 0.0, 1.0)
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


def part_frame(axes: Axes, result: PartResult, *, margin: float = 1.2) -> None:
    """Show the balls and a margin of so many radii, to scale, with axes in micrometres."""
    places = [(place, ball_radius_um(ball, result)) for ball in result.balls if (place := ball_place_um(ball))]
    if places:
        rim = margin * max(radius for _, radius in places)
        x = [place[0] for place, _ in places]
        y = [place[1] for place, _ in places]
        reach = [radius + rim for _, radius in places]
        axes.set_xlim(min(map(float.__sub__, x, reach)), max(map(float.__add__, x, reach)))
        axes.set_ylim(min(map(float.__sub__, y, reach)), max(map(float.__add__, y, reach)))
    axes.set_aspect("equal")
    axes.set_xlabel("x (µm)")
    axes.set_ylabel("y (µm)")
    axes.xaxis.set_major_locator(MaxNLocator(6))
    axes.yaxis.set_major_locator(MaxNLocator(6))


def name_size_pt(axes: Axes, result: PartResult, width_in: float) -> float:
    """Size at which the longest name fits between neighbours, for axes of this width."""
    left, right = axes.get_xlim()
    pitch_um = result.pitch_um if math.isfinite(result.pitch_um) else _nearest_um(result)
    room_pt = pitch_um / max(right - left, 1e-9) * width_in * 72.0
    longest = max((len(ball.name) for ball in result.balls), default=2)
    return min(0.9 * room_pt / (NAME_WIDTH * longest), LARGEST_NAME_PT)


def label_balls(axes: Axes, result: PartResult, width_in: float, *, color: str = "white") -> None:
    """Write the names; where they would run into each other, only of balls that do not pass, or fail."""
    size_pt = name_size_pt(axes, result, width_in)
    for ball in result.balls:
        place = ball_place_um(ball)
        crowded = size_pt < SMALLEST_NAME_PT
        if place is None or (crowded and ball.verdict != "fail"):
            continue
        marked = ball.verdict == "fail"
        axes.annotate(
            ball.name,
            place,
            ha="center",
            va="center",
            fontsize=max(size_pt, 7.0 if marked else SMALLEST_NAME_PT),
            color="white" if marked else color,
            fontweight="bold" if marked else "normal",
            bbox={"boxstyle": "round,pad=0.12", "facecolor": VERDICT_COLORS["fail"], "edgecolor": "none"}
            if marked
            else None,
            annotation_clip=True,
            zorder=6,
        )


def finite_range(values: list[float]) -> tuple[float, float]:
    """Least and largest finite value, never the same; (0, 1) when there is none."""
    known = [value for value in values if math.isfinite(value)]
    if not known:
        return 0.0, 1.0
    low, high = min(known), max(known)
    return low, high if high > low else low + 1.0


def _nearest_um(result: PartResult) -> float:
    """Median distance to the nearest neighbour."""
    places = np.array([place for ball in result.balls if (place := ball_place_um(ball))]).reshape(-1, 2)
    if len(places) < 2:  # noqa: PLR2004 - a pair
        return 4.0 * ball_radius_um(result.balls[0], result) if result.balls else 1.0
    nearest = []
    for index in range(len(places)):
        distances = np.hypot(*(places - places[index]).T)
        distances[index] = np.inf
        nearest.append(float(distances.min()))
    return float(np.median(nearest))
