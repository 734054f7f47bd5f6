"""What the uncertainty of the readings is made of, by cause, and what would make each share smaller."""

from __future__ import annotations

import math
from statistics import median
from typing import Any, NamedTuple

from bgars.report.html.words import COVERAGE_FACTOR, expanded, is_known, number

__all__ = ["ADVICE", "BUDGET_COLUMNS", "BudgetTable", "budget_table", "main_causes"]

RIG = "Calibrate the directions of the lights and state [lights] u_deg in capture.toml."
ADVICE = {
    "scatter of the edges": "More light, less noise, more bits, smaller pixels, more lights.",
    "pixel pitch and lens": "Calibrate the pixel pitch and state pixel_pitch_u_um in capture.toml, state pitch_u_um in "
    "the recipe; use a lens of low distortion.",
    "elevation of all lights together": RIG,
    "azimuth of all lights together": RIG,
    "direction of each light": RIG,
    "roundness of all balls together": "Measure the shape of this kind of ball, and state aspect_ratio and "
    "u_aspect_ratio in the recipe.",
    "distance of the camera": "State camera in capture.toml: its distance, or telecentric.",
    "response, penumbra and reflected light at the edges": "Smaller lamps, a linear or measured response, dark "
    "surroundings, a dark frame.",
    "outlines of all balls together": "Sharper focus, smaller pixels, a board that stands out from the balls.",
    "shape of this ball": "More lights, so that more shadows show the shape of each ball.",
    "relief of the board": "More lights: their shadows end at more places of the board.",
    "shifts of the images": "Hold part and camera still from the first image to the last.",
    "flat top": "An exposure in which tops are neither clipped nor dark.",
    "each ball by itself": "Scatter, shape, relief and flat top of single balls: look at those whose "
    "height has the largest U.",
}
"""By cause, as :mod:`bgars.inspection.budget` names it; one that is not here is shown without advice."""
BUDGET_COLUMNS = ("height", "diameter", "position", "seating coplanarity")
Causes = dict[str, float]


class BudgetTable(NamedTuple):
    """Rows of `cause`, `advice` and `cells`, largest height first, and the cells of the whole; U in um as shown."""

    rows: list[dict[str, Any]]
    whole: list[str]


def budget_table(result: dict[str, Any]) -> BudgetTable | None:
    """Expanded uncertainty by cause: of balls the median over those with a budget; None where the result has none."""
    columns = [*_medians(result["balls"]), result["seating_budget"]]
    causes = list(dict.fromkeys(cause for column in columns for cause, u in column.items() if u > 0.0))
    if not causes:
        return None
    # By height, then by whatever it counts in most.
    causes.sort(key=lambda cause: (-columns[0].get(cause, 0.0), -max(each.get(cause, 0.0) for each in columns)))
    rows = [
        {"cause": cause, "advice": ADVICE.get(cause, ""), "cells": [_shown(column.get(cause)) for column in columns]}
        for cause in causes
    ]
    balls = [ball for ball in result["balls"] if ball["budget"]]
    whole = [
        *(_median_of([ball[name] for ball in balls]) for name in ("u_top_um", "u_diameter_um")),
        _median_of([_along_one_axis(ball["u_x_um"], ball["u_y_um"]) for ball in balls]),
        result["u_seating_coplanarity_um"] if result["seating_budget"] else None,
    ]
    return BudgetTable(rows, [_shown(u) for u in whole])


def main_causes(result: dict[str, Any], most: int = 3) -> list[tuple[str, float]]:
    """Causes that make heights uncertain, largest first, with their expanded uncertainty in um."""
    heights = _medians(result["balls"])[0]
    largest = sorted(heights.items(), key=lambda pair: -pair[1])[:most]
    return [(cause, COVERAGE_FACTOR * u) for cause, u in largest if u > 0.0]


def _medians(balls: list[dict[str, Any]]) -> tuple[Causes, Causes, Causes]:
    """Standard uncertainty by cause of height, diameter and position, um: medians over balls with a budget.

    A cause that a ball does not list is too small to count there: 0.
    """
    budgets = [ball["budget"] for ball in balls if ball["budget"]]
    height, diameter = ([budget.get(name, {}) for budget in budgets] for name in ("top_um", "diameter_um"))
    position = []
    for budget in budgets:
        x, y = budget.get("x_um", {}), budget.get("y_um", {})
        position.append({cause: _along_one_axis(x.get(cause, 0.0), y.get(cause, 0.0)) for cause in x | y})
    return _median_causes(height), _median_causes(diameter), _median_causes(position)


def _median_causes(budgets: list[Causes]) -> Causes:
    causes = dict.fromkeys(cause for budget in budgets for cause in budget)
    return {cause: float(median(budget.get(cause, 0.0) for budget in budgets)) for cause in causes}


def _along_one_axis(u_x: float | None, u_y: float | None) -> float:
    """Root mean square of both axes; NaN where one is not known."""
    return math.hypot(u_x, u_y) / math.sqrt(2.0) if is_known(u_x) and is_known(u_y) else math.nan


def _median_of(values: list[float | None]) -> float | None:
    known = [value for value in values if is_known(value)]
    return median(known) if known else None


def _shown(u: float | None) -> str:
    """U in um; nothing where the cause hardly counts."""
    return number(expanded(u)) if u else ""
