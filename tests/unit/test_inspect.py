"""`bgars.inspect` and the command: verdicts and exit codes, bad captures, nothing half-written."""

from __future__ import annotations

import csv
import hashlib
import json
import sys
from dataclasses import replace
from pathlib import Path

import bgars
import imageio.v3 as iio
import numpy as np
import pytest
from bgars.cli.app import app
from bgars.cli.console import EXIT_BAD_INPUT
from bgars.inspection.exposure import check_capture
from bgars.pipelines import inspect as inspection_pipeline
from bgars.records.ball_layout import BallLayout
from bgars.records.found_balls import FoundBalls
from bgars.records.measured_balls import BallMeasurement
from bgars.report.figures.part import PICTURES
from synthetic_parts import measured_part
from typer.testing import CliRunner

PAGE = {"report.html", "photograph.jpg", "report.json", "surface.npz"}
OUTPUTS = {"result.json", "balls.csv", "part.png", "shadows.png", "deviations.png", "histograms.png", *PAGE}
LIMITS = (
    "[limits]\ntrue_position_um = 50.0\ndiameter_um = [560.0, 640.0]\nheight_um = [460.0, 540.0]\n"
    "seating_coplanarity_um = 60.0\n"
)
PART = 'name = "two by three"\nrows = 2\ncols = 3\npitch_um = 1000.0\n'


def simulation(**options: object) -> bgars.SimulationSetup:
    scene = bgars.Scene.ball_array(2, 3, jitter=bgars.Jitter(4.0, 1.0, 2.0), seed=1, **options)
    return bgars.SimulationSetup(scene, bgars.LightRig.ring(4), bgars.Material(), bgars.Camera(pixel_pitch_um=40.0))


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A simulated capture whose balls are found and measured as its truth says, with a little noise."""
    setup = simulation()
    bgars.write_simulation(*bgars.simulate(setup.scene, setup.rig, setup.material, setup.camera), tmp_path / "part")
    stand_in(monkeypatch, setup)
    return tmp_path / "part"


@pytest.fixture
def quick(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The same without the pictures, which take a second each."""

    def touch(_: object, __: object, place: Path) -> dict[str, str]:
        for name in PICTURES:
            iio.imwrite(place / name, np.zeros((2, 2), np.uint8))
        return PICTURES

    monkeypatch.setattr(bgars, "write_part_pictures", touch)
    return folder


def stand_in(monkeypatch: pytest.MonkeyPatch, setup: bgars.SimulationSetup) -> None:
    _, truth = bgars.simulate(setup.scene, setup.rig, setup.material, setup.camera)
    found, measurement = measured_part(truth)
    monkeypatch.setattr(inspection_pipeline, "_found", lambda *_: found)
    # Any normals: the page has a surface to keep, no reading hangs on it.
    monkeypatch.setattr(
        inspection_pipeline,
        "_measured",
        lambda capture, *_: (measurement, bgars.estimate_normals(capture, method="lambertian")),
    )


def recipe(folder: Path, text: str = PART + LIMITS) -> Path:
    path = folder.parent / "part.toml"
    path.write_text(text, encoding="utf-8")
    return path


def command(*arguments: object) -> tuple[int, str]:
    run = CliRunner().invoke(app, ["inspect", *map(str, arguments)])
    if isinstance(run.exception, bgars.BgarsError):  # as main() turns it into one line
        return EXIT_BAD_INPUT, str(run.exception)
    return run.exit_code, run.output


def test_a_good_part_passes_with_exit_code_0(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    code, text = command(folder, "--recipe", recipe(folder), "-o", out)
    assert code == 0, text
    assert "two by three: PASS" in text
    assert {path.name for path in out.iterdir()} == OUTPUTS
    values = json.loads((out / "result.json").read_text(encoding="utf-8"))
    assert values["verdict"] == "pass"
    rows = list(csv.DictReader((out / "balls.csv").read_text(encoding="utf-8").splitlines()))
    assert [row["name"] for row in rows] == ["A1", "A2", "A3", "B1", "B2", "B3"]
    assert float(rows[0]["top_um"]) == pytest.approx(values["balls"][0]["top_um"], abs=1e-3)


def test_every_input_file_is_listed_with_its_checksum(quick: Path) -> None:
    path = recipe(quick)
    result = bgars.inspect(bgars.read_capture(quick), path)
    digests = dict(result.files)
    used = {"capture.toml", "part.toml", "light_00.png", "light_03.png"}
    assert used <= set(digests)
    for name in used:
        file = path if name == "part.toml" else quick / name
        assert digests[name] == hashlib.sha256(file.read_bytes()).hexdigest()
    assert result.version == bgars.__version__


def test_a_failing_part_has_exit_code_1_and_says_fail(
    quick: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stand_in(monkeypatch, simulation(defects={"B2": bgars.Defect.missing()}))
    code, text = command(quick, "--recipe", recipe(quick), "-o", tmp_path / "out")
    assert code == 1
    assert "two by three: FAIL" in text
    assert "1 ball missing: B2" in text
    assert {path.name for path in (tmp_path / "out").iterdir()} == OUTPUTS


def test_without_a_recipe_it_is_undecided_with_exit_code_1(quick: Path, tmp_path: Path) -> None:
    code, text = command(quick, "-o", tmp_path / "out")
    assert code == 1
    assert "part: UNDECIDED" in text
    assert "no limits given" in text


def test_json_for_machines(quick: Path, tmp_path: Path) -> None:
    code, text = command(quick, "--recipe", recipe(quick), "-o", tmp_path / "out", "--json")
    assert code == 0
    values = json.loads(text)
    assert values["verdict"] == "pass"
    assert set(values["output"]) == OUTPUTS


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (PART + "[limits]\ndiameter = [560, 640]\n", "nearest known key is 'diameter_um'"),
        ('name = "p"\nrows = 2\n', "missing: cols, pitch_um"),
    ],
)
def test_a_wrong_recipe_is_exit_code_2_and_leaves_nothing(quick: Path, tmp_path: Path, text: str, words: str) -> None:
    out = tmp_path / "out"
    code, message = command(quick, "--recipe", recipe(quick, text), "-o", out)
    assert code == 2
    assert words in message
    assert not out.exists()


@pytest.mark.parametrize("stage", ["_found", "_measured", "judge_part"])
def test_a_stage_that_fails_leaves_nothing(
    quick: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, stage: str
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise bgars.CalibrationError("lights do not fit")

    monkeypatch.setattr(inspection_pipeline, stage, fail)
    code, message = command(quick, "--recipe", recipe(quick), "-o", tmp_path / "deep" / "out")
    assert (code, message) == (2, "lights do not fit")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["part", "part.toml"]


def test_an_output_that_is_a_file_is_refused_before_the_work(quick: Path, tmp_path: Path) -> None:
    (tmp_path / "out").write_text("mine", encoding="utf-8")
    code, message = command(quick, "-o", tmp_path / "out")
    assert code == 2
    assert "is a file, not a folder" in message
    assert (tmp_path / "out").read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize(
    ("level", "words"), [(0, ["light_02.png", "black", "0.0 %"]), (255, ["light_02.png", "saturated", "50 %", "100 %"])]
)
def test_a_dead_or_saturated_light_is_refused_by_name(
    quick: Path, tmp_path: Path, level: int, words: list[str]
) -> None:
    shape = iio.imread(quick / "light_02.png").shape
    iio.imwrite(quick / "light_02.png", np.full(shape, level, np.uint8))
    code, message = command(quick, "--recipe", recipe(quick), "-o", tmp_path / "out")
    assert code == 2
    for word in words:
        assert word in message
    assert not (tmp_path / "out").exists()


def test_a_capture_without_a_scale_is_refused(quick: Path) -> None:
    capture = replace(bgars.read_capture(quick), pixel_pitch_um=None)
    with pytest.raises(bgars.InputError, match="pixel_pitch_um: needed to inspect"):
        bgars.inspect(capture)


def test_a_light_as_dark_as_the_dark_frame_is_black(quick: Path) -> None:
    capture = bgars.read_capture(quick)
    images = capture.images.copy()
    images[1] = 30
    dark = np.full(images.shape[1:], 29, images.dtype)
    with pytest.raises(bgars.InputError, match="black"):
        check_capture(replace(capture, images=images, dark=dark))
    check_capture(replace(capture, images=images))


def test_a_capture_with_no_ball_is_undecided(quick: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    nothing = FoundBalls((), (), (), 0, 0, None, 0.0, (0.0, 0.0))
    measurement = BallMeasurement((), np.full(6, np.nan), np.eye(4, 3), np.zeros(4), float("nan"))
    monkeypatch.setattr(inspection_pipeline, "_found", lambda *_: nothing)
    monkeypatch.setattr(inspection_pipeline, "_measured", lambda *_: (measurement, None))
    for options in (["--recipe", recipe(quick)], []):
        code, text = command(quick, *options, "-o", tmp_path / "out")
        assert code == 1
        assert "UNDECIDED" in text
        assert "no ball was found: this cannot be judged" in text
    values = json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))
    assert values["seating_coplanarity_um"] is None
    assert values["balls"] == []


def test_the_finder_gets_the_layout_as_the_camera_sees_it(quick: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[BallLayout] = []
    setup = simulation()
    _, truth = bgars.simulate(setup.scene, setup.rig, setup.material, setup.camera)
    found, measurement = measured_part(truth)

    def find(_: object, part: bgars.PartRecipe, *__: object) -> FoundBalls:
        seen.append(part.image_layout)
        return found

    monkeypatch.setattr(inspection_pipeline, "_found", find)
    monkeypatch.setattr(inspection_pipeline, "_measured", lambda *_: (measurement, None))
    text = PART + 'view = "top"\ndepopulated = ["A1"]\n' + LIMITS
    result = bgars.inspect(bgars.read_capture(quick), recipe(quick, text))
    assert seen[0].depopulated == ("A3",)
    assert result.verdict == "fail"
    assert result.balls[-1].kind == "extra"


def test_the_material_of_the_recipe_is_used_or_said_to_be_unused(quick: Path) -> None:
    capture = bgars.read_capture(quick)
    lobe = bgars.SurfaceLobe(strength_level=255.0, roughness=0.22, tail=0.0)
    material = bgars.SurfaceMaterial(127.0, 0.0, 0.0, (lobe,), "cook-torrance", (1.0,) * len(capture.rig))
    bgars.write_material(material, quick.parent / "solder.toml")
    part = recipe(quick, PART + LIMITS + '[material]\nfile = "solder.toml"\n')
    assert not any("material.file" in warning for warning in bgars.inspect(capture, part).warnings)
    unused = bgars.inspect(capture, part, method="robust-filter")
    assert any("material.file" in warning for warning in unused.warnings)
    bgars.write_material(replace(material, gains=(1.0,) * 5), quick.parent / "solder.toml")
    with pytest.raises(bgars.InputError, match=r"solder\.toml: gains: .* 4 lights, got 5"):
        bgars.inspect(capture, part)
    (quick.parent / "solder.toml").write_text("diffuse_level = -1\n", encoding="utf-8")
    with pytest.raises(bgars.BgarsError, match=r"solder\.toml"):
        bgars.inspect(capture, part)


def test_serial_parquet_cfx_and_the_log_line_of_the_command(quick: Path, tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    out = tmp_path / "out"
    options = ("--recipe", recipe(quick), "--serial", "SN 7", "--parquet", "--cfx", "--log")
    code, text = command(quick, "-o", out, *options)
    assert code == 0, text
    assert {path.name for path in out.iterdir()} == OUTPUTS | {"balls.parquet", "cfx.json"}
    result = bgars.read_result(out)
    assert text == result.summary_line() + "\n"
    assert (result.serial, result.capture, result.method) == ("SN 7", "part", "reflectance")
    assert result.inspected_utc.endswith("Z")
    assert json.loads((out / "cfx.json").read_text(encoding="utf-8")) == bgars.to_cfx(result)
    code, text = command(quick, "-o", out, "--log", "--json")
    assert (code, text) == (EXIT_BAD_INPUT, "--log and --json: give one of them")


def test_without_pyarrow_the_command_leaves_nothing(
    quick: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    code, text = command(quick, "-o", tmp_path / "out", "--parquet")
    assert code == EXIT_BAD_INPUT
    assert "bgars[parquet]" in text
    assert not (tmp_path / "out").exists()
