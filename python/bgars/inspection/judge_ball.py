"""The verdict on one ball: it passes only when it is there, alone, measured, and inside every limit."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bgars.inspection.decision import decide
from bgars.records.part_recipe import BALL_LIMITS

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from bgars.inspection.places import Slot
    from bgars.records.ball_result import Verdict
    from bgars.records.measured_balls import MeasuredBall
    from bgars.records.part_recipe import Limits

__all__ = ["NO_LIMITS", "UNCLEAR", "Position", "judge_ball", "true_position"]

NO_LIMITS = "no limits given"
WORDS = {
    "true_position_um": "true position",
    "diameter_um": "diameter",
    "height_um": "height",
    "aspect_ratio": "aspect ratio",
    "flat_top_depth_um": "flat top",
}
MISSING = "no ball at its place"
UNCLEAR = "something is at its place, but it was not measured"
UNJUDGED = "no ball found, and too few others in view to judge by"
EXTRA = "a ball where none should be"
NOT_MEASURED = "found, but not measured"


@dataclass(frozen=True)
class Position:
    """Distance from the place in the grid, and its standard uncertainty."""

    distance_um: float
    u_um: float


def true_position(off_um: NDArray[np.float64], u_um: NDArray[np.float64]) -> Position:
    """The length of an offset (2,) with the uncertainties (2,) of its parts.

    Examples
    --------
    >>> true_position(np.array([3.0, 4.0]), np.array([0.5, 0.5]))
    Position(distance_um=5.0, u_um=0.5)
    """
    distance_um = math.hypot(*off_um)
    if distance_um > 0:
        return Position(distance_um, math.hypot(*(off_um * u_um)) / distance_um)
    return Position(distance_um, math.hypot(*u_um) / math.sqrt(2.0))


def judge_ball(
    slot: Slot,
    position: Position,
    limits: Limits | None,
    partners: tuple[str, ...] = (),
    doubts: tuple[str, ...] = (),
    *,
    is_seen: bool = True,
) -> tuple[Verdict, tuple[str, ...]]:
    """Judge a ball and say why it does not pass.

    Parameters
    ----------
    slot : Slot
        Place and ball.
    position : Position
        Its true position; NaN where unknown.
    limits : Limits or None
        None or empty: presence is judged, nothing else.
    partners : tuple of str
        Balls that it is joined to.
    doubts : tuple of str
        Of the whole part: with any, no ball passes, and none fails by its numbers.
    is_seen : bool
        False where so few balls were found that what is missing says more of the set-up than of the part.
    """
    if not slot.found:
        return _judge_empty(slot, is_seen=is_seen)
    failed, open_ = [], []
    if slot.kind == "extra":
        failed.append(EXTRA)
    if slot.kind == "bridged" or partners:
        failed.append(f"joined to {', '.join(partners)}" if partners else "joined to a neighbour")
    if slot.measured is None:
        open_.append(NOT_MEASURED)
    else:
        open_ += slot.measured.reasons
        open_ += _holes(slot.measured, limits)
        # Nothing confirms a circle without a shadow: it is no ground to fail a ball on.
        circle_alone = not math.isfinite(slot.measured.top_um)
        if limits and slot.kind != "extra":
            for name, value, u in _readings(slot.measured, position):
                allowed = limits.range_of(name)
                if allowed is None:
                    continue
                verdict, reason = decide(WORDS[name], value, u, allowed, unit="" if name == "aspect_ratio" else "um")
                if verdict == "fail" and (doubts or circle_alone):
                    verdict = "undecided"
                if verdict != "pass":
                    (failed if verdict == "fail" else open_).append(reason)
    if not limits:
        open_.append(NO_LIMITS)
    open_ += doubts
    reasons = tuple(dict.fromkeys([*failed, *open_]))
    if failed:
        return "fail", reasons
    return ("undecided" if open_ else "pass"), reasons


def _judge_empty(slot: Slot, *, is_seen: bool) -> tuple[Verdict, tuple[str, ...]]:
    """A place without a ball: missing only where it is seen to be empty, in a set-up that shows the others."""
    if slot.unclear:
        return "undecided", (UNCLEAR,)
    return ("fail", (MISSING,)) if is_seen else ("undecided", (UNJUDGED,))


def _readings(ball: MeasuredBall, position: Position) -> Iterator[tuple[str, float, float]]:
    pairs = {
        "true_position_um": (position.distance_um, position.u_um),
        "diameter_um": (ball.diameter_um, ball.u_diameter_um),
        "height_um": (ball.top_um, ball.u_top_um),
        "aspect_ratio": (ball.aspect_ratio, ball.u_aspect_ratio),
        "flat_top_depth_um": (ball.flat_top_depth_um, ball.u_flat_top_depth_um),
    }
    for name in BALL_LIMITS:
        yield name, *pairs[name]


def _holes(ball: MeasuredBall, limits: Limits | None) -> Iterator[str]:
    """What was not measured of a ball, limit or not: such a ball never passes."""
    limited = () if limits is None else tuple(name for name in BALL_LIMITS if limits.range_of(name) is not None)
    core = {"position": (ball.x_um, ball.y_um), "diameter_um": (ball.diameter_um,), "height_um": (ball.top_um,)}
    for name, values in core.items():
        if name not in limited and not all(math.isfinite(value) for value in values):
            yield f"{WORDS.get(name, name)} was not measured"
