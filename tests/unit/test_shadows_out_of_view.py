"""Shadows outside the image accuse no light; what is left of them still tells a knocked lamp and swapped images."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import bgars
import numpy as np
import pytest
from bgars.files.light_names import named_lights

UNJUDGED = "cannot be judged by their shadows"


@pytest.fixture(scope="module")
def sample() -> bgars.Capture:
    """The sample that ships: one ball, whose shadows end outside the image under every light."""
    return bgars.read_capture(bgars.sample_capture())


def turned(capture: bgars.Capture, light: int, deg: float) -> bgars.Capture:
    angles = np.column_stack([capture.rig.azimuths_deg, capture.rig.elevations_deg])
    angles[light, 0] += deg
    return replace(capture, rig=bgars.LightRig.from_angles(angles))


def accused(result: bgars.PartResult) -> set[int]:
    texts = [text for text in (*result.warnings, *result.reasons) if UNJUDGED not in text]
    return {light for text in texts for light in named_lights(text)}


def test_an_exact_rig_is_not_accused_by_shadows_that_nobody_sees(sample: bgars.Capture) -> None:
    result = bgars.inspect(sample)
    assert accused(result) == set()
    assert [text for text in result.warnings if UNJUDGED in text]
    assert result.balls[0].top_um == pytest.approx(500.0, abs=1.0)


@pytest.mark.parametrize("light", [0, 5])
def test_a_lamp_turned_by_nine_degrees_is_named_by_what_is_left_of_its_shadow(
    sample: bgars.Capture, light: int
) -> None:
    assert accused(bgars.inspect(turned(sample, light, 9.0))) == {light}


@pytest.mark.parametrize("pair", [(0, 4), (2, 5)])
def test_swapped_images_are_named_by_what_is_left_of_their_shadows(
    sample: bgars.Capture, pair: tuple[int, int]
) -> None:
    images = sample.images.copy()
    images[list(pair)] = images[list(pair[::-1])]
    assert accused(bgars.inspect(replace(sample, images=images), check=False)) == set(pair)


def test_a_lamp_turned_by_nine_degrees_is_caught_on_a_part() -> None:
    rig = bgars.LightRig.ring(8)
    scene = bgars.Scene.ball_array(3, 3, board=bgars.Board(bgars.Material.matte(0.3)))
    capture, _ = bgars.simulate(scene, rig, bgars.Material(), bgars.Camera(supersample=2))
    result = bgars.inspect(turned(capture, 5, 9.0))
    assert accused(result) == {5}
    assert result.verdict != "pass"


@pytest.mark.parametrize("elevation_deg", [30.0, 45.0])
def test_one_ball_in_a_narrow_image_is_measured_or_not_but_accuses_nobody(elevation_deg: float) -> None:
    """At 30 degrees the fit has so little to go on that it runs away: once a ValueError about NaN."""
    camera = bgars.Camera(pixel_pitch_um=10.0, shape=(90, 90))
    rig = bgars.LightRig.ring(8, elevation_deg=elevation_deg)
    capture, _ = bgars.simulate(bgars.Scene.ball(600.0, height_um=500.0), rig, bgars.Material(), camera)
    result = bgars.inspect(capture)
    assert accused(result) == set()
    assert any(UNJUDGED in text for text in result.warnings)


def test_the_warpage_of_one_ball_is_not_measured(sample: bgars.Capture, tmp_path: Path) -> None:
    """Nor without any usable light: it was 0.00 um with U = 0 um."""
    dark = replace(sample, images=np.where(sample.images > 40, sample.images, 0).astype(np.uint8))
    for capture in (sample, dark):
        result = bgars.inspect(capture)
        assert np.isnan(result.warpage_um)
        assert np.isnan(result.u_warpage_um)
        (tmp_path / "result.json").write_text(result.to_json(), encoding="utf-8")
        assert json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))["warpage_um"] is None
        assert np.isnan(bgars.read_result(tmp_path).warpage_um)
