"""Random numbers, rounded as they go into the description of a part."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence


class Draws:
    """One generator, asked in a fixed order: a change of order changes all parts.

    Attributes
    ----------
    diameter_mm, pitch_mm : float
        Of the ordinary part, before they are rounded and before any deviation changes them: relief follows these.
    """

    def __init__(self, seed: int) -> None:
        self.random = np.random.default_rng([seed, 4242])
        self.diameter_mm = self.pitch_mm = 0.0

    def uniform(self, low: float, high: float, digits: int | None = None) -> float:
        """Draw evenly, rounded to so many digits."""
        value = float(self.random.uniform(low, high))
        return value if digits is None else round(value, digits)

    def whole(self, low: int, end: int) -> int:
        """Draw a whole number in [low, end)."""
        return int(self.random.integers(low, end))

    def chance(self, share: float) -> bool:
        """Draw whether something is so."""
        return self.uniform(0, 1) < share

    def sign(self) -> float:
        """Draw -1 or 1."""
        return float(self.random.choice([-1, 1]))

    def one_of(self, values: Sequence[int]) -> int:
        """Draw one of the values."""
        return int(self.random.choice(values))

    def shuffled(self, names: Sequence[str]) -> list[str]:
        """Draw an order."""
        return [str(name) for name in self.random.permutation(names)]
