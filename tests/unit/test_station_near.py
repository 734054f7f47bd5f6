"""A station whose lamps are near: positions in mm, which need a scale to be used, and compared with."""

from __future__ import annotations

from pathlib import Path

import bgars
import imageio.v3 as iio
import numpy as np
import pytest
from test_calibrate import bgars_command

LAMPS = """format = "bgars-station"
version = 1
name = "near"
[lights]
sphere = "mirror"
positions_mm = [[50, 0, 50], [0, 50, 50], [-50, 0, 50], [0, -50, 50]]
intensities = [1, 1, 1, 1]
u_deg = [0.1, 0.1, 0.1, 0.1]
u_own_deg = [0.1, 0.1, 0.1, 0.1]
u_common_deg = [0.0, 0.0, 0.0, 0.0]
"""
SCALE = "[scale]\npixel_pitch_um = 20.0\npixel_pitch_u_um = 0.01\n"


@pytest.fixture
def part(tmp_path: Path) -> Path:
    folder = tmp_path / "part"
    folder.mkdir()
    noise = np.random.default_rng(7).normal(0.0, 2.0, (4, 60, 60))
    for index, image in enumerate(noise):
        iio.imwrite(folder / f"{index}.png", np.rint(100.0 + image).astype(np.uint8))
    return folder


def test_the_scale_of_a_near_station_need_not_be_repeated(part: Path) -> None:
    place = part.parent / "station.toml"
    place.write_text(LAMPS + SCALE)
    assert bgars.read_capture(part, station=place).pixel_pitch_um == 20.0
    assert bgars_command("normals", part, "-o", part.parent / "out", "--station", place).code == 0
    assert bgars_command("inspect", part, "-o", part.parent / "out2", "--station", place).code in {0, 1}
    assert bgars_command("init", part, "--station", place).code == 0
    capture = bgars.read_capture(part)
    assert capture.pixel_pitch_um == 20.0
    assert capture.rig.positions_um is not None


def test_a_near_station_without_scale_is_named_and_a_stated_pitch_is_enough(part: Path) -> None:
    place = part.parent / "station.toml"
    place.write_text(LAMPS)
    run = bgars_command("normals", part, "-o", part.parent / "out", "--station", place)
    assert (run.code, run.stdout) == (2, "")
    assert f"{place}: scale.pixel_pitch_um: needed" in run.stderr
    run = bgars_command("init", part, "--station", place)
    assert run.code == 2
    assert "--pitch-um: needed" in run.stderr
    assert not (part / "capture.toml").exists()
    assert bgars_command("init", part, "--station", place, "--pitch-um", "20").code == 0
    assert bgars.read_capture(part).pixel_pitch_um == 20.0


def test_lamps_within_the_picture_are_refused_by_the_station_that_holds_them(part: Path) -> None:
    place = part.parent / "station.toml"
    place.write_text(LAMPS + SCALE.replace("20.0", "2000.0"))
    with pytest.raises(bgars.InputError, match=r"station\.toml: all lights are within 70\.7 mm"):
        bgars.read_capture(part, station=place)
