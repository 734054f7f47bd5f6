"""Whether parts are good enough to learn from: balls unlike their fellows, empty places that nothing explains."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bgars.records.ball_names import ball_name

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bgars.records.ball_result import BallResult
    from bgars.records.part_result import PartResult

__all__ = ["FLOOR_SHARE", "SIGMAS", "limits_of", "odd_empty_places", "unlike_their_fellows"]

Array = NDArray[np.float64]

SIGMAS = 4.0
"""Limits lie so many standard deviations of the golden balls, and of their uncertainty, from the nominal value."""
FLOOR_SHARE = 0.05
"""And no closer than this share of it; of the pitch where positions are compared."""
RADIAL_SIGMAS = 4.4
"""A distance from a place (Rayleigh) exceeds this as seldom as a normal number exceeds `SIGMAS`: once in 16,000."""
SIZES = {"diameter": "diameter_um", "height": "top_um"}
"""What is compared between balls."""
LEAST_BALLS = 4
"""Of a grid that shows which ball is off."""
ROUNDS = 30
"""Of reweighting."""
MEDIAN_OF_RAYLEIGH = 1.1774
"""Median of such distances, of the standard deviation on either axis."""


def limits_of(values_um: Sequence[float], us_um: Sequence[float]) -> tuple[float, float]:
    """Return the nominal value of balls that are alike, and how far a good one may be from it.

    Median; the larger of 4 sqrt(s^2 + u^2) and 5 % of it, with s the robust spread and u the median uncertainty: one
    ball that is not good moves none of them much.
    """
    known = np.array([value for value in values_um if math.isfinite(value)])
    us = np.array([u for u in us_um if math.isfinite(u)])
    nominal = float(np.median(known))
    spread = 1.4826 * float(np.median(np.abs(known - nominal)))
    u = float(np.median(us)) if len(us) else 0.0
    return nominal, max(SIGMAS * math.hypot(spread, u), FLOOR_SHARE * nominal)


def unlike_their_fellows(results: Sequence[PartResult]) -> list[str]:
    """Name each ball that the limits taught by all balls together do not hold, or that its inspection doubts."""
    balls = [ball for result in results for ball in result.balls if ball.present]
    limits = {
        words: (key, limits_of([getattr(one, key) for one in balls], [getattr(one, f"u_{key}") for one in balls]))
        for words, key in SIZES.items()
    }
    found = []
    for result in results:
        odd = {ball.name: _odd_sizes(ball, limits) for ball in result.balls if ball.present}
        for ball in result.balls:
            if ball.present:
                # Only a recipe has limits: that none are given is no fault of the ball.
                odd[ball.name] += [reason for reason in ball.reasons if not reason.startswith("no limits")]
        for name, words in _off_place(result).items():
            odd[name].append(words)
        said = [f"{name}: {', '.join(reasons)}" for name, reasons in odd.items() if reasons]
        found += [f"{result.name}: {words}" if len(results) > 1 else words for words in said]
    return found


def odd_empty_places(places: set[tuple[int, int]], rows: int, cols: int) -> list[str]:
    """Name empty places (row, column) without a mirror image that is empty, too: layouts are symmetric, accidents not.

    Examples
    --------
    >>> full = {(row, col) for row in range(3) for col in range(4)}
    >>> odd_empty_places(full - {(1, 1), (1, 2), (0, 3)}, 3, 4)
    ['A4']
    """
    odd = []
    for row in range(rows):
        for col in range(cols):
            mirrored = {(rows - 1 - row, col), (row, cols - 1 - col), (rows - 1 - row, cols - 1 - col)} - {(row, col)}
            if not mirrored:
                # The middle of an odd grid is empty with what is around it.
                mirrored = {(min(row + 1, rows - 1), col), (row, min(col + 1, cols - 1))} - {(row, col)}
            if (row, col) not in places and mirrored <= places:
                odd.append(ball_name(row, col))
    return odd


def _odd_sizes(ball: BallResult, limits: dict[str, tuple[str, tuple[float, float]]]) -> list[str]:
    found = []
    for words, (key, (nominal, room)) in limits.items():
        value = getattr(ball, key)
        if not math.isfinite(value):
            found.append(f"its {words} was not measured")
            continue
        if abs(value - nominal) > room:
            found.append(f"its {words} of {value:.1f} um is unlike that of the others ({nominal:.1f} +- {room:.1f} um)")
    return found


def _off_place(result: PartResult) -> dict[str, str]:
    """Of balls farther from their places in the part's own grid than scatter explains: how far."""
    known = [ball for ball in result.balls if ball.present and ball.row is not None and math.isfinite(ball.x_um)]
    if len(known) < LEAST_BALLS or not math.isfinite(result.pitch_um):
        return {}
    off_um = _off_grid(known)
    # Two unknowns of a place and two of a turn and a pitch are fitted to two numbers a ball.
    spare = 1.0 - 2.0 / len(known)
    usual = float(np.median(off_um)) / MEDIAN_OF_RAYLEIGH / math.sqrt(spare)
    limit = max(RADIAL_SIGMAS * usual, FLOOR_SHARE * result.pitch_um)
    return {
        ball.name: f"it is {off:.1f} um off its place in the grid (scatter explains {limit:.1f} um)"
        for ball, off in zip(known, off_um, strict=True)
        if off > limit
    }


def _off_grid(balls: Sequence[BallResult]) -> Array:
    """Distances (N,) from a square grid that one ball does not draw: the least sum of distances, not of squares."""
    seen = np.array([complex(ball.x_um, ball.y_um) for ball in balls])
    place = np.array([complex(ball.col or 0, -(ball.row or 0)) for ball in balls])
    grid = np.column_stack([np.ones_like(place), place])
    off = np.ones(len(balls))
    for _ in range(ROUNDS):
        root = 1.0 / np.sqrt(np.maximum(off, 1e-3 * off.max() + 1e-9))
        law, *_ = np.linalg.lstsq(grid * root[:, None], seen * root, rcond=None)
        off = np.abs(seen - grid @ law)
    return off
