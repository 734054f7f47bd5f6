"""Where the balls of a part stand, and the board under them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from setup_records import Defect, Lifted, Moved, Scaled, Setup

if TYPE_CHECKING:
    from numpy.typing import NDArray

JITTER_XY_MM, JITTER_RADIUS, JITTER_HEIGHT = 0.004, 0.008, 0.006
"""Standard deviations of place (mm), radius and height (relative) of good balls: a good process."""
DEFECT_HEIGHT_SHARE = 0.15
"""Share of that scatter of height that a ball with a defect keeps: its defect is what differs."""


@dataclass(frozen=True)
class Ball:
    """A ball before it is given its shape; lengths in mm, numbers from 1."""

    number: int
    name: str
    defect: Defect | None
    x_nominal_mm: float
    y_nominal_mm: float
    x_mm: float
    y_mm: float
    radius_mm: float
    centre_z_mm: float
    board_z_mm: float


@dataclass(frozen=True)
class BallTruth:
    """A ball as it is rendered: its highest point; centroid and diameter of equal area of its silhouette from above."""

    ball: Ball
    top_z_mm: float
    x_mm: float
    y_mm: float
    diameter_mm: float


def smooth_board_mm(
    setup: Setup, x_mm: float | NDArray[np.float64], y_mm: float | NDArray[np.float64]
) -> NDArray[np.float64]:
    """Height of the board without its relief: plane and paraboloid, shape of the places."""
    part, board = setup.part, setup.board
    half = np.hypot((part.cols - 1) / 2 * part.pitch_mm, (part.rows - 1) / 2 * part.pitch_mm) + part.diameter_mm / 2
    bow = board.bow_mm * (1 - (x_mm * x_mm + y_mm * y_mm) / half**2)
    return np.asarray(board.tilt[0] * x_mm + board.tilt[1] * y_mm + bow)


def place_balls(setup: Setup) -> list[Ball]:
    """All balls of a part: scatter of the process, then their defects."""
    part = setup.part
    random = np.random.default_rng([setup.seed, 1])
    turn = np.deg2rad(part.rotation_deg)
    cos, sin = np.cos(turn), np.sin(turn)
    balls: list[Ball] = []
    for index, name in enumerate(part.ball_names()):
        scatter = np.clip(random.standard_normal(4), -2.2, 2.2)
        if name in part.depopulated:
            continue
        row, col = divmod(index, part.cols)
        x_grid, y_grid = (col - (part.cols - 1) / 2) * part.pitch_mm, ((part.rows - 1) / 2 - row) * part.pitch_mm
        x_nominal = part.centre_mm[0] + cos * x_grid - sin * y_grid
        y_nominal = part.centre_mm[1] + sin * x_grid + cos * y_grid
        balls.append(_ball(setup, len(balls) + 1, name, (x_nominal, y_nominal), scatter))
    return balls


def _ball(setup: Setup, number: int, name: str, nominal: tuple[float, float], scatter: NDArray[np.float64]) -> Ball:
    part = setup.part
    defect = part.defects.get(name)
    x, y = nominal[0] + scatter[0] * JITTER_XY_MM, nominal[1] + scatter[1] * JITTER_XY_MM
    half = part.diameter_mm / 2
    radius, higher = half * (1 + scatter[2] * JITTER_RADIUS), part.height_mm * scatter[3] * JITTER_HEIGHT
    scale, lift = 1.0, 0.0
    if defect:
        scale = defect.factor if isinstance(defect, Scaled) else 1.0
        radius, higher = half * scale, higher * DEFECT_HEIGHT_SHARE
    if isinstance(defect, Lifted):
        lift = defect.height_mm
    if isinstance(defect, Moved):
        angle = np.deg2rad(defect.direction_deg)
        x, y = nominal[0] + defect.distance_mm * np.cos(angle), nominal[1] + defect.distance_mm * np.sin(angle)
    ground = float(smooth_board_mm(setup, x, y))
    centre_z = (part.height_mm - half) * scale + higher + lift + ground
    return Ball(number, name, defect, *nominal, x, y, radius, centre_z, ground)
