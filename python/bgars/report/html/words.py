"""Numbers and words of the page, one place each."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, TypeGuard

__all__ = [
    "COVERAGE_FACTOR",
    "NOT_MEASURED",
    "PART_WORDS",
    "QUANTITIES",
    "VERDICT_MARKS",
    "VERDICT_MEANINGS",
    "Quantity",
    "ball_state",
    "expanded",
    "is_known",
    "limit_words",
    "listed",
    "number",
    "range_of",
]

NOT_MEASURED = "-"
COVERAGE_FACTOR = 2.0
"""U = 2 u, about 95 %."""
DIGITS = 2
RATIO_DIGITS = 3
VERDICT_MARKS = {"pass": "✓", "fail": "✕", "undecided": "?"}
VERDICT_MEANINGS = {
    "pass": "Every ball is there, measured, and inside every limit by at least its uncertainty U.",
    "fail": "Something is missing, joined, or outside its limits by more than its uncertainty U.",
    "undecided": "Nothing fails, but something is nearer to its limit than U, was not measured, or has no limit.",
}
PART_WORDS = {
    "pitch_um": "pitch",
    "seating_coplanarity_um": "seating coplanarity",
    "regression_coplanarity_um": "regression coplanarity",
    "warpage_um": "warpage of the board",
}


@dataclass(frozen=True)
class Quantity:
    """A reading of a ball.

    Attributes
    ----------
    name : str
        Key in result.json.
    u_name : str
        Key of its standard uncertainty; empty where the result has none.
    limit : str
        Key of its limit in the recipe.
    title, meaning : str
        Head of its column, and what it is.
    unit : str
        "µm", or empty for a ratio.
    """

    name: str
    u_name: str
    limit: str
    title: str
    meaning: str
    unit: str = "µm"

    @property
    def digits(self) -> int:
        """Decimals that are shown."""
        return DIGITS if self.unit else RATIO_DIGITS


QUANTITIES = (
    Quantity(
        "true_position_um",
        "u_true_position_um",
        "true_position_um",
        "true position",
        "distance of the centre from its place in the best-fitting grid",
    ),
    Quantity("diameter_um", "u_diameter_um", "diameter_um", "diameter", "horizontal diameter"),
    Quantity("top_um", "u_top_um", "height_um", "height", "top above the board under that ball"),
    Quantity(
        "seating_deviation_um",
        "",
        "seating_coplanarity_um",
        "below seating plane",
        "distance of the apex below the plane on which the part stands",
    ),
    Quantity(
        "regression_deviation_um",
        "",
        "regression_coplanarity_um",
        "below regression plane",
        "distance of the apex below the plane parallel to the least-squares plane, through the highest apex",
    ),
    Quantity(
        "aspect_ratio",
        "u_aspect_ratio",
        "aspect_ratio",
        "aspect ratio",
        "vertical over horizontal radius, 1 for a sphere",
        unit="",
    ),
    Quantity(
        "flat_top_depth_um", "u_flat_top_depth_um", "flat_top_depth_um", "flat top", "missing height of a flat top"
    ),
)


def is_known(value: float | None) -> TypeGuard[float]:
    """True for a number that was measured."""
    return value is not None and math.isfinite(value)


def number(value: float | None, digits: int = DIGITS) -> str:
    """A number as it is shown; "-" where nothing was measured.

    Examples
    --------
    >>> number(499.625), number(-0.001), number(None)
    ('499.62', '0.00', '-')
    """
    if value is None or not math.isfinite(value):
        return NOT_MEASURED
    text = f"{value:.{digits}f}"
    return text.removeprefix("-") if float(text) == 0 else text


def expanded(u: float | None) -> float | None:
    """The expanded uncertainty of a standard one."""
    return None if u is None or not math.isfinite(u) else COVERAGE_FACTOR * u


def range_of(recipe: dict[str, Any] | None, name: str) -> tuple[float | None, float | None] | None:
    """Lowest and highest allowed value; None where the recipe has no such limit."""
    limit = ((recipe or {}).get("limits") or {}).get(name)
    if isinstance(limit, list | tuple):
        return (limit[0], limit[1])
    return None if limit is None else (None, limit)


def limit_words(limits: tuple[float | None, float | None] | None) -> str:
    """Limits in words.

    Examples
    --------
    >>> limit_words((560.0, 640.0)), limit_words((None, 50.0)), limit_words(None)
    ('560 to 640', 'at most 50', 'no limit')
    """
    low, high = limits or (None, None)
    if low is not None and high is not None:
        return f"{low:g} to {high:g}"
    if high is not None:
        return f"at most {high:g}"
    return "no limit" if low is None else f"at least {low:g}"


def ball_state(ball: dict[str, Any]) -> str:
    """Whether it is there, and how: "ball", "bridged", "extra", "missing", "unclear".

    Missing is a place that is seen to be empty: that fails. Any other without a ball is unclear.
    """
    if ball["present"]:
        return str(ball["kind"])
    return "missing" if ball["verdict"] == "fail" else "unclear"


def listed(names: list[str], most: int = 40) -> str:
    """Names, as many as one reads."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more
