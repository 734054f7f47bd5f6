"""Calibrations that contradict themselves, each other, or what was typed are refused by name."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import bgars
import imageio.v3 as iio
import numpy as np
import pytest
from rendered_spheres import render, ring
from test_calibrate import bgars_command
from test_station_lights import capture_of

LIGHTS = ring(4, 48.0)


def stated(lights: int = 4, **more: object) -> bgars.LightCalibration:
    u = np.full(lights, 0.05)
    rig = bgars.LightRig.from_directions(ring(lights, 48.0), u_deg=0.05)
    return bgars.LightCalibration(rig, u, u * 0.6, u * 0.8, "mirror", (), 0.02, **more)


@pytest.fixture(scope="module")
def ball() -> bgars.Capture:
    images = render(LIGHTS, ball=(3.0, 2.0, 50.0), size=(140, 140), samples=2, blur_px=0.6, lamp_level=20.0, seed=5)
    return capture_of(images, camera_distance_mm=np.inf)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, ball: bgars.Capture) -> Path:
    """The ball's images without a description."""
    folder = tmp_path_factory.mktemp("ball") / "ball"
    folder.mkdir()
    for index, image in enumerate(ball.images):
        iio.imwrite(folder / f"light{index}.png", image)
    return folder


def test_a_diameter_that_the_scale_contradicts_is_refused(ball: bgars.Capture) -> None:
    scaled = replace(ball, pixel_pitch_um=20.0, pixel_pitch_u_um=0.01)
    with pytest.raises(
        bgars.InputError, match=r"stated as 20 mm, but is (2|2\.0\d*|1\.99\d*) mm .* by the scale of 20"
    ):
        bgars.calibrate_lights(scaled, diameter_um=20_000.0)
    # A calliper's 2.01 mm is no contradiction.
    bgars.calibrate_lights(scaled, diameter_um=2010.0)


def test_the_same_pictures_in_two_folders_are_refused(
    tmp_path: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    copy, place, known = tmp_path / "copy", tmp_path / "station.toml", tmp_path / "known.csv"
    shutil.copytree(folder, copy)
    known.write_text("name,height_um,u_um\nA1,500,0.5\n")
    bgars.write_station(bgars.Station(lights=stated()), place)
    monkeypatch.setattr(bgars, "inspect", lambda *_: SimpleNamespace(balls=[], warnings=[]))
    for arguments in (
        ("calibrate", "lights", folder, copy, "-o", place),
        ("calibrate", "scale", folder, copy, "-o", place, "--pitch-mm", 1, "--heights-mm", "0,10"),
        ("verify", folder, copy, "--known", known, "--station", place),
        ("teach", folder, copy, "-o", tmp_path / "part.toml", "--station", place),
    ):
        run = bgars_command(*arguments)
        assert run.code == 2
        assert "copy/light0.png is the same picture as ball/light0.png" in run.stderr
