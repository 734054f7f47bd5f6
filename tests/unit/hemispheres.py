"""Simulated hemispheres and balls, and how wrong their normals are."""

from __future__ import annotations

from functools import cache

import bgars
import numpy as np
from numpy.typing import NDArray

RING = bgars.LightRig.ring(8)
SOLDER = bgars.Material(i_d=0.5, i_s=1.0, hardness=40)
GAINS = (1.04, 0.97, 1.01, 0.95, 1.05, 0.99, 1.02, 0.96)
RADIUS_PX = 30
MIN_N_Z = 0.3

Pair = tuple[bgars.Capture, bgars.SimulatedTruth]


def hemisphere(
    material: bgars.Material = SOLDER, rig: bgars.LightRig = RING, *, radius_px: int = RADIUS_PX, **camera: object
) -> Pair:
    """A hemisphere at the image centre; `seed` goes to the simulator, the rest to the camera."""
    seed = camera.pop("seed", 0)
    scene = bgars.Scene.hemisphere(10.0 * radius_px)
    return bgars.simulate(scene, rig, material, bgars.Camera(pixel_pitch_um=10.0, **camera), seed=seed, threads=1)


def anchored(capture: bgars.Capture, radius_px: float = RADIUS_PX, **options: object) -> bgars.NormalField:
    return bgars.estimate_normals(capture, anchors=[[0.0, 0.0, radius_px]], **options)


@cache
def plain() -> tuple[bgars.Capture, bgars.SimulatedTruth, bgars.NormalField]:
    """The hemisphere of every default, and its normals."""
    capture, truth = hemisphere()
    return capture, truth, anchored(capture)


def judged(truth: bgars.SimulatedTruth) -> NDArray[np.bool_]:
    return truth.mask & (truth.normals[..., 2] > MIN_N_Z)


def mean_deg(field: bgars.NormalField, truth: bgars.SimulatedTruth, where: NDArray[np.bool_] | None = None) -> float:
    where = judged(truth) if where is None else where
    return float(bgars.angular_error_deg(field.normals[where], truth.normals[where]).mean())


def circles_px(capture: bgars.Capture, truth: bgars.SimulatedTruth) -> list[list[float]]:
    """True silhouettes of the balls of a simulated array."""
    balls = [ball for ball in truth.balls if ball.present]
    return [[v / capture.pixel_pitch_um for v in (ball.x_um, ball.y_um, ball.diameter_um / 2)] for ball in balls]
