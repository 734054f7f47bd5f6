"""The quantities of the whole part against their limits, and the reasons in words."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from bgars.files.counted import counted
from bgars.inspection.decision import decide
from bgars.inspection.judge_ball import NO_LIMITS, UNCLEAR
from bgars.records.ball_result import BallResult
from bgars.records.part_check import PartCheck

if TYPE_CHECKING:
    from bgars.inspection.coplanarity import Coplanarity
    from bgars.records.part_recipe import Limits

__all__ = ["part_checks", "part_reasons"]

MAX_NAMES = 8
MAX_TOLD = 4
"""Balls that are named with their reasons."""
OUTSIDE = "is outside its limits"
"""What :mod:`bgars.inspection.decision` says of a reading that fails."""
HOW_TO_LIMIT = f"{NO_LIMITS}: for a verdict, give a recipe with a [limits] table"
LOOK_AT = (
    "this cannot be judged; check the order of lights and images (mirrored, counted clockwise), the exposure, "
    "pixel_pitch_um and pitch_um, and the mask"
)
FALLS = "the part does not stand: its centre of gravity is outside its balls"
FEW = "it takes three balls that are not in one line"
WORDS = {
    "pitch_um": "pitch",
    "seating_coplanarity_um": "seating coplanarity",
    "regression_coplanarity_um": "regression coplanarity",
    "warpage_um": "warpage",
}


def part_checks(
    coplanarity: Coplanarity,
    pitch_um: tuple[float, float],
    warpage_um: tuple[float, float],
    limits: Limits | None,
    *,
    unmeasured: list[str],
) -> tuple[PartCheck, ...]:
    """Judge pitch, both coplanarities and warpage.

    Parameters
    ----------
    coplanarity : Coplanarity
    pitch_um, warpage_um : (float, float)
        Reading and standard uncertainty.
    limits : Limits or None
    unmeasured : list of str
        Balls without an apex: a coplanarity without them proves nothing.
    """
    readings = {
        "pitch_um": (*pitch_um, 0.0),
        "seating_coplanarity_um": (coplanarity.seating_um, coplanarity.u_seating_um, coplanarity.seating_bias_um),
        "regression_coplanarity_um": (
            coplanarity.regression_um,
            coplanarity.u_regression_um,
            coplanarity.regression_bias_um,
        ),
        "warpage_um": (*warpage_um, 0.0),
    }
    checks = []
    for name, (value, u, bias) in readings.items():
        allowed = limits.range_of(name) if limits else None
        if allowed is None:
            checks.append(PartCheck(name, value, u, bias, None, None, None, ""))
            continue
        verdict, reason = decide(WORDS[name], value, u, allowed, bias=bias)
        if "coplanarity" in name and math.isnan(value):
            reason += f"; {FALLS if coplanarity.regression is not None else FEW}"
        if "coplanarity" in name and unmeasured:
            verdict = "undecided"
            limit = f"{value:.1f} um (at most {allowed[1]:g} um) " if math.isfinite(value) else ""
            reason = f"{WORDS[name]} {limit}cannot be judged, as balls were not measured: {_listed(unmeasured)}"
        checks.append(PartCheck(name, value, u, bias, *allowed, verdict, reason))
    return tuple(checks)


def part_reasons(
    balls: list[BallResult],
    checks: tuple[PartCheck, ...],
    bridges: tuple[tuple[str, str], ...],
    *,
    has_limits: bool,
    is_seen: bool,
    doubts: tuple[str, ...] = (),
) -> tuple[str, ...]:
    """Say why a part does not pass, the worst first; empty for one that does.

    `doubts` of the whole part stand for themselves, not once for each ball. `is_seen`: whether most of the balls were
    found; otherwise what is missing is a question to the set-up.
    """
    reasons = []
    missing = [ball.name for ball in balls if not ball.present and ball.verdict == "fail"]
    unclear = [ball.name for ball in balls if not ball.present and UNCLEAR in ball.reasons]
    if not is_seen:
        count = sum(ball.present for ball in balls)
        seen = "no ball was found" if count == 0 else f"only {counted(count, 'ball')} of {len(balls)} were found"
        reasons.append(f"{seen}: {LOOK_AT}")
    extra = [ball.name for ball in balls if ball.kind == "extra"]
    failing = [ball for ball in balls if ball.verdict == "fail" and ball.present and ball.kind == "ball"]
    if missing:
        reasons.append(f"{counted(len(missing), 'ball')} missing: {_listed(missing)}")
    if unclear:
        reasons.append(f"{counted(len(unclear), 'place')} not clear, neither ball nor empty: {_listed(unclear)}")
    if extra:
        reasons.append(f"{counted(len(extra), 'ball')} where none should be: {_listed(extra)}")
    joined = {name for pair in bridges for name in pair}
    lone = [ball.name for ball in balls if ball.kind == "bridged" and ball.name not in joined]
    pairs = [f"{one}-{two}" for one, two in bridges] + lone
    if pairs:
        reasons.append(f"bridged: {_listed(pairs)}")
    if failing:
        worst = [f"{ball.name} ({_broken(ball)})" for ball in failing]
        reasons.append(f"{counted(len(failing), 'ball')} outside limits: {_listed(worst, ';', MAX_TOLD)}")
    reasons += [check.reason for check in checks if check.verdict == "fail"]
    why = []
    for ball in balls:
        own = [reason for reason in ball.reasons if reason not in (NO_LIMITS, *doubts)]
        if ball.present and ball.verdict == "undecided" and own:
            why.append(f"{ball.name} ({own[0]})")
    if why:
        # Without limits every ball is undecided: these are in doubt besides.
        state = "undecided" if has_limits else "in doubt"
        reasons.append(f"{counted(len(why), 'ball')} {state}: {_listed(why, ';', MAX_TOLD)}")
    reasons += [check.reason for check in checks if check.verdict == "undecided"]
    if not has_limits:
        reasons.append(HOW_TO_LIMIT)
    return tuple(reasons)


def _broken(ball: BallResult) -> str:
    """Why a ball fails: its first reason, and the readings of every other limit that it is outside of."""
    others = [reason.partition(f" {OUTSIDE}")[0] for reason in ball.reasons[1:] if OUTSIDE in reason]
    return f"{ball.reasons[0]}, also {' and '.join(others)}" if others else ball.reasons[0]


def _listed(names: list[str], separator: str = ",", most: int = MAX_NAMES) -> str:
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return f"{separator} ".join(names[:most]) + more
