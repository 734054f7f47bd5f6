"""Results for the pages under test, made from records: no image is measured."""

from __future__ import annotations

import math
from dataclasses import fields, replace
from functools import cache

import bgars
import demo_part
import numpy as np
from bgars.inspection.judge import judge_part
from bgars.records.ball_layout import BallLayout
from bgars.records.ball_result import BallResult
from bgars.records.part_material import part_material
from bgars.records.part_recipe import PartRecipe
from solder_fit import SOLDER_FIT
from synthetic_parts import measured_part

NASTY = "</script><script>document.title='owned'</script><img src=x onerror=\"document.title='owned'\">"
CAMERA = bgars.Camera(pixel_pitch_um=25.0)
RIG = bgars.LightRig.ring(4)
LIMITS = replace(demo_part.LIMITS, regression_coplanarity_um=80.0)


@cache
def simulated(kind: str) -> tuple[bgars.Capture, bgars.SimulatedTruth]:
    options: dict[str, dict[str, object]] = {
        "good": {},
        "bad": {
            "defects": {
                "B2": bgars.Defect.missing(),
                "A3": bgars.Defect.offset(70.0, 40.0),
                "D1": bgars.Defect.size(0.8),
                "D4": bgars.Defect.clipped(40.0),
            },
            "bridges": [bgars.Bridge("C2", "C3", radius_um=100.0)],
        },
    }
    scene = bgars.Scene.ball_array(4, 5, jitter=bgars.Jitter(5.0, 2.0, 3.0), seed=3, **options[kind])
    return bgars.simulate(scene, RIG, bgars.Material(), CAMERA)


def inspected(kind: str, recipe: PartRecipe | None) -> bgars.PartResult:
    _, truth = simulated(kind)
    files = (("light_00.png", "0" * 64), ("capture.toml", "f" * 64))
    result = judge_part(*measured_part(truth), recipe, pixel_pitch_um=25.0, files=files, version="1.2.3")
    return replace(result, material=part_material(SOLDER_FIT, from_file=False))


RECIPE = PartRecipe("demo 4x5", BallLayout(4, 5, 1000.0), limits=LIMITS)


def passing() -> bgars.PartResult:
    return inspected("good", RECIPE)


def failing() -> bgars.PartResult:
    return inspected("bad", RECIPE)


def undecided() -> bgars.PartResult:
    return inspected("good", None)


def listed() -> bgars.PartResult:
    """A part with a list of positions: no lattice, no pitch."""
    positions = tuple((f"P{at}", place[3], place[4]) for at, place in enumerate(RECIPE.layout.places()))
    return inspected("good", replace(RECIPE, layout=BallLayout(positions=positions)))


def unmeasured() -> bgars.PartResult:
    """NaN wherever NaN may stand."""
    result = inspected("good", RECIPE)
    holes = {entry.name: math.nan for entry in fields(BallResult) if entry.type == "float"}
    parts = {
        entry.name: math.nan for entry in fields(result) if entry.type == "float" and entry.name != "pixel_pitch_um"
    }
    checks = tuple(replace(check, value_um=math.nan, u_um=math.nan, bias_um=math.nan) for check in result.checks)
    unknown = {"light_directions": np.full((4, 3), math.nan), "light_change_deg": np.full(4, math.nan)}
    return replace(
        result,
        balls=tuple(replace(ball, **holes, verdict="undecided", reasons=("not seen",)) for ball in result.balls),
        checks=checks,
        seatings=(),
        board_coefficients_um=np.full(6, math.nan),
        verdict="undecided",
        **parts,
        **unknown,
    )


def hostile() -> bgars.PartResult:
    """Markup wherever a text may stand."""
    result = failing()
    recipe = replace(RECIPE, name=NASTY, layout=BallLayout(4, 5, 1000.0))
    seats = tuple(replace(seat, balls=(NASTY, "{{ 7 * 7 }}", "<b>C1</b>")) for seat in result.seatings)
    return replace(
        result,
        name=NASTY,
        balls=tuple(replace(ball, name=f"{ball.name}{NASTY}", reasons=(*ball.reasons, NASTY)) for ball in result.balls),
        reasons=(*result.reasons, NASTY),
        warnings=(NASTY,),
        seatings=seats,
        checks=tuple(replace(check, reason=NASTY) for check in result.checks),
        recipe=recipe,
        files=((f"{NASTY}.png", NASTY),),
        version=NASTY,
    )


def no_balls() -> bgars.PartResult:
    return replace(unmeasured(), balls=(), bridges=(), recipe=None, material=None)


RESULTS = {
    "pass": passing,
    "fail": failing,
    "undecided": undecided,
    "list of positions": listed,
    "nothing measured": unmeasured,
    "hostile": hostile,
    "no balls": no_balls,
}
