"""Whole inspections of simulated parts: images in, verdict out, judged by the truth."""

from __future__ import annotations

from pathlib import Path

import bgars
import pytest
from bgars.records.ball_layout import BallLayout
from bgars.records.part_recipe import Limits, PartRecipe

LIMITS = Limits(
    true_position_um=30.0, diameter_um=(570.0, 630.0), height_um=(465.0, 535.0), seating_coplanarity_um=60.0
)
RECIPE = PartRecipe("simulated", BallLayout(rows=3, cols=4, pitch_um=1000.0), limits=LIMITS)
DEFECTS = {
    "A2": bgars.Defect.missing(),
    "B3": bgars.Defect.offset(50.0, -20.0),
    "C1": bgars.Defect.size(0.85),
    "C4": bgars.Defect.size(1.1),
}


def photographed(
    seed: int, defects: dict[str, bgars.Defect], bridges: tuple[bgars.Bridge, ...] = (), elevation_deg: float = 45.0
) -> tuple[bgars.Capture, bgars.SimulatedTruth]:
    scene = bgars.Scene.ball_array(
        3,
        4,
        jitter=bgars.Jitter(6.0, 3.0, 4.0),
        defects=defects,
        bridges=bridges,
        rotation_deg=0.3 * seed,
        seed=seed,
        board=bgars.Board(
            material=bgars.Material(i_d=0.2, i_s=0.0),
            texture=bgars.Texture(0.2),
            bow_um=10.0 * seed,
            bow_radius_um=2500.0,
        ),
    )
    camera = bgars.Camera(pixel_pitch_um=12.0, full_well_e=20000.0)
    rig = bgars.LightRig.ring(8, elevation_deg=elevation_deg)
    return bgars.simulate(scene, rig, bgars.Material(i_d=0.5, i_s=1.0, hardness=40), camera, seed=seed)


@pytest.mark.parametrize(("seed", "elevation_deg"), [(1, 45.0), (2, 50.0)])
def test_a_good_part_never_fails_and_no_ball_of_it(seed: int, elevation_deg: float) -> None:
    capture, truth = photographed(seed, {}, elevation_deg=elevation_deg)
    result = bgars.inspect(capture, RECIPE)
    assert result.verdict == "pass", result.reasons
    assert truth.seating_coplanarity_um is not None
    u_um = result.u_seating_coplanarity_um
    error_um = result.seating_coplanarity_um - truth.seating_coplanarity_um
    assert abs(error_um) <= max(1.0, 4 * u_um + result.seating_noise_bias_um)


def test_each_defect_is_the_only_thing_that_fails() -> None:
    capture, truth = photographed(3, DEFECTS)
    result = bgars.inspect(capture, RECIPE)
    assert result.verdict == "fail"
    assert {ball.name for ball in result.balls if ball.verdict == "fail"} == set(DEFECTS)
    assert [ball.name for ball in result.balls if not ball.present] == ["A2"]
    for ball, true in zip(result.balls, truth.balls, strict=True):
        assert ball.name == true.name
        if true.present:
            assert ball.top_um == pytest.approx(true.top_um, abs=2.0)


def test_a_recipe_of_another_pitch_is_refused_by_file_and_key(tmp_path: Path) -> None:
    capture, _ = photographed(1, {})
    path = tmp_path / "part.toml"
    for pitch_um, words in ((880, "pitch_um: must be within 10 %"), (700, "pitch_um: must be within 10 %")):
        path.write_text(f'name = "p"\nrows = 3\ncols = 4\npitch_um = {pitch_um}\n', encoding="utf-8")
        with pytest.raises(bgars.InputError) as caught:
            bgars.inspect(capture, path)
        assert str(caught.value).startswith(f"{path}: {words}")


def test_a_bridge_fails_with_or_without_a_recipe() -> None:
    capture, _ = photographed(4, {}, (bgars.Bridge("B2", "B3", radius_um=120.0),))
    assert bgars.inspect(capture).verdict == "fail"
    result = bgars.inspect(capture, RECIPE)
    assert result.verdict == "fail"
    assert ("B2", "B3") in result.bridges
    assert {ball.name for ball in result.balls if ball.verdict == "fail" and ball.kind != "extra"} == {"B2", "B3"}


def test_a_board_without_balls_is_undecided_and_gives_no_number() -> None:
    camera = bgars.Camera(pixel_pitch_um=20.0)
    scene = bgars.Scene.plane(size_um=(4000.0, 4000.0))
    capture, _ = bgars.simulate(scene, bgars.LightRig.ring(8), bgars.Material(), camera)
    result = bgars.inspect(capture, RECIPE)
    assert result.verdict == "undecided"
    assert result.reasons[0].startswith("no ball was found: this cannot be judged")
    assert result.to_dict()["seating_coplanarity_um"] is None
