"""Options of ``bgars calibrate``: named as they were typed, with their values; what was known before is kept."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import bgars
import numpy as np
import pytest
from bgars.cli.measured_scale import measured_scale
from bgars.io.capture import read_unlit
from rendered_spheres import ring
from test_calibrate import bgars_command
from test_station_commands import shoot

KNOWN = bgars.Station("line 3", scale=bgars.Scale(25.0, 0.01, camera_distance_mm=300.0))


@pytest.fixture(scope="module")
def grids(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Dots 20 px apart, and the same seen 1 % larger."""
    made = []
    for name, step in (("low", 20.0), ("high", 20.2)):
        rows, cols = (np.mgrid[:120, :120] - 59.5) / step
        away = step * np.hypot(rows % 1.0 - 0.5, cols % 1.0 - 0.5)
        dots = 0.1 + 0.6 * np.clip(away - 5.0, 0.0, 1.0)
        made.append(shoot(tmp_path_factory.mktemp("grid") / name, dots[None].repeat(3, 0)))
    return made


def test_the_distance_of_the_lens_is_kept_where_one_grid_does_not_tell_it(grids: list[Path]) -> None:
    found, said = measured_scale(KNOWN, grids[:1], ("--grid-pitch-mm", 0.5), ("--heights-mm", None), "dots")
    assert found.camera_distance_mm == 300.0
    assert "kept from the calibration before: 300 mm to the camera" in said[-1].message
    found, _ = measured_scale(KNOWN, grids, ("--pitch-mm", 0.5), ("--heights-mm", "0,2"), "dots")
    assert found.camera_distance_mm == pytest.approx(200.0, rel=0.05)


def test_lengths_of_another_unit_are_doubted(grids: list[Path]) -> None:
    _, said = measured_scale(KNOWN, grids[:1], ("--pitch-mm", 500.0), ("--heights-mm", None), "dots")
    assert any("a pixel of 2.5e+04 um is unusual" in one.message and "--pitch-mm 500" in one.message for one in said)
    _, said = measured_scale(KNOWN, grids, ("--pitch-mm", 0.5), ("--heights-mm", "0,2000"), "dots")
    assert " m is unusual: are the heights of the grid in millimetres?" in said[-1].message


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--pitch-mm", "-0.5"], "--pitch-mm: must be finite and above 0, got -0.5"),
        (["--pitch-mm", "0.5", "--u-pitch-mm", "0.6"], "--u-pitch-mm: must be 0 or more, and below the pitch of 0.5"),
        (
            ["--pitch-mm", "0.5", "--heights-mm", "1,2,3"],
            "--heights-mm: must hold one height per folder (2), got 1,2,3",
        ),
        (["--pitch-mm", "0.5", "--heights-mm", "1,1"], "--heights-mm: must be finite, two different ones or more"),
        (["--pitch-mm", "0.5", "--heights-mm", "2,0"], "the higher it lies: heights count upward"),
    ],
)
def test_options_are_named_with_their_values(tmp_path: Path, grids: list[Path], options: list[str], words: str) -> None:
    run = bgars_command("calibrate", "scale", *grids, "-o", tmp_path / "station.toml", *options)
    assert run.code == 2
    assert words in run.stderr
    assert not list(tmp_path.iterdir())


def test_calibrating_at_once_keeps_the_name(tmp_path: Path, grids: list[Path], monkeypatch: pytest.MonkeyPatch) -> None:
    place, u = tmp_path / "a.toml", np.full(3, 0.05)
    rig = bgars.LightRig.from_directions(ring(3, 48.0), u_deg=0.05)
    lights = bgars.LightCalibration(rig, u, u * 0.6, u * 0.8, "mirror", (), 0.02)
    monkeypatch.setattr(bgars, "calibrate_lights", lambda *_, **__: lights)
    monkeypatch.setattr("bgars.cli.calibrate_station.write_balls", lambda *_: None)
    bgars.write_station(KNOWN, place)
    command = ("calibrate", "station", grids[1], "-o", place, "--grid", grids[0], "--grid-pitch-mm", 0.5)
    run = bgars_command(*command)
    assert run.code == 0, run.stderr
    back = bgars.read_station(place)
    assert back.scale is not None
    assert (back.name, back.scale.camera_distance_mm) == ("line 3", 300.0)
    assert bgars_command(*command, "--name", "line 4").code == 0
    assert bgars.read_station(place).name == "line 4"


def test_lights_that_nobody_declared_have_no_order(grids: list[Path]) -> None:
    capture = read_unlit(grids[0])
    assert capture.rig.u_deg is not None
    assert capture.rig.u_deg.min() == 90.0
    bgars.with_station(capture, replace(KNOWN, scale=None))
