"""How strong the lights are: by highlights or shading of the balls, else by the board that the balls rest on."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bgars.records.remark import Remark
from bgars.station.board_strengths import MATT, board_strengths

if TYPE_CHECKING:
    from bgars.records.capture import Capture
    from bgars.station.light_bundle import LightSolution
    from bgars.station.observe import Observed

__all__ = ["Strengths", "repeatable", "strengths_of"]

Array = NDArray[np.float64]

LEAST_U = 0.002
SHADING_U, HIGHLIGHT_U = 0.01, 0.03
"""Relative standard uncertainties by a single ball: alike on all balls, and what each scatters by at least."""
OWN_SIGMAS = 2.0
"""Scatter of one light, of that of all, from which on it counts by itself: a few balls show less by chance."""


class Strengths(NamedTuple):
    """Relative strengths, mean 1, their uncertainties, and the level that they are relative to."""

    relative: Array
    u: Array | None
    """None where nothing was measured: `relative` is 1 then."""
    level: float
    """Mean over the lights, in the unit of what `by` names; NaN where nothing was measured."""
    by: str
    """highlights, shading, board; empty where nothing was measured."""


def strengths_of(
    sphere: str, captures: list[Capture], seen: Observed, solution: LightSolution, findings: list[Remark]
) -> Strengths:
    """Strengths of the lights; what they are taken from is added to the findings, where it is not the balls."""
    usable = [
        row * _farther(circle, solution)
        for row, circle in zip(seen.strengths, solution.outlines_px, strict=True)
        if np.isfinite(row).all() and (row > 0).all()
    ]
    if usable:
        alike, least = (SHADING_U, 0.0) if sphere == "matt" else (0.0, HIGHLIGHT_U)
        relative, u = _mean(usable, [np.full(len(row), alike) for row in usable], least)
        by = "shading" if sphere == "matt" else "highlights"
        return Strengths(relative, u, float(np.mean(usable)), by)
    boards = []
    for capture, levels in zip(captures, seen.levels, strict=True):
        own = [ball.capture is capture for ball in seen.balls]
        boards.append(board_strengths(capture, levels, solution.outlines_px[own], solution))
    measured = [(board.levels, board.u) for board in boards if board.levels is not None and board.u is not None]
    if measured:
        rows = [row for row, _ in measured]
        relative, u = _mean(rows, [each for _, each in measured])
        message = (
            f"intensities by the board beside the balls and their shadows (u {100 * u.min():.0f} to "
            f"{100 * u.max():.0f} %), taken as matt and lit by the lamps alone; the highlights are clipped"
        )
        findings.append(Remark("note", message, "board-intensities"))
        return Strengths(relative, u, float(np.mean(rows)), "board")
    message = (
        f"{captures[0].name}: intensities not measured: the highlights are clipped, and {boards[0].reason}; taken as "
        "equal; bgars calibrate flat measures them"
    )
    findings.append(Remark("note", message, "no-intensities"))
    return Strengths(np.ones(len(solution.directions)), None, math.nan, "")


def repeatable(u: Array, by: str) -> Array:
    """(L,) of uncertainties of strengths the part that another calibration on the same reference would show.

    How real boards and balls differ from Lambert's law is alike in both. Of highlights all of it is scatter: it grows
    from the few pixels that a lamp is on the ball.
    """
    alike = {"board": MATT, "shading": SHADING_U}.get(by, 0.0)
    rest: Array = np.sqrt(np.maximum(u**2 - alike**2, LEAST_U**2))
    return rest


def _farther(circle_px: Array, solution: LightSolution) -> Array:
    """(L,) square of the distance of each light from a ball, over that from the origin: 1 of distant lights."""
    ways = solution.directions - solution.nearness[:, None] * circle_px
    square: Array = np.square(ways).sum(axis=1)
    return square


def _mean(rows: list[Array], alike: list[Array], least: float = 0.0) -> tuple[Array, Array]:
    """Mean of relative strengths, mean 1, with the scatter from ball to ball beside what is alike on all of them.

    Two or three balls show the scatter of one light badly, that of all lights well.
    """
    each = np.array([row / row.mean() for row in rows])
    mean = each.mean(axis=0)
    own = each.std(axis=0, ddof=1) if len(each) > 1 else np.zeros(len(mean))
    usual = max(float(np.sqrt(np.mean(own**2))), least)
    scatter = np.where(own > OWN_SIGMAS * usual, own, usual)
    u = np.sqrt(scatter**2 / len(each) + np.square(alike).mean(axis=0))
    return mean / mean.mean(), np.maximum(u, LEAST_U)
