"""Calibration of the material: from balls to a file, from the file to the next capture."""

from __future__ import annotations

import contextlib
import io
import json
import sys
from pathlib import Path
from typing import NamedTuple

import bgars
import imageio.v3 as iio
import numpy as np
import pytest
from bgars.cli import main
from bgars.records.reflectance_fit import loss_in_words

RING = bgars.LightRig.ring(8)
SOLDER = bgars.Material(i_d=0.3, i_s=1.0, hardness=40)


class Result(NamedTuple):
    """What a command said."""

    code: int
    stdout: str
    stderr: str


def bgars_command(*arguments: object) -> Result:
    """Run a command in this process: what is tested is what it does, not how Python starts."""
    stdout, stderr = io.StringIO(), io.StringIO()
    with (
        pytest.MonkeyPatch.context() as patch,
        contextlib.redirect_stdout(stdout),
        contextlib.redirect_stderr(stderr),
    ):
        patch.setattr(sys, "argv", ["bgars", *map(str, arguments)])
        with pytest.raises(SystemExit) as stop:
            main()
    return Result(int(stop.value.code or 0), stdout.getvalue(), stderr.getvalue())


@pytest.fixture(scope="module")
def balls_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("part")
    bgars.write_simulation(*bgars.simulate(bgars.Scene.ball_array(2, 2), RING, SOLDER, bgars.Camera()), folder)
    return folder


@pytest.fixture(scope="module")
def solder_file(balls_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("material") / "solder.toml"
    run = bgars_command("calibrate", "material", balls_folder, "-o", path)
    assert run.code == 0, run.stderr
    assert run.stderr == ""
    for words in (
        "fitted on 4 balls under 8 lights",
        "diffuse light",
        "+-",
        "very well",
        "gains of the lights",
        str(path),
    ):
        assert words in run.stdout
    return path


def test_the_file_holds_the_simulated_material(solder_file: Path) -> None:
    material = bgars.read_material(solder_file)
    (lobe,) = material.lobes
    # At this roughness both kinds of masking explain whole grey levels equally well: mean loss 0.003 either way.
    assert material.masking in {"cook-torrance", "smith"}
    assert material.diffuse_level == pytest.approx(255 * SOLDER.i_d, rel=0.01)
    assert lobe.strength_level == pytest.approx(255 * SOLDER.i_s, rel=0.03)
    assert lobe.roughness == pytest.approx(SOLDER.lobes[0].roughness, rel=0.03)
    assert lobe.tail == pytest.approx(0.0, abs=0.05)
    np.testing.assert_allclose(material.gains, 1.0, atol=0.01)
    assert 0 < material.standard_errors["diffuse"] < 1
    assert "balls = 4" in solder_file.read_text(encoding="utf-8")


def test_a_reference_sphere_gives_the_same_material(tmp_path: Path, solder_file: Path) -> None:
    bgars.write_simulation(*bgars.simulate(bgars.Scene.hemisphere(300.0), RING, SOLDER, bgars.Camera()), tmp_path / "s")
    truth = bgars.read_truth(tmp_path / "s")
    iio.imwrite(tmp_path / "ball.png", np.where(truth.mask, 255, 0).astype(np.uint8))
    command = ("calibrate", "material", tmp_path / "s", "--sphere-mask", tmp_path / "ball.png")
    run = bgars_command(*command, "-o", tmp_path / "sphere.toml", "--json")
    assert run.code == 0, run.stderr
    summary = json.loads(run.stdout)
    assert (summary["balls"], summary["accepted"], summary["explains"]) == (1, True, "very well")
    material, other = bgars.read_material(tmp_path / "sphere.toml"), bgars.read_material(solder_file)
    assert summary["material"]["diffuse_level"] == material.diffuse_level
    assert material.diffuse_level == pytest.approx(other.diffuse_level, rel=0.02)
    assert material.lobes[0].roughness == pytest.approx(other.lobes[0].roughness, rel=0.03)


def test_the_commands_use_the_file_and_say_so(tmp_path: Path, balls_folder: Path, solder_file: Path) -> None:
    run = bgars_command("normals", balls_folder, "-o", tmp_path / "n", "--material", solder_file, "--json")
    assert run.code == 0, run.stderr
    summary = json.loads(run.stdout)
    assert summary["method"] == "reflectance"
    assert "material given" in summary["choice"]
    assert 0.9 < summary["measured_share"] <= 1.0
    assert summary["reflectance"]["material"]["diffuse_level"] == bgars.read_material(solder_file).diffuse_level
    run = bgars_command("evaluate", balls_folder, "--material", solder_file)
    assert run.code == 0, run.stderr
    for words in ("measured (%)", "within 1 s.e. (%)", "reflectance used: reflectance on balls", "material given"):
        assert words in run.stdout
    result = bgars.reconstruct(bgars.read_capture(balls_folder), material=bgars.read_material(solder_file))
    result = json.loads(json.dumps(result.summary()))
    for key in ("choice", "measured_share", "reflectance"):
        assert result["normals"][key] == summary[key]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--threshold", 40), "threshold: only the method specular-filter uses it, got method 'reflectance'"),
        (("-m", "robust-filter", "--threshold", 40), "threshold: only the method specular-filter"),
        (("-m", "lambertian", "--material", "FILE"), "material: only the method reflectance uses it"),
        (("--material", "nowhere.toml"), "nowhere.toml: cannot be read"),
    ],
)
@pytest.mark.parametrize("command", ["normals", "reconstruct"])
def test_options_that_a_method_does_not_use_are_refused(
    tmp_path: Path, balls_folder: Path, solder_file: Path, command: str, options: tuple[object, ...], words: str
) -> None:
    given = [solder_file if option == "FILE" else option for option in options]
    run = bgars_command(command, balls_folder, "-o", tmp_path / "out", *given)
    assert run.code == 2
    assert words in run.stderr
    assert list(tmp_path.iterdir()) == []


def test_without_a_ball_nothing_is_calibrated(tmp_path: Path, balls_folder: Path) -> None:
    flat = tmp_path / "flat"
    bgars.write_simulation(*bgars.simulate(bgars.Scene.plane(), RING, SOLDER, bgars.Camera()), flat)
    run = bgars_command("calibrate", "material", flat, "-o", tmp_path / "solder.toml")
    assert run.code == 2
    assert "flat: no ball found, so no known shape to fit a material on" in run.stderr
    run = bgars_command("calibrate", "material", balls_folder, "-o", tmp_path / "solder.txt")
    assert run.code == 2
    assert "must end in .toml" in run.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["flat"]


def test_a_fit_that_explains_nothing_is_refused() -> None:
    noise = np.random.default_rng(0).integers(0, 255, (8, 80, 80), dtype=np.uint8)
    capture = bgars.Capture(images=noise, rig=RING, mask=np.ones((80, 80), np.bool_), saturation=255.0)
    with pytest.raises(bgars.CalibrationError, match=r"no material explains the balls \(loss \d\.\d\d, at most 2"):
        bgars.calibrate_material(capture, anchors=[[0.0, 0.0, 30.0]])


def test_a_material_needs_four_lights() -> None:
    capture, _ = bgars.simulate(bgars.Scene.hemisphere(200.0), bgars.LightRig.ring(3), SOLDER, bgars.Camera())
    with pytest.raises(bgars.CalibrationError, match="needs 4 lights or more, the capture has 3"):
        bgars.calibrate_material(capture)


def test_the_loss_is_put_into_words() -> None:
    capture, _ = bgars.simulate(bgars.Scene.hemisphere(200.0), RING, SOLDER, bgars.Camera())
    fit = bgars.calibrate_material(capture, anchors=[[0.0, 0.0, 20.0]])
    assert loss_in_words(fit.loss, accepted=fit.accepted) == "very well"
    judged = [loss_in_words(loss, accepted=loss <= 2.0).partition(":")[0] for loss in (0.102, 0.6, 2.5)]
    assert judged == ["well", "roughly", "badly"]
