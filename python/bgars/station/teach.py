"""A part recipe from golden parts: layout, nominal sizes, and limits by a stated rule."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bgars.errors import CalibrationError, InputError
from bgars.records.ball_names import ball_name
from bgars.station.golden import FLOOR_SHARE, SIGMAS, limits_of, odd_empty_places, unlike_their_fellows

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bgars.records.part_result import PartResult

__all__ = ["Taught", "compact_names", "teach", "teach_text"]

POSITION_SHARE = 0.1
"""Limit of true position, of the pitch, where the golden balls keep it with room."""
MOST_NAMES = 6
"""Places and doubts that a message names."""


@dataclass(frozen=True)
class Taught:
    """What golden parts say; lengths in micrometres."""

    name: str
    rows: int
    cols: int
    pitch_um: float
    depopulated: tuple[str, ...]
    diameter_um: float
    height_um: float
    limits: dict[str, float | tuple[float, float]]
    parts: int
    doubts: tuple[str, ...] = ()


def teach(results: Sequence[PartResult], name: str, *, accept_doubts: bool = False) -> Taught:
    """Learn a recipe from inspections of golden parts without a recipe.

    The rule: nominal = median over all balls of all parts; limits = nominal +- the larger of 4 sqrt(s^2 + u^2) and 5 %
    of it, with s the robust spread of the balls and u their median standard uncertainty. True position, coplanarity and
    warpage: the largest golden reading plus 4 u, true position at least a tenth of the pitch.

    A ball that these limits do not hold, that is off its place, missing where the layout's symmetry has one, or in
    doubt by its inspection, is no model: such parts are refused unless `accept_doubts`.

    Raises
    ------
    InputError
        No part, or parts whose layouts differ.
    CalibrationError
        Fewer than 4 balls measured, or parts in doubt.
    """
    if not results:
        msg = "GOLDEN: must be one part or more, got none"
        raise InputError(msg)
    layouts = [_layout(result) for result in results]
    for result, layout in zip(results, layouts, strict=True):
        if layout != layouts[0]:
            differ = [ball_name(row, col) for row, col in sorted(layout ^ layouts[0])]
            shown = ", ".join(differ[:MOST_NAMES]) + (", ..." if len(differ) > MOST_NAMES else "")
            msg = (
                f"{result.name}: {len(layout)} balls on other places than {results[0].name} "
                f"({len(layouts[0])}): {shown}: not the same part, or one of them is not good"
            )
            raise InputError(msg)
    places = layouts[0]
    rows, cols = max(row for row, _ in places) + 1, max(col for _, col in places) + 1
    doubts = unlike_their_fellows(results)
    if len(results) == 1:
        # Of two parts neither has lost the ball of the same place by accident.
        odd = odd_empty_places(places, rows, cols)
        doubts += [f"{place}: no ball, though its mirror images in the layout have one" for place in odd]
    if doubts and not accept_doubts:
        shown = "; ".join(doubts[:MOST_NAMES]) + (
            f"; and {len(doubts) - MOST_NAMES} more" if doubts[MOST_NAMES:] else ""
        )
        parts, advice = ("a part", "give two parts or more") if len(results) == 1 else ("parts", "leave those out")
        msg = f"{results[0].name}: {parts} in doubt: {shown}; {advice}, or --accept-doubts if they are good"
        raise CalibrationError(msg)
    empty = tuple(ball_name(row, col) for row in range(rows) for col in range(cols) if (row, col) not in places)
    balls = [ball for result in results for ball in result.balls if ball.present]
    diameter, diameter_range = _range([ball.diameter_um for ball in balls], [ball.u_diameter_um for ball in balls])
    height, height_range = _range([ball.top_um for ball in balls], [ball.u_top_um for ball in balls])
    pitches = np.array([result.pitch_um for result in results])
    pitch = float(np.median(pitches[np.isfinite(pitches)])) if np.isfinite(pitches).any() else math.nan
    if not math.isfinite(pitch):
        msg = f"{results[0].name}: no pitch was measured"
        raise CalibrationError(msg)
    limits: dict[str, float | tuple[float, float]] = {"diameter_um": diameter_range, "height_um": height_range}
    off = _most([ball.true_position_um for ball in balls], [ball.u_true_position_um for ball in balls])
    if off is not None:
        limits["true_position_um"] = max(off, POSITION_SHARE * pitch)
    for key in ("seating_coplanarity_um", "regression_coplanarity_um", "warpage_um"):
        most = _most([getattr(result, key) for result in results], [getattr(result, f"u_{key}") for result in results])
        if most is not None:
            limits[key] = most
    return Taught(name, rows, cols, pitch, empty, diameter, height, limits, len(results), tuple(doubts))


def teach_text(taught: Taught) -> str:
    """Return the recipe as the text of a ``part.toml``."""
    lines = [
        f"# Golden parts: {taught.parts}; nominal = median; limits = nominal +- the larger of 4 sqrt(s^2 + u^2)",
        f"# and {100 * FLOOR_SHARE:.0f} %; position, coplanarity and warpage: the largest golden reading + 4 u, "
        f"position {100 * POSITION_SHARE:.0f} % of the",
        "# pitch at least. Put the drawing's limits here.",
        *(f"# Accepted although in doubt: {words}" for words in taught.doubts),
        f"name = {json.dumps(taught.name)}",
        f"rows = {taught.rows}",
        f"cols = {taught.cols}",
        f"pitch_um = {taught.pitch_um:.1f}",
    ]
    if taught.depopulated:
        lines.append(f"depopulated = {json.dumps(compact_names(taught.depopulated, taught.rows, taught.cols))}")
    lines += [f"diameter_um = {taught.diameter_um:.1f}", f"height_um = {taught.height_um:.1f}", "", "[limits]"]
    for key, value in taught.limits.items():
        shown = f"[{value[0]:.1f}, {value[1]:.1f}]" if isinstance(value, tuple) else f"{value:.1f}"
        lines.append(f"{key} = {shown}")
    return "\n".join(lines) + "\n"


def compact_names(names: Sequence[str], rows: int, cols: int) -> list[str]:
    """Write names of places as ranges where they fill rectangles.

    Examples
    --------
    >>> compact_names(["B2", "B3", "C2", "C3", "A1"], 4, 4)
    ['A1', 'B2:C3']
    """
    left = {(row, col) for row in range(rows) for col in range(cols) if ball_name(row, col) in set(names)}
    found = []
    while left:
        row, col = min(left)
        width = 1
        while (row, col + width) in left:
            width += 1
        height = 1
        while all((row + height, col + step) in left for step in range(width)):
            height += 1
        left -= {(row + down, col + step) for down in range(height) for step in range(width)}
        first, last = ball_name(row, col), ball_name(row + height - 1, col + width - 1)
        found.append(first if first == last else f"{first}:{last}")
    return found


def _layout(result: PartResult) -> set[tuple[int, int]]:
    places = {
        (ball.row, ball.col) for ball in result.balls if ball.present and ball.row is not None and ball.col is not None
    }
    if len(places) < 4:  # noqa: PLR2004 - a grid and its spread
        msg = f"{result.name}: {len(places)} balls on a grid, 4 are needed"
        raise CalibrationError(msg)
    top, left = min(row for row, _ in places), min(col for _, col in places)
    return {(row - top, col - left) for row, col in places}


def _range(values: list[float], us: list[float]) -> tuple[float, tuple[float, float]]:
    count = sum(math.isfinite(value) for value in values)
    if count < 4:  # noqa: PLR2004
        msg = f"only {count} balls were measured, 4 are needed"
        raise CalibrationError(msg)
    nominal, half = limits_of(values, us)
    return nominal, (max(nominal - half, 0.0), nominal + half)


def _most(values: list[float], us: list[float]) -> float | None:
    known = [
        (value, u)
        for value, u in zip(values, us, strict=True)
        if value is not None and math.isfinite(value) and math.isfinite(u)
    ]
    return max((value + SIGMAS * u for value, u in known), default=None)
