"""A plane on which a part comes to rest."""

from __future__ import annotations

from dataclasses import dataclass

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

    balls: tuple[str, ...]
    coplanarity_um: float
    slope_x: float
    slope_y: float
    offset_um: float
