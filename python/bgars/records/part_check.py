"""A quantity of the whole part, and its verdict."""

from __future__ import annotations

from dataclasses import dataclass

from bgars.records.ball_result import Verdict

__all__ = ["PartCheck"]


@dataclass(frozen=True)
class PartCheck:
    """A quantity of the whole part, and how it was judged.

    Attributes
    ----------
    name : str
        Such as "seating_coplanarity_um".
    value_um, u_um, bias_um : float
        Reading, its standard uncertainty, and by how much noise makes it too large on average.
    lowest_um, highest_um : float or None
        Limits.
    verdict : Verdict or None
        None when there is no limit.
    reason : str
        In words.
    """

    name: str
    value_um: float
    u_um: float
    bias_um: float
    lowest_um: float | None
    highest_um: float | None
    verdict: Verdict | None
    reason: str
