"""Results of simulated parts, judged without images: quick, and with every kind of verdict."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import bgars
from bgars.ball_records import BallLayout
from bgars.inspection.judge import judge_part
from bgars.part_recipe import Limits, PartRecipe
from synthetic_parts import measured_part

LIMITS = Limits(
    true_position_um=50.0,
    diameter_um=(560.0, 640.0),
    height_um=(460.0, 540.0),
    q=(0.9, 1.1),
    flat_um=20.0,
    pitch_um=(980.0, 1020.0),
    seating_coplanarity_um=60.0,
    warpage_um=50.0,
)
RECIPE = PartRecipe(
    "two by three", BallLayout(2, 3, 1000.0), limits=LIMITS, gravity_um=(0.0, 10.0), file=Path("p.toml")
)


def judged(
    recipe: PartRecipe | None = RECIPE,
    *,
    part: int = 1,
    run: int = 0,
    noise_um: float = 0.2,
    u_um: float = 1.0,
    size: tuple[int, int] = (2, 3),
    **options: object,
) -> bgars.PartResult:
    """A part (a seed of its balls), measured in a run (a seed of the noise)."""
    scene = bgars.Scene.ball_array(*size, jitter=bgars.Jitter(4.0, 1.0, 2.0), seed=part, **options)
    setup = bgars.SimulationSetup(scene, bgars.LightRig.ring(4), bgars.Material(), bgars.Camera(pixel_pitch_um=40.0))
    _, truth = bgars.simulate(setup.scene, setup.rig, setup.material, setup.camera)
    found, measurement = measured_part(truth, noise_um=noise_um, u_um=u_um, seed=run)
    result = judge_part(
        found, measurement, recipe, pixel_pitch_um=10.0, files=(("a.png", "0" * 64),), version=bgars.__version__
    )
    return replace(
        result, method="reflectance", capture=f"part {part}", serial="SN-1", inspected_utc="2026-01-31T12:00:00Z"
    )
