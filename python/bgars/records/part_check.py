"""A quantity of the whole part, and its verdict."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from bgars.records.ball_result import Verdict
from bgars.records.keys import Key

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

    name: Annotated[str, Key("quantity, with its unit, such as seating_coplanarity_um")]
    value_um: Annotated[float, Key("reading, in um")]
    u_um: Annotated[float, Key("standard uncertainty (k = 1) of the reading, in um")]
    bias_um: Annotated[float, Key("by how much noise makes the reading too large on average, in um")]
    lowest_um: Annotated[float | None, Key("lowest allowed value, in um; null = no limit")]
    highest_um: Annotated[float | None, Key("highest allowed value, in um; null = no limit")]
    verdict: Annotated[Verdict | None, Key("null: there is no limit")]
    reason: Annotated[str, Key("the verdict in words")]
