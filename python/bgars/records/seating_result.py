"""A plane on which a part comes to rest."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from bgars.records.keys import Key

__all__ = ["SeatingResult"]


@dataclass(frozen=True)
class SeatingResult:
    """A plane on which the part comes to rest: ``z = slope_x x + slope_y y + offset_um`` in the image's axes.

    Attributes
    ----------
    balls : tuple of str
        Balls that touch it.
    coplanarity_um : float
        Largest distance of an apex below it.
    """

    balls: Annotated[tuple[str, ...], Key("balls that touch it")]
    coplanarity_um: Annotated[float, Key("largest distance of a top below it, in um")]
    slope_x: Annotated[float, Key("rise to the right, um per um")]
    slope_y: Annotated[float, Key("rise upward in the image, um per um")]
    offset_um: Annotated[float, Key("height at the image's centre, in um")]
