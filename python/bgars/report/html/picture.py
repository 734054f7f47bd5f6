"""The part picture of the page: where each ball is drawn, in micrometres of a picture whose y goes down."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from bgars.report.color_ramp import hex_of, viridis
from bgars.report.html.words import VERDICT_MARKS, ball_state, is_known, number

if TYPE_CHECKING:
    from bgars.report.html.source import PageSource

__all__ = [
    "COLORS",
    "BallMark",
    "PartPicture",
    "ball_radius",
    "deviations",
    "drawn_places",
    "part_picture",
    "round_down",
]

COLORS = "viridis"
MARGIN = 1.2
SCREEN_PX = 760.0
"""Width of the picture on a desktop, for what fits on a ball."""
LEAST_NAME_PX = 6.0
NAME_WIDTH = 0.62
ROUND = (1.0, 2.0, 5.0)
GRADIENT_STOPS = 9


@dataclass(frozen=True)
class BallMark:
    """A ball of the picture; lengths in um of the picture."""

    index: int
    x: float
    y: float
    radius: float
    color: str
    label: str
    words: str
    classes: str
    missing: bool


@dataclass(frozen=True)
class PartPicture:
    """What the template draws; x right and y down from the picture's top left corner, in um."""

    width: float
    height: float
    left_um: float
    top_um: float
    marks: tuple[BallMark, ...]
    bridges: tuple[tuple[float, float, float, float], ...]
    name_size: float
    scale_um: float
    scale_words: str
    image: tuple[float, float, float, float] | None
    deviation: str
    low: str
    high: str
    gradient: str
    assumed: tuple[str, ...]


def drawn_places(balls: list[dict[str, Any]]) -> list[tuple[float, float] | None]:
    """Where each ball is, or should be; None when neither is known."""
    return [
        next(
            (
                (ball[x], ball[y])
                for x, y in (("x_um", "y_um"), ("x_nominal_um", "y_nominal_um"))
                if is_known(ball[x]) and is_known(ball[y])
            ),
            None,
        )
        for ball in balls
    ]


def ball_radius(result: dict[str, Any]) -> float:
    """Radius of a ball whose own is not known: that of its fellows, else of the recipe."""
    known = [ball["diameter_um"] for ball in result["balls"] if is_known(ball["diameter_um"])]
    nominal = (result["recipe"] or {}).get("diameter_um")
    return float(np.median(known) if known else nominal or 10.0 * (result["pixel_pitch_um"] or 10.0)) / 2


def deviations(result: dict[str, Any]) -> tuple[str, list[float | None]]:
    """What colours the balls: distance below the seating plane, or the height where the part does not stand."""
    seating = [ball["seating_deviation_um"] for ball in result["balls"]]
    if any(map(is_known, seating)):
        return "apex below the seating plane", seating
    return "height above the board", [ball["top_um"] for ball in result["balls"]]


def round_down(value: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not above `value`."""
    power = 10.0 ** math.floor(math.log10(value))
    return max(step * power for step in ROUND if step * power <= value * (1.0 + 1e-12))


def part_picture(source: PageSource) -> PartPicture | None:
    """Lay the picture out; None when no ball has a place."""
    result, balls = source.result, source.result["balls"]
    places = drawn_places(balls)
    common_um = ball_radius(result)
    radii = [ball["diameter_um"] / 2 if (ball["diameter_um"] or 0.0) > 0 else common_um for ball in balls]
    known = [(place, radius) for place, radius in zip(places, radii, strict=True) if place]
    if not known:
        return None
    x, y, r = np.array([(*place, radius) for place, radius in known]).T
    rim = MARGIN * float(r.max())
    left, right, bottom, top = min(x - r) - rim, max(x + r) + rim, min(y - r) - rim, max(y + r) + rim
    shot = source.photograph
    if shot is not None:
        left, right = max(left, shot.left_um), min(right, shot.right_um)
        bottom, top = max(bottom, shot.bottom_um), min(top, shot.top_um)
    if not (right > left and top > bottom):
        return None
    width, height = float(right - left), float(top - bottom)
    name, values = deviations(result)
    shown = [value for value in values if is_known(value)]
    low, high = (min(shown), max(shown)) if shown else (0.0, 1.0)
    longest = max((len(ball["name"]) for ball in balls), default=2)
    name_size = 2.0 * float(np.median(r)) * 0.9 / (NAME_WIDTH * max(longest, 2))
    crowded = name_size / width * SCREEN_PX < LEAST_NAME_PX
    marks = []
    for index, (ball, place, radius, value) in enumerate(zip(balls, places, radii, values, strict=True)):
        if place is None:
            continue
        color = hex_of(viridis((value - low) / max(high - low, 1e-9))) if is_known(value) else ""
        state = ball_state(ball)
        assumed = state not in {"missing", "unclear"} and not is_known(ball["diameter_um"])
        marks.append(
            BallMark(
                index,
                round(place[0] - left, 2),
                round(top - place[1], 2),
                round(radius, 2),
                color,
                "" if crowded and ball["verdict"] == "pass" else ball["name"],
                _words(ball, name, value, state),
                f"{ball['verdict']} {state}" + (" assumed" if assumed else ""),
                state == "missing",
            )
        )
    ends = {ball["name"]: place for ball, place in zip(balls, places, strict=True) if place}
    bridges = [
        (ends[one][0] - left, top - ends[one][1], ends[two][0] - left, top - ends[two][1])
        for one, two in result["bridges"]
        if one in ends and two in ends
    ]
    scale_um = round_down(width / 5)
    steps = [hex_of(viridis(step / (GRADIENT_STOPS - 1))) for step in range(GRADIENT_STOPS)]
    return PartPicture(
        width,
        height,
        float(left),
        float(top),
        tuple(marks),
        tuple(bridges),
        min(name_size, 0.55 * float(np.median(r))) if not crowded else LEAST_NAME_PX * 1.3 / SCREEN_PX * width,
        scale_um,
        f"{scale_um / 1000:g} mm" if scale_um >= 1000 else f"{scale_um:g} µm",  # noqa: PLR2004 - um in a mm
        None
        if shot is None
        else (shot.left_um - left, top - shot.top_um, shot.right_um - shot.left_um, shot.top_um - shot.bottom_um),
        name if shown else "",
        number(low),
        number(high),
        f"linear-gradient(90deg, {', '.join(steps)})",
        tuple(ball["name"] for ball in balls if ball["present"] and not is_known(ball["diameter_um"])),
    )


def _words(ball: dict[str, Any], name: str, value: float | None, state: str) -> str:
    told = f"{ball['name']} {VERDICT_MARKS[ball['verdict']]} {ball['verdict']}"
    if state != "ball":
        told += f", {state}"
    if is_known(value):
        told += f"; {name} {number(value)} µm"
    return "; ".join([told, *ball["reasons"]])
