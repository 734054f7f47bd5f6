"""Simulated captures of balls whose readings scatter as those of real ones, and how far measurements are off."""

from __future__ import annotations

from functools import cache

import bgars
import numpy as np
from bgars.records.found_balls import FoundBall, FoundBalls
from bgars.records.measured_balls import BallMeasurement
from numpy.typing import NDArray

PITCH_UM = 11.0
MATTE = bgars.Material(i_d=0.5, i_s=1.0, hardness=40)


def board(bow_um: float = 0.0, i_d: float = 0.12) -> bgars.Board:
    tilt_deg = 0.15 if bow_um else 0.0
    return bgars.Board(
        bgars.Material.matte(i_d), tilt_x_deg=tilt_deg, bow_um=bow_um, bow_radius_um=3000.0, texture=bgars.Texture(0.25)
    )


def array(rows: int, cols: int, seed: int, *, bow_um: float = 0.0, **options: object) -> bgars.Scene:
    jitter = bgars.Jitter(height_um=8.0, radius_um=3.0, position_um=5.0)
    return bgars.Scene.ball_array(
        rows,
        cols,
        rotation_deg=0.3,
        jitter=jitter,
        seed=seed,
        board=board(bow_um),
        **options,  # type: ignore[arg-type]
    )


def circles(truth: bgars.SimulatedTruth, pitch_um: float, seed: int) -> FoundBalls:
    """What a rough finder would say: half a pixel off in the centre, 1 % in the radius."""
    random = np.random.default_rng(seed)
    balls = []
    for ball in truth.balls:
        if ball.x_um is None or ball.y_um is None or ball.diameter_um is None:
            continue
        off = random.standard_normal(3)
        radius_px = ball.diameter_um / 2.0 / pitch_um
        balls.append(
            FoundBall(
                ball.name,
                ball.row - 1,
                ball.col - 1,
                ball.x_um / pitch_um + 0.5 * off[0],
                ball.y_um / pitch_um + 0.5 * off[1],
                radius_px * (1.0 + 0.01 * off[2]),
                u_centre_px=0.5,
                u_radius_px=0.01 * radius_px,
            )
        )
    return FoundBalls(tuple(balls), (), (), 1, 1, None, 0.0, (0.0, 0.0))


def photograph(
    scene: bgars.Scene, rig: bgars.LightRig, seed: int = 1, *, pitch_um: float = PITCH_UM, **camera: object
) -> tuple[bgars.Capture, bgars.SimulatedTruth, FoundBalls]:
    options = {"supersample": 4, "full_well_e": 15000.0, "read_noise_levels": 0.15} | camera
    capture, truth = bgars.simulate(
        scene,
        rig,
        MATTE,
        bgars.Camera(pixel_pitch_um=pitch_um, **options),
        seed=seed,  # type: ignore[arg-type]
    )
    return capture, truth, circles(truth, pitch_um, seed)


def errors(measured: BallMeasurement, truth: bgars.SimulatedTruth, name: str) -> NDArray[np.float64]:
    by_name = {ball.name: getattr(ball, name) for ball in truth.balls}
    return np.array([getattr(ball, name) - by_name[ball.name] for ball in measured.balls])


def rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(values**2)))


def wrong_rig(rig: bgars.LightRig, off_deg: float, seed: int) -> bgars.LightRig:
    """The same rig as somebody measured it, each light `off_deg` away."""
    turn = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, len(rig))
    level = np.cos(np.radians(rig.elevations_deg))
    angles = np.column_stack(
        [rig.azimuths_deg + off_deg * np.cos(turn) / level, rig.elevations_deg + off_deg * np.sin(turn)]
    )
    return bgars.LightRig.from_angles(angles)


@cache
def sixteen_balls() -> tuple[bgars.Capture, bgars.SimulatedTruth, FoundBalls]:
    return photograph(array(4, 4, 1), bgars.LightRig.ring(8))
