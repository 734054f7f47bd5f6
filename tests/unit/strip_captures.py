"""A simulated strip of 2 x 3 parts, 3 x 3 balls each, one of which lacks a ball."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import bgars
import imageio.v3 as iio
from bgars.records.strip_layout import StripLayout

STRIP = StripLayout(rows=2, cols=3, pitch_x_um=4200.0, pitch_y_um=4000.0)
WITHOUT_A_BALL = ("R2C3", "B1")
PITCH_UM = 12.0
SHAPE = (680, 1060)
RECIPE = """
name = "nine"
rows = 3
cols = 3
pitch_um = 1000.0
diameter_um = 600.0

[limits]
diameter_um = [500.0, 700.0]
height_um = [400.0, 600.0]
true_position_um = 60.0
seating_coplanarity_um = 100.0

[strip]
rows = 2
cols = 3
pitch_x_um = 4200.0
pitch_y_um = 4000.0
"""
TOML = """
pixel_pitch_um = 12.0
{camera}
[lights]
ring = {{ count = 8, elevation_deg = 45.0 }}
"""


@cache
def strip_capture() -> bgars.Capture:
    balls = []
    for place in STRIP.places():
        array = bgars.Scene.ball_array(3, 3, centre_um=(place.x_um, place.y_um))
        balls += [
            replace(ball, name=f"{place.name}.{ball.name}")
            for ball in array.balls
            if (place.name, ball.name) != WITHOUT_A_BALL
        ]
    capture, _ = bgars.simulate(
        bgars.Scene(tuple(balls)),
        bgars.LightRig.ring(8),
        bgars.Material(),
        bgars.Camera(PITCH_UM, shape=SHAPE, full_well_e=20_000.0, read_noise_levels=0.5),
        seed=3,
    )
    return capture


def write_strip(folder: Path, *, telecentric: bool = True) -> Path:
    folder.mkdir(parents=True)
    for light, image in enumerate(strip_capture().images):
        iio.imwrite(folder / f"light_{light}.png", image)
    camera = 'camera = "telecentric"\n' if telecentric else ""
    (folder / "capture.toml").write_text(TOML.format(camera=camera))
    return folder


def write_recipe(folder: Path, more: str = "") -> Path:
    path = folder / "part.toml"
    path.write_text(RECIPE + more)
    return path
