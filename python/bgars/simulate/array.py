"""Balls on a grid, with the spread of a production line."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from bgars.simulate.balls import Ball, ball_name
from bgars.simulate.checks import at_least, number, positive, require, whole

__all__ = ["Jitter", "array_balls", "truncated_normal"]

CUT_OFF = 2.5
MAX_DRAWS = 64

MAX_BALLS = 32_767
"""Labels are int16."""


@dataclass(frozen=True)
class Jitter:
    """Standard deviations of the spread from ball to ball, normal, cut off at 2.5 sigma.

    Attributes
    ----------
    height_um : float
        Of the top above the board.
    radius_um : float
        Of the radius.
    position_um : float
        Of the centre, along x and along y.
    """

    height_um: float = 0.0
    radius_um: float = 0.0
    position_um: float = 0.0

    def __post_init__(self) -> None:
        for name in ("height_um", "radius_um", "position_um"):
            at_least(f"scene.jitter.{name}", getattr(self, name), 0.0)


def truncated_normal(random: np.random.Generator) -> float:
    """Draw a standard normal number within +-2.5."""
    for _ in range(MAX_DRAWS):
        value = float(random.standard_normal())
        if abs(value) <= CUT_OFF:
            return value
    return 0.0


def array_balls(
    rows: int,
    cols: int,
    *,
    pitch_um: float,
    diameter_um: float,
    height_um: float,
    centre_um: tuple[float, float],
    rotation_deg: float,
    jitter: Jitter,
    seed: int,
) -> list[Ball]:
    """Return the balls of a grid in reading order; see :meth:`bgars.Scene.ball_array`."""
    for name, count in (("scene.rows", rows), ("scene.cols", cols)):
        whole(name, count, 1)
    require(rows * cols <= MAX_BALLS, "scene.rows x scene.cols", f"must be {MAX_BALLS} balls or fewer", rows * cols)
    for name, value in (("pitch_um", pitch_um), ("diameter_um", diameter_um), ("height_um", height_um)):
        positive(f"scene.{name}", value)
    number("scene.rotation_deg", rotation_deg)
    for value in centre_um:
        number("scene.centre_um", value)
    whole("scene.seed", seed, 0)
    random = np.random.default_rng(seed)
    cosine, sine = math.cos(math.radians(rotation_deg)), math.sin(math.radians(rotation_deg))
    balls = []
    for row in range(rows):
        for col in range(cols):
            across, up = (col - (cols - 1) / 2) * pitch_um, ((rows - 1) / 2 - row) * pitch_um
            x_um = centre_um[0] + cosine * across - sine * up
            y_um = centre_um[1] + sine * across + cosine * up
            dx, dy, dr, dh = (truncated_normal(random) for _ in range(4))
            radius_um = diameter_um / 2 + jitter.radius_um * dr
            balls.append(
                Ball(
                    x_um + jitter.position_um * dx,
                    y_um + jitter.position_um * dy,
                    radius_um=radius_um,
                    centre_z_um=height_um + jitter.height_um * dh - radius_um,
                    name=ball_name(row + 1, col + 1),
                    row=row + 1,
                    col=col + 1,
                    x_nominal_um=x_um,
                    y_nominal_um=y_um,
                )
            )
    return balls
