"""Pass, fail or undecided: the decision rule of ISO 14253-1.

Doubts of a ball or a part may lower a verdict afterwards: ``judge_ball.py``, ``judge_part.py``, ``judge.py``.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from bgars.records.ball_result import Verdict

__all__ = ["COVERAGE_FACTOR", "Decision", "decide", "worst"]

COVERAGE_FACTOR = 2.0
"""Expanded over standard uncertainty: about 95 % coverage."""


WORTH_TELLING = 0.1
"""A bias below this many standard uncertainties is not mentioned."""


class Decision(NamedTuple):
    """A verdict and why.

    Attributes
    ----------
    verdict : Verdict
    reason : str
        Quantity, reading, limit and expanded uncertainty; also for a pass.
    """

    verdict: Verdict
    reason: str


def decide(
    what: str,
    value: float,
    u: float,
    limits: tuple[float | None, float | None],
    *,
    unit: str = "um",
    bias: float = 0.0,
) -> Decision:
    """Judge a reading against limits that are narrowed to pass and widened to fail.

    With the expanded uncertainty U = 2 u, conformance is proven within the limits shrunk by U, non-conformance outside
    the limits widened by U (ISO 14253-1); between them nothing is proven. A reading that noise makes too large by
    `bias` on average must pass as it is, and fails only with the bias taken off.

    Parameters
    ----------
    what : str
        Name for the reason.
    value, u, bias : float
        Reading, standard uncertainty, bias; NaN = unknown, which proves nothing.
    limits : (float or None, float or None)
        Lowest and highest.
    unit : str
        Of all of them; "" for a ratio.

    References
    ----------
    ISO 14253-1, Geometrical product specifications: decision rules for verifying conformity or nonconformity with
    specifications.

    Examples
    --------
    >>> [decide("diameter", value, 0.5, (580.0, 620.0)).verdict for value in (600.0, 619.5, 622.0)]
    ['pass', 'undecided', 'fail']
    >>> decide("diameter", 619.5, 0.5, (580.0, 620.0)).reason
    'diameter 619.50 um is too near its limits (580 to 620 um) to decide, U = 1 um'
    """
    lowest, highest = limits
    text = _limits_text(lowest, highest, unit)
    space = f" {unit}" if unit else ""
    if not math.isfinite(value):
        return Decision("undecided", f"{what} was not measured (limit: {text})")
    digits = _digits(u)
    reading = f"{what} {value:.{digits}f}{space}"
    if not (math.isfinite(u) and u >= 0 and math.isfinite(bias)):
        return Decision("undecided", f"{reading} has no known uncertainty (limit: {text})")
    expanded = COVERAGE_FACTOR * u
    note = f"U = {expanded:.2g}{space}"
    if bias > WORTH_TELLING * u:
        note += f", noise bias {bias:.2g}{space}"
    if (lowest is None or value >= lowest + expanded) and (highest is None or value <= highest - expanded):
        return Decision("pass", f"{reading} is within {text}, {note}")
    if (lowest is not None and value < lowest - expanded) or (
        highest is not None and value - bias > highest + expanded
    ):
        return Decision("fail", f"{reading} is outside its limits ({text}), {note}")
    return Decision("undecided", f"{reading} is too near its limits ({text}) to decide, {note}")


def worst(verdicts: list[Verdict]) -> Verdict:
    """Fail if any fails, else undecided if any is; pass for an empty list.

    Examples
    --------
    >>> worst(["pass", "undecided"]), worst(["fail", "undecided"])
    ('undecided', 'fail')
    """
    order: tuple[Verdict, ...] = ("fail", "undecided")
    return next((verdict for verdict in order if verdict in verdicts), "pass")


def _limits_text(lowest: float | None, highest: float | None, unit: str) -> str:
    space = f" {unit}" if unit else ""
    if lowest is None:
        return f"at most {highest:g}{space}"
    return f"at least {lowest:g}{space}" if highest is None else f"{lowest:g} to {highest:g}{space}"


def _digits(u: float) -> int:
    """Digits behind the point that a reading of this uncertainty deserves."""
    return min(max(1 - math.floor(math.log10(u)), 1), 4) if math.isfinite(u) and u > 0 else 2
