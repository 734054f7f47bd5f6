"""Measurements made from the simulator's truth and known noise: what a perfect finder and measurement would hand on."""

from __future__ import annotations

import math

import bgars
import numpy as np
from bgars.records.found_balls import FoundBall, FoundBalls
from bgars.records.measured_balls import BallMeasurement, MeasuredBall

NAN = math.nan


def measured_part(
    truth: bgars.SimulatedTruth, *, noise_um: float = 0.2, u_um: float = 0.2, seed: int = 0
) -> tuple[FoundBalls, BallMeasurement]:
    """Records of a simulated part: every length with normal noise and a stated uncertainty."""
    random = np.random.default_rng(seed)
    setup = truth.setup
    pitch_um = setup.camera.pixel_pitch_um
    joined = {name for bridge in setup.scene.bridges for name in (bridge.first, bridge.second)}
    found, measured, missing = [], [], []
    for ball in truth.balls:
        row, col = ball.row - 1, ball.col - 1
        if not ball.present:
            missing.append((ball.name, row, col))
            continue
        e = random.normal(0.0, noise_um, 6)
        kind = "bridged" if ball.name in joined else "ball"
        x_um, y_um, diameter_um = ball.x_um + e[0], ball.y_um + e[1], ball.diameter_um + e[2]
        found.append(
            FoundBall(
                ball.name, row, col, x_um / pitch_um, y_um / pitch_um, diameter_um / 2 / pitch_um, 0.02, 0.02, kind
            )
        )
        top_um, centre_z_um, reasons = ball.top_um + e[3], ball.centre_z_um + e[4], ()
        if kind == "bridged":
            top_um = centre_z_um = NAN
            reasons = ("joined to a neighbour: its height cannot be measured",)
        measured.append(
            MeasuredBall(
                ball.name,
                row,
                col,
                x_um,
                y_um,
                diameter_um,
                centre_z_um,
                top_um,
                aspect_ratio=ball.aspect_ratio + 0.001 * e[5] / max(noise_um, 1e-9),
                flat_top_depth_um=ball.flat_top_depth_um,
                u_x_um=u_um,
                u_y_um=u_um,
                u_diameter_um=u_um,
                u_centre_z_um=u_um,
                u_top_um=u_um,
                u_aspect_ratio=0.001,
                u_flat_top_depth_um=1.0,
                lights_used=len(setup.rig),
                kind=kind,
                reasons=reasons,
            )
        )
    board = setup.scene.board
    curve = -board.bow_um / board.bow_radius_um**2 if board.bow_um else 0.0
    rows, cols = max(ball.row for ball in truth.balls), max(ball.col for ball in truth.balls)
    nominal_um = np.diff([(b.x_nominal_um, b.y_nominal_um) for b in truth.balls], axis=0)
    grid_um = float(np.hypot(*nominal_um.T).min()) if len(nominal_um) else None
    return (
        FoundBalls(
            tuple(found),
            tuple(missing),
            tuple((bridge.first, bridge.second) for bridge in setup.scene.bridges),
            rows,
            cols,
            None if grid_um is None else grid_um / pitch_um,
            0.0,
            (0.0, 0.0),
        ),
        BallMeasurement(
            tuple(measured),
            np.array([board.bow_um, *board.slopes, curve, 0.0, curve]),
            setup.rig.directions,
            np.full(len(setup.rig), 0.02),
            0.03,
            board_covariance=np.diag([0.1, 1e-10, 1e-10, 1e-16, 1e-16, 1e-16]),
            u_pixel_pitch=1e-5,
        ),
    )
