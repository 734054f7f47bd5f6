"""Lights from the solder balls of a part."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import bgars
import numpy as np
import pytest
from numpy.typing import NDArray
from typer.testing import CliRunner

Array = NDArray[np.float64]
DATA = Path(os.environ.get("BGARS_DATA", "missing")) / "reality"


def on_axes_deg(found: Array, true: Array) -> Array:
    level = np.cross([0.0, 0.0, 1.0], true)
    level /= np.linalg.norm(level, axis=1, keepdims=True)
    return np.degrees(
        np.stack([np.sum((found - true) * axis, axis=1) for axis in (level, np.cross(true, level))], axis=1)
    )


@pytest.fixture(scope="module")
def part() -> tuple[bgars.Capture, Array]:
    """A simulated part of nine balls whose rig is stated wrong by about a degree, each light on its own."""
    rng = np.random.default_rng(5)
    rig = bgars.LightRig.ring(8)
    scene = bgars.Scene.ball_array(3, 3, pitch_um=800.0, diameter_um=450.0, height_um=400.0)
    capture, _ = bgars.simulate(scene, rig, bgars.Material(), bgars.Camera(pixel_pitch_um=12.0))
    wrong = rig.directions + rng.normal(0.0, 0.012, (8, 3))
    stated = bgars.LightRig.from_directions(wrong / np.linalg.norm(wrong, axis=1, keepdims=True), files=rig.files)
    return replace(capture, rig=replace(stated, intensities=rig.intensities)), rig.directions


def test_the_balls_of_a_part_show_where_its_lights_are(part: tuple[bgars.Capture, Array]) -> None:
    capture, true = part
    found = bgars.calibrate_lights(capture, sphere="balls")
    off = on_axes_deg(found.rig.directions, true)
    before = on_axes_deg(capture.rig.directions, true)
    assert found.sphere == "balls"
    assert len(found.balls) == 9
    assert float(np.abs(off[:, 0]).mean()) < 0.1 * float(np.abs(before[:, 0]).mean())
    assert (np.abs(off) < 3.0 * found.u_deg[:, None]).all()
    assert (found.u_common_deg <= found.u_deg).all()
    np.testing.assert_allclose(np.hypot(found.u_own_deg, found.u_common_deg), found.u_deg, rtol=1e-6)
    assert {"roundness-unknown"} <= {one.code for one in found.findings}


def test_the_stated_u_of_the_rig_is_no_prior_of_what_is_measured(part: tuple[bgars.Capture, Array]) -> None:
    capture, _ = part
    sure = replace(capture, rig=replace(capture.rig, u_deg=np.full(8, 0.01)))
    one, other = (bgars.calibrate_lights(each, sphere="balls") for each in (capture, sure))
    np.testing.assert_array_equal(one.rig.directions, other.rig.directions)


@pytest.mark.parametrize(
    ("sphere", "more", "message"),
    [
        ("balls", {"outline": (0.0, 0.0, 50.0)}, "outline: does not go with sphere 'balls'"),
        ("balls", {"diameter_um": 500.0}, "diameter_um: does not go with sphere 'balls'"),
        ("mirror", {"recipe": "part.toml"}, "recipe: goes with sphere 'balls' only"),
        ("ball", {}, "sphere: must be 'mirror', 'matt' or 'balls', got 'ball'"),
    ],
)
def test_arguments_that_do_not_go_together_are_refused(
    part: tuple[bgars.Capture, Array], sphere: str, more: dict[str, object], message: str
) -> None:
    with pytest.raises(bgars.InputError, match=message):
        bgars.calibrate_lights(part[0], sphere, **more)  # type: ignore[arg-type]


def test_a_part_without_a_scale_is_refused(part: tuple[bgars.Capture, Array]) -> None:
    with pytest.raises(bgars.InputError, match="pixel_pitch_um: needed with sphere 'balls'"):
        bgars.calibrate_lights(replace(part[0], pixel_pitch_um=None), sphere="balls")


def test_a_board_without_balls_is_refused(part: tuple[bgars.Capture, Array]) -> None:
    bare = replace(part[0], images=np.full_like(part[0].images, 90))
    with pytest.raises(bgars.BgarsError, match="no solder balls found"):
        bgars.calibrate_lights(bare, sphere="balls")


@pytest.mark.skipif(not DATA.is_dir(), reason="needs BGARS_DATA")
def test_the_command_keeps_lights_of_a_part(tmp_path: Path) -> None:
    from bgars.cli.app import app  # noqa: PLC0415

    output = tmp_path / "station.toml"
    recipe = DATA / "3" / "part.toml"
    command = ["calibrate", "lights", str(DATA / "3"), "--sphere", "balls", "--recipe", str(recipe), "-o", str(output)]
    result = CliRunner().invoke(app, command)
    assert result.exit_code == 0, result.output
    kept = bgars.read_station(output).lights
    assert kept is not None
    assert kept.sphere == "balls"
    assert len(kept.rig) == 8
    assert output.with_suffix(".html").exists()
