"""How far lamps are of which a calibration gives directions: what is taken to be known, and what it does to a ball."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bgars.station.mirror import Sphere, image_of

__all__ = ["TILT", "LampDistance", "highlights_of", "learnt_distance", "unknown_distance"]

Array = NDArray[np.float64]

LAMP_SIDES = 0.1
"""One over the distance of lamps of which nothing is stated, standard deviation, in sides of the image: the root mean
square of lamps at 4 to 100 sides, equally many in each octave. Ring lights stand at 4 to 10, lamps on arms farther."""
TILT = math.radians(120.0)
"""By so many times the ball's radius over the lamp's distance is a matt ball's light tilted toward the board where that
distance is left out of its shading."""


class LampDistance(NamedTuple):
    """One over the distance that all lamps have in common, and its standard uncertainty, 1 / px."""

    mean: float
    u: float
    taken: Array | None = None
    """(B,) what the shading of each matt ball was fitted with; None of mirror balls."""


def unknown_distance(side_px: float) -> LampDistance:
    """Lamps of which nothing is stated, by the longer side of the image."""
    return LampDistance(0.0, LAMP_SIDES / side_px)


def learnt_distance(nearness: Array, u: Array) -> LampDistance:
    """What the shading of matt balls says, (B,) each: what it mistakes for distance is alike on all of them."""
    return LampDistance(float(nearness.mean()), float(np.sqrt(np.square(u).mean())), nearness)


def highlights_of(
    directions: Array, nearness: Array, sphere: Sphere, camera_px: float, taken: float | None = None
) -> Array:
    """Return (L, 2) places in the image of the highlights of lights; with `taken` of the directions of a matt ball.

    A matt ball shows directions from its centre, that its shading was tilted in by a distance other than `taken`.
    """
    if taken is None:
        return image_of(directions, nearness, sphere, camera_px)
    ways = directions - nearness[:, None] * sphere.centre_px
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    level = np.hypot(ways[:, 0], ways[:, 1])
    slope = ways[:, 2] / np.maximum(level, 1e-9)
    up = np.column_stack([-slope[:, None] * ways[:, :2], level])
    ways = ways - (TILT * sphere.radius_px * (nearness - taken))[:, None] * up
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    return image_of(ways, np.zeros(len(ways)), sphere, camera_px)
