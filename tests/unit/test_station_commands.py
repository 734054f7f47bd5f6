"""What ``bgars calibrate``, ``verify`` and ``init`` do with wrong use: one line, and no file gets worse."""

from __future__ import annotations

import json
import math
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import bgars
import imageio.v3 as iio
import numpy as np
import pytest
import typer
from bgars.cli.station_output import write_pages
from bgars.io.capture import read_unlit
from bgars.records.remark import Remark
from bgars.station import response_from_bracket, verify
from bgars.station.grid_fit import fit_grid
from bgars.station.verify import Known, read_known
from numpy.typing import NDArray
from rendered_spheres import render, ring
from test_calibrate import bgars_command

RNG = np.random.default_rng(61)
LIGHTS = ring(4, 48.0)


def shoot(folder: Path, images: NDArray[np.float64]) -> Path:
    """Levels from 0 to 1 as 8-bit images."""
    folder.mkdir()
    for index, image in enumerate(images):
        levels = 255 * image + RNG.normal(0.0, 0.5, image.shape)
        iio.imwrite(folder / f"image{index}.png", np.clip(np.rint(levels), 0, 255).astype(np.uint8))
    return folder


@pytest.fixture(scope="module")
def grid(tmp_path_factory: pytest.TempPathFactory) -> Path:
    rows, cols = np.mgrid[:120, :120] + 0.5
    dots = 0.1 + 0.6 * np.clip(np.hypot(rows % 20 - 10, cols % 20 - 10) - 5.0, 0.0, 1.0)
    return shoot(tmp_path_factory.mktemp("grid") / "grid", dots[None].repeat(3, 0))


@pytest.fixture(scope="module")
def ball(tmp_path_factory: pytest.TempPathFactory) -> Path:
    images = render(LIGHTS, ball=(3.0, 2.0, 50.0), size=(140, 140), kind="matt", board=0.05, samples=2, bits=16)
    return shoot(tmp_path_factory.mktemp("ball") / "ball", (images / 65535.0) ** (1 / 1.8))


def test_calibrating_at_once_uses_the_response_that_is_known(tmp_path: Path, ball: Path) -> None:
    levels = np.linspace(0.0, 1.0, 65) ** 2
    place = tmp_path / "station.toml"
    curve = replace(response_from_bracket(*_bracket(), 255.0)[0], levels=levels, radiances=levels**1.8)
    bgars.write_station(bgars.Station("line 3", response=curve), place)
    _, cols = np.mgrid[:140, :140] / 70.0 - 1.0
    shade = 0.6 * (1.0 - 0.2 * cols**2)
    board = shoot(tmp_path / "board", (shade[None] * np.array([1.0, 0.7, 0.8, 0.9])[:, None, None]) ** (1 / 1.8))
    run = bgars_command("calibrate", "station", ball, "-o", place, "--sphere", "matt", "--board", board)
    assert run.code == 0, run.stderr
    found = bgars.read_station(place)
    assert found.flat is not None
    strengths = found.flat.coefficients[:, 0]
    np.testing.assert_allclose(strengths / strengths[0], [1.0, 0.7, 0.8, 0.9], atol=0.01)
    assert found.lights is not None
    np.testing.assert_allclose(found.lights.rig.directions, LIGHTS, atol=0.03)
    # Another response makes both wrong, which is said.
    run = bgars_command("calibrate", "response", "--srgb", "-o", place)
    assert "the flat field was calibrated without this response" in run.stdout
    assert {"flat-before-response", "lights-before-response"} <= {
        one.code for one in bgars.read_station(place).findings
    }


def _bracket() -> tuple[list[NDArray[np.float64]], list[float]]:
    light = np.linspace(0.01, 1.0, 5000).reshape(50, 100)
    times = [0.25, 0.5, 1.0]
    return [np.rint(255 * np.clip(light * time, 0, 1) ** (1 / 1.8)) for time in times], times


@pytest.mark.parametrize(("times", "words"), [([4, 2, 1], "is no brighter than image"), ([1, 1, 1], "two different")])
def test_exposure_times_in_another_order_are_refused(times: list[float], words: str) -> None:
    with pytest.raises(bgars.BgarsError, match=words):
        response_from_bracket(_bracket()[0], times, 255.0)


@pytest.mark.parametrize("wrong", ["nan", "inf", "-0.1", "1"])
def test_an_impossible_uncertainty_of_the_grid_leaves_the_station_as_it_is(
    tmp_path: Path, grid: Path, wrong: str
) -> None:
    place = tmp_path / "station.toml"
    bgars.write_station(bgars.Station("line 3", scale=bgars.Scale(3.4, 0.002)), place)
    before = place.read_bytes()
    run = bgars_command("calibrate", "scale", grid, "-o", place, "--pitch-mm", "0.5", "--u-pitch-mm", wrong)
    assert (run.code, place.read_bytes()) == (2, before)
    assert "--u-pitch-mm: must be 0 or more, and below the pitch of 0.5" in run.stderr


def test_one_image_of_a_grid_is_too_few_and_says_so(tmp_path: Path) -> None:
    folder = shoot(tmp_path / "grid", np.full((1, 60, 60), 0.5))
    run = bgars_command("calibrate", "scale", folder, "-o", tmp_path / "station.toml", "--pitch-mm", "0.5")
    assert run.code == 2
    assert "grid: 1 image, 3 are needed or more; of a grid, copies will do" in run.stderr


def test_a_camera_in_mm_without_a_scale_is_not_taken_as_infinitely_far(ball: Path) -> None:
    seen = replace(read_unlit(ball), camera_distance_mm=30.0)
    with pytest.raises(bgars.InputError, match="a camera at 30 mm needs a scale"):
        bgars.calibrate_lights(seen, "mirror")


def test_a_circle_larger_than_the_image_is_refused(ball: Path) -> None:
    seen = read_unlit(ball)
    with pytest.raises(bgars.CalibrationError, match="the ball is cut off: radius 1e\\+308 px"):
        bgars.calibrate_lights(seen, "matt", outline=(0.0, 0.0, 1e308))


def test_a_part_is_no_flat_board(ball: Path) -> None:
    with pytest.raises(bgars.CalibrationError, match="a map falls to 0: the board must be flat"):
        bgars.calibrate_flat(read_unlit(ball))


@pytest.mark.parametrize("command", [["calibrate", "lights"], ["teach"], ["verify", "--known", "k", "--station", "s"]])
def test_a_folder_given_twice_is_refused(tmp_path: Path, ball: Path, command: list[str]) -> None:
    output = [] if command[0] == "verify" else ["-o", tmp_path / "new.toml"]
    run = bgars_command(*command, ball, ball / ".." / "ball", *output)
    assert run.code == 2
    assert "ball: is given twice" in run.stderr
    assert not (tmp_path / "new.toml").exists()


@pytest.mark.parametrize("name", ["station.html", "station.balls.svg"])
def test_files_of_others_beside_a_station_stay(tmp_path: Path, ball: Path, name: str) -> None:
    (tmp_path / name).write_text("mine", encoding="utf-8")
    run = bgars_command("calibrate", "lights", ball, "-o", tmp_path / "station.toml", "--sphere", "matt")
    assert (run.code, (tmp_path / name).read_text(encoding="utf-8")) == (2, "mine")
    assert not (tmp_path / "station.toml").exists()


def test_what_was_said_of_an_earlier_calibration_goes_with_it(tmp_path: Path) -> None:
    old = tuple(Remark("doubt", "old", code) for code in ("two-highlights", "not-linear", "bias-height", "evenness"))
    station = bgars.Station("line 3", findings=old)
    for part, left in {
        "lights": {"not-linear", "bias-height", "evenness"},
        "response": {"two-highlights", "bias-height", "evenness"},
        "verified": {"two-highlights", "not-linear", "evenness"},
        "flat": {"two-highlights", "not-linear", "bias-height"},
    }.items():
        write_pages(station, [part], (), tmp_path / "station.toml")
        assert {one.code for one in bgars.read_station(tmp_path / "station.toml").findings} == left


def test_a_ball_of_the_table_without_a_reading_keeps_no_limit() -> None:
    seen = SimpleNamespace(balls=[SimpleNamespace(name="A1", top_um=500.1, diameter_um=math.nan)])
    known = {name: Known(500.0, math.nan, 0.01) for name in ("A1", "A2")}
    _, said = verify([seen], known, mpe_um=1.0)
    assert [(one.code, one.severity) for one in said] == [("mpe", "note"), ("unread-height", "fail")]
    assert "1 readings of balls of the table are missing (A2)" in said[1].message
    assert [one.severity for one in verify([seen], known)[1] if one.code == "unread-height"] == ["doubt"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("name,height_um\nA1,500,3\n", "line 2: must have 2 values, one a column, with decimal points"),
        ("name;height_um\nA1;500\n", "got name;height_um; commas separate columns"),
        ("name,height_um\n", "holds no ball"),
    ],
)
def test_a_table_of_another_spreadsheet_is_refused(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "known.csv").write_text(text, encoding="utf-8")
    with pytest.raises(bgars.BgarsError, match=words):
        read_known(tmp_path / "known.csv")


def test_verify_prints_json_of_a_single_capture(tmp_path: Path) -> None:
    folder = tmp_path / "part"
    bgars.write_simulation(
        *bgars.simulate(bgars.Scene.ball_array(2, 2), bgars.LightRig.ring(8), bgars.Material(), bgars.Camera()), folder
    )
    (tmp_path / "known.csv").write_text("name,height_um\nA1,500\n", encoding="utf-8")
    bgars.write_station(bgars.Station("line 3"), tmp_path / "station.toml")
    run = bgars_command(
        "verify", folder, "--known", tmp_path / "known.csv", "--station", tmp_path / "station.toml", "--json"
    )
    assert run.code == 0, run.stderr
    assert json.loads(run.stdout)["verified"][0]["repeatability_um"] is None


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--ring", "nan,45"], "--ring: must be COUNT,ELEVATION"),
        (["--ring", "8,45,inf"], "--ring: must be COUNT,ELEVATION"),
        (["--ring", "8,0.785"], "got 0.785, which looks like radians (45 degrees)"),
        (["--ring", "8,95"], "error: lights.ring.elevation_deg: Input should be less than 90"),
        (["--ring", "8,45", "--dark", "none.png"], "none.png: no such file"),
        (["--station", "none.toml"], "none.toml: cannot be read"),
    ],
)
def test_init_refuses_what_no_command_could_read(tmp_path: Path, options: list[str], words: str) -> None:
    run = bgars_command("init", tmp_path, *options)
    assert (run.code, list(tmp_path.iterdir())) == (2, [])
    assert words in run.stderr


def test_init_keeps_every_digit_of_the_pitch(tmp_path: Path) -> None:
    assert bgars_command("init", tmp_path, "--ring", "8,45", "--pitch-um", "3.4567891").code == 0
    assert "pixel_pitch_um = 3.4567891\n" in (tmp_path / "capture.toml").read_text(encoding="utf-8")


def test_a_grid_that_is_no_square_one_is_doubted() -> None:
    steps = np.stack(np.meshgrid(np.arange(10.0), np.arange(10.0)), axis=-1).reshape(-1, 2) - 4.5
    _, said = fit_grid(20.0 * steps * [1.03, 1.0], 500.0, None, size_px=(220, 220))
    assert (said[0].code, said[0].severity) == ("grid", "doubt")


def test_init_counts_the_images(tmp_path: Path) -> None:
    folder = shoot(tmp_path / "part", np.full((8, 6, 6), 0.5))
    run = bgars_command("init", folder, "--ring", "6,45")
    assert (run.code, (folder / "capture.toml").exists()) == (2, False)
    assert f"--ring: 6 lights, but {folder} holds 8 images, one a light" in run.stderr
    run = bgars_command("init", folder, "--ring", "4,45")
    assert run.code == 0
    assert "note: --ring: 4 lights, but 8 images: of an exposure bracket, add" in run.stdout
    lights = bgars.LightCalibration(bgars.LightRig.ring(5), *(np.full(5, 0.1),) * 3, "mirror", (), 0.0)
    bgars.write_station(bgars.Station("line 3", lights=lights), tmp_path / "station.toml")
    run = bgars_command("init", folder, "--station", tmp_path / "station.toml", "--force")
    assert run.code == 2
    assert "station.toml: 5 lights, but" in run.stderr


def test_init_asks_again_where_an_answer_cannot_be_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    answers = iter(["none.toml", "", "8", "6,45", "8,45", "3,4", "-1", "3.4"])
    monkeypatch.setattr("sys.stdin.isatty", lambda: True, raising=False)
    monkeypatch.setattr(sys.modules[typer.prompt.__module__], "visible_prompt_func", lambda _: next(answers))
    folder = shoot(tmp_path / "part", np.full((8, 6, 6), 0.5))
    run = bgars_command("init", folder)
    assert run.code == 0, run.stderr
    assert list(answers) == []
    text = (folder / "capture.toml").read_text(encoding="utf-8")
    assert "pixel_pitch_um = 3.4" in text
    assert "ring = { count = 8, elevation_deg = 45.0 }" in text
    for words in ("none.toml", "--ring: must be COUNT,ELEVATION", "8 images, one a light", "must be a number"):
        assert words in run.stdout + run.stderr


@pytest.mark.parametrize("name", ["capture.toml", "station.toml"])
def test_a_station_file_is_not_put_among_the_images_that_are_read(tmp_path: Path, grid: Path, name: str) -> None:
    board = grid.parent / "board"
    board.mkdir(exist_ok=True)
    runs = [
        ("response", grid, "-o", grid / name, "--exposures", "1,2,4"),
        ("scale", grid, "-o", grid / name, "--pitch-mm", "1"),
        ("lights", grid, board, "-o", board / name),
        ("flat", grid, "-o", grid / name),
        ("station", grid, "-o", board / name, "--board", board),
    ]
    words = "is the name of the description" if name == "capture.toml" else ", which this command reads"
    for arguments in runs:
        run = bgars_command("calibrate", *arguments)
        assert (run.code, run.stdout) == (2, "")
        assert words in run.stderr
        assert len(run.stderr.splitlines()) == 1
    assert not list(grid.glob("*.toml"))
    run = bgars_command("calibrate", "response", "--srgb", "-o", tmp_path / "capture.toml")
    assert run.code == 2
    assert not (tmp_path / "capture.toml").exists()
