"""Random scenes: the simulator's truth against a slow twin that asks each pixel one question at a time."""

from __future__ import annotations

import bgars
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

MATTE = bgars.Material.matte(0.5)
NEAR_ENOUGH = 1e-6


def first_hit(balls: tuple[bgars.Ball, ...], x: float, y: float) -> tuple[int, float]:
    """Number of the ball (0 = board) under x, y, and its height."""
    best = (0, 0.0)
    for number, ball in enumerate(balls, start=1):
        beside = ball.radius_um**2 - (x - ball.x_um) ** 2 - (y - ball.y_um) ** 2
        if beside > 0:
            height = ball.centre_z_um + np.sqrt(beside)
            if height > best[1]:
                best = (number, height)
    return best


def clearance_um(ball: bgars.Ball, point: np.ndarray, toward: np.ndarray) -> float:
    """How far the ray stays outside a sphere: distance of the centre to the half-line, minus the radius."""
    offset = np.array([ball.x_um, ball.y_um, ball.centre_z_um]) - point
    along = max(offset @ toward, 0.0)
    return float(np.linalg.norm(offset - along * toward)) - ball.radius_um


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    rows=st.integers(1, 3),
    cols=st.integers(1, 3),
    elevation_deg=st.floats(15.0, 85.0),
    azimuth_deg=st.floats(0.0, 360.0),
    near=st.booleans(),
    # The tallest ball of the least radius still stands on the board: 560 + 2.5 * 5 <= 2 * (300 - 2.5 * 5).
    height_um=st.floats(200.0, 560.0),
)
def test_labels_heights_and_lit_masks(
    seed: int, rows: int, cols: int, elevation_deg: float, azimuth_deg: float, near: bool, height_um: float
) -> None:
    scene = bgars.Scene.ball_array(
        rows, cols, pitch_um=700.0, height_um=height_um, jitter=bgars.Jitter(5.0, 5.0, 10.0), seed=seed
    )
    rig = bgars.LightRig.ring(3, elevation_deg=elevation_deg, azimuth0_deg=azimuth_deg)
    if near:
        rig = bgars.LightRig.from_positions(rig.directions * 9000.0 + [0.0, 0.0, 700.0])
    camera = bgars.Camera(pixel_pitch_um=31.0)
    capture, truth = bgars.simulate(scene, rig, MATTE, camera, seed=seed % 1000)
    height, width = truth.ball_ids.shape
    random = np.random.default_rng(seed)
    for row, col in random.integers(0, [height, width], (60, 2)):
        x, y = (col + 0.5 - width / 2) * 31.0, (height / 2 - row - 0.5) * 31.0
        number, z = first_hit(scene.balls, x, y)
        assert truth.ball_ids[row, col] == number
        np.testing.assert_allclose(truth.height_um[row, col], z, rtol=1e-6)
        point = np.array([x, y, z])
        normal = np.array([0.0, 0.0, 1.0])
        if number:
            ball = scene.balls[number - 1]
            normal = (point - [ball.x_um, ball.y_um, ball.centre_z_um]) / ball.radius_um
        np.testing.assert_allclose(truth.normals[row, col], normal, atol=1e-6)
        for light in range(len(rig)):
            toward = rig.directions[light]
            if rig.positions_um is not None:
                toward = rig.positions_um[light] - point
                toward = toward / np.linalg.norm(toward)
            others = [ball for index, ball in enumerate(scene.balls, start=1) if index != number]
            gaps = [clearance_um(ball, point, toward) for ball in others]
            facing = normal @ toward
            if abs(facing) < NEAR_ENOUGH or any(abs(gap) < NEAR_ENOUGH for gap in gaps):
                continue
            lit = facing > 0 and all(gap > 0 for gap in gaps)
            assert truth.lit[light, row, col] == lit
            assert lit or capture.images[light, row, col] == 0
