"""Where a wide lamp puts the edge of a shadow: against a lamp of many points."""

from __future__ import annotations

import numpy as np
import pytest
from bgars.inspection.board import Board
from bgars.inspection.bundle_model import tangents
from bgars.inspection.shadow_model import Balls, Lights, edge_at, rays
from bgars.inspection.spread import EdgeSpread, lamp_shift_px
from numpy.typing import NDArray
from scipy.optimize import brentq

Array = NDArray[np.float64]
BALL = np.array([[0.0, 0.0, 12.0, 25.0, 1.0]])
LIGHT = np.array([[0.5, 0.5, np.sqrt(0.5)]])


def half_lit_px(angle_rad: float, wide_rad: float, high_rad: float) -> float:
    """Distance outside the edge of the lamp's middle at which half of a lamp's 4,000 points are seen."""
    random = np.random.default_rng(0).standard_normal((2000, 2))
    turns = np.concatenate([random, -random]) * [wide_rad, high_rad]
    along, up = tangents(LIGHT)[0]
    lamp = LIGHT + turns[:, :1] * along + turns[:, 1:] * up
    lamp /= np.linalg.norm(lamp, axis=1, keepdims=True)
    balls, board = Balls.from_table(BALL), Board()
    lights = Lights.from_table(LIGHT, False)
    edge = edge_at(np.array([angle_rad]), balls, lights, board)
    beam = rays(edge.x, edge.y, balls, lights, board)
    normal_x, normal_y = beam.gradient_x[0] / beam.slope[0], beam.gradient_y[0] / beam.slope[0]

    def excess(d: float) -> float:
        x, y = edge.x + d * normal_x, edge.y + d * normal_y
        many = Lights(lamp[:, 0], lamp[:, 1], lamp[:, 2], False)
        far = rays(np.full(len(lamp), x[0]), np.full(len(lamp), y[0]), balls, many, board).distance
        return float(np.mean(1.0 / (1.0 + np.exp(-(far - BALL[0, 3]) / 0.05))) - 0.5)

    return float(brentq(excess, -6.0, 6.0))


@pytest.mark.parametrize(("wide_deg", "high_deg"), [(3.0, 3.0), (6.0, 1.0), (1.0, 3.0)])
@pytest.mark.parametrize("angle_deg", [0.0, 25.0, 50.0])
def test_half_of_the_lamp_is_seen_where_the_second_difference_says(
    angle_deg: float, wide_deg: float, high_deg: float
) -> None:
    wide, high = np.radians([wide_deg, high_deg])
    angle = np.radians(angle_deg)
    balls, board = Balls.from_table(BALL).spread(2), Board()
    edge = edge_at(np.full((1, 1, 1), angle), balls, Lights.from_table(LIGHT, False).spread(1, 1), board)
    shift = lamp_shift_px(edge.x, edge.y, balls, LIGHT, False, board, EdgeSpread(0.5, 0.0, wide, high))
    # The middle's edge lies outside of where half is seen; beyond second order the widest lamp moves a fifth less.
    assert float(shift[0, 0, 0]) == pytest.approx(-half_lit_px(angle, wide, high), abs=0.04, rel=0.25)


def test_a_point_moves_nothing() -> None:
    balls, board = Balls.from_table(BALL).spread(2), Board()
    edge = edge_at(np.zeros((1, 1, 1)), balls, Lights.from_table(LIGHT, False).spread(1, 1), board)
    shift = lamp_shift_px(edge.x, edge.y, balls, LIGHT, False, board, EdgeSpread(0.5, 0.0, 0.0, 0.0))
    assert abs(float(shift[0, 0, 0])) < 1e-6
