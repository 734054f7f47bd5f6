"""What is clipped on a mirror ball and beside it: the edge of the ball, and highlights, are then not seen."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bgars.station.levels import Levels
    from bgars.station.outline import Outline

__all__ = ["BURNT", "HIDDEN", "TOUCHED", "clipped_ball", "clipped_ground", "moved_share"]

BESIDE, BESIDE_PX = 0.06, 2.0
"""Width of the ring of ground that is looked at, of the radius; it begins so many pixels from the outline."""
TOUCHED = 0.1
"""Share of that ring, mean of the lights, from which on clipping moves the edge: one light of eight, say."""
HIDDEN = 1.0 / 3.0
"""The same from which on no edge is left: the ball's shadow takes up to half of the ring, and this is most of the
rest. A mirror shows the ground at its rim as bright as it is (Fresnel), so that clipped ground goes on in the ball."""
RIM = 0.05
"""A black ball mirrors a quarter and more within this share of its radius, a metal over half everywhere: so far in lies
the border of what is clipped, when it is taken for the outline."""
BURNT = 0.1
"""Share of a ball that no lamps explain: one of 25 degrees, the widest, covers 1.2 % of it."""


def clipped_ground(levels: Levels, outline: Outline) -> float:
    """Share of the ground right beside a ball that is clipped, mean of the lights."""
    apart = _apart(levels, outline)
    inner = outline.radius_px + BESIDE_PX
    return _share(levels, (apart > inner) & (apart < inner + BESIDE * outline.radius_px + 1.0))


def clipped_ball(levels: Levels, outline: Outline) -> float:
    """Share of the ball that is clipped, mean of the lights."""
    return _share(levels, _apart(levels, outline) < outline.radius_px)


def moved_share(share: float) -> float:
    """By how much of its radius the outline is uncertain where so much of the ground is clipped."""
    return RIM * share if share > TOUCHED else 0.0


def _apart(levels: Levels, outline: Outline) -> NDArray[np.float64]:
    height, width = levels.images.shape[1:]
    x = np.arange(width) + 0.5 - width / 2.0 - outline.x_px
    y = height / 2.0 - 0.5 - np.arange(height) - outline.y_px
    apart: NDArray[np.float64] = np.hypot(x[None, :], y[:, None])
    return apart


def _share(levels: Levels, where: NDArray[np.bool_]) -> float:
    return float((levels.images[:, where] >= levels.clip).mean()) if where.any() else 0.0
