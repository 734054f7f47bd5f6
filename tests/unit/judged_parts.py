"""Results of simulated parts, judged without images: quick, and with every kind of verdict."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path

import bgars
import numpy as np
from bgars.inspection.judge import judge_part
from bgars.records.ball_layout import BallLayout
from bgars.records.part_material import part_material
from bgars.records.part_recipe import Limits, PartRecipe
from solder_fit import SOLDER_FIT
from synthetic_parts import measured_part

LIMITS = Limits(
    true_position_um=50.0,
    diameter_um=(560.0, 640.0),
    height_um=(460.0, 540.0),
    aspect_ratio=(0.9, 1.1),
    flat_top_depth_um=20.0,
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
    digest = hashlib.sha256(f"{part} {run}".encode()).hexdigest()
    result = judge_part(
        found, measurement, recipe, pixel_pitch_um=10.0, files=(("a.png", digest),), version=bgars.__version__
    )
    # The stand-in's board has no noise of its own.
    warpage_um = 5.0 + noise_um * float(np.random.default_rng([7, part, run]).standard_normal())
    result = replace(result, warpage_um=warpage_um)
    return replace(
        result,
        method="reflectance",
        material=part_material(SOLDER_FIT, from_file=False),
        capture=f"part {part}",
        serial="SN-1",
        inspected_utc="2026-01-31T12:00:00Z",
    )


def write_study(folder: Path, *, parts: int = 3, placements: int = 2, repeats: int = 3, noise_um: float = 0.2) -> Path:
    """The folders of a gauge study."""
    for part in range(1, parts + 1):
        for placement in range(1, placements + 1):
            for repeat in range(1, repeats + 1):
                place = folder / f"part{part}" / f"place{placement}" / str(repeat)
                place.mkdir(parents=True)
                result = judged(part=part, run=100 * part + 10 * placement + repeat, noise_um=noise_um)
                (place / "result.json").write_text(result.to_json(), encoding="utf-8")
    return folder


def write_results(folder: Path, count: int, **changes: float) -> Path:
    """Results of consecutive parts, an hour apart; `changes` are added from the middle on."""
    for number in range(count):
        result = judged(part=number + 1, run=number, noise_um=0.3)
        balls = tuple(replace(ball, **{k: getattr(ball, k) + v for k, v in changes.items()}) for ball in result.balls)
        stamp = f"2026-01-{1 + number // 24:02d}T{number % 24:02d}:00:00Z"
        place = folder / f"r{number}"
        place.mkdir(parents=True)
        text = replace(result, balls=balls if number >= count // 2 else result.balls, inspected_utc=stamp).to_json()
        (place / "result.json").write_text(text, encoding="utf-8")
    return folder
