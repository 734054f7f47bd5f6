"""A part of twenty balls that keeps its limits, as it was simulated and as it was measured."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import bgars
from bgars.records.ball_layout import BallLayout
from bgars.records.found_balls import FoundBalls
from bgars.records.measured_balls import BallMeasurement
from bgars.records.part_recipe import Limits, PartRecipe
from synthetic_parts import measured_part

CAMERA = bgars.Camera(pixel_pitch_um=50.0)
LIMITS = Limits(
    true_position_um=50.0,
    diameter_um=(560.0, 640.0),
    height_um=(460.0, 540.0),
    aspect_ratio=(0.97, 1.03),
    flat_top_depth_um=10.0,
    pitch_um=(998.0, 1002.0),
    seating_coplanarity_um=60.0,
    regression_coplanarity_um=60.0,
    warpage_um=50.0,
)
RECIPE = PartRecipe("demo", BallLayout(4, 5, 1000.0), limits=LIMITS)


def simulated(**options: object) -> bgars.SimulatedTruth:
    scene = bgars.Scene.ball_array(4, 5, jitter=bgars.Jitter(5.0, 2.0, 3.0), seed=3, **options)
    _, truth = bgars.simulate(scene, bgars.LightRig.ring(8), bgars.Material(), CAMERA)
    return truth


@cache
def good_part() -> tuple[FoundBalls, BallMeasurement]:
    return measured_part(simulated())


def changed(measurement: BallMeasurement, name: str, **values: object) -> BallMeasurement:
    balls = tuple(replace(ball, **values) if ball.name == name else ball for ball in measurement.balls)
    return replace(measurement, balls=balls)


def ball_of(result: bgars.PartResult, name: str) -> bgars.BallResult:
    return next(ball for ball in result.balls if ball.name == name)
