"""A station whose lamps are near: positions in mm, which need a scale to be used, and compared with."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import bgars
import imageio.v3 as iio
import numpy as np
import pytest
from bgars.station import drift
from rendered_spheres import render, ring
from test_calibrate import bgars_command
from test_station_lights import capture_of

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


LAMPS_PX = 560.0 * ring(4, 45.0)
PLACES = [(-50.0, -40.0, 45.0), (50.0, -35.0, 45.0), (5.0, 50.0, 45.0)]


def seen(place: tuple[float, float, float], seed: int, **more: object) -> bgars.Capture:
    images = render(
        LAMPS_PX, ball=place, size=(220, 220), near=True, seed=seed, blur_px=0.6, lamp_level=20.0, samples=2, **more
    )
    return capture_of(images, camera_distance_mm=np.inf)


@pytest.fixture(scope="module")
def near(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of a station calibrated on a ball of 2 mm at three places, without a scale."""
    captures = [seen(place, seed) for seed, place in enumerate(PLACES)]
    found = bgars.calibrate_lights(captures, near=True, diameter_um=2000.0)
    assert found.level_by == "board"
    place = tmp_path_factory.mktemp("near") / "station.toml"
    bgars.write_station(bgars.Station("near", lights=found), place)
    return place


def moved(station: Path, capture: bgars.Capture) -> set[tuple[str, int | None]]:
    return {(one.code, one.light) for one in drift(bgars.read_station(station), capture) if one.severity == "fail"}


def test_a_near_station_is_compared_by_the_places_of_its_lamps(near: Path) -> None:
    """Seen as distant lamps from one ball, the images of the calibration itself were 100 % and more off."""
    assert moved(near, seen(PLACES[0], 0)) == set()
    assert moved(near, seen((-40.0, 45.0, 45.0), 7)) == set()
    weak = seen(PLACES[0], 8, intensities=np.array([1.0, 0.6, 1.0, 1.0]))
    assert moved(near, weak) == {("light-strength", 1)}
    assert ("level", None) in moved(near, seen(PLACES[1], 9, exposure=0.6 * 180.0))


def test_without_a_pitch_near_lamps_are_not_compared(near: Path) -> None:
    known = bgars.read_station(near)
    assert known.lights is not None
    assert known.lights.pixel_pitch_um == pytest.approx(2000.0 / 90.0, rel=0.005)
    older = replace(known, lights=replace(known.lights, pixel_pitch_um=None))
    found = drift(older, seen(PLACES[0], 0))
    assert not {"light-moved", "light-strength", "level"} & {one.code for one in found}
    assert "directions and strengths of near lamps" in found[-1].message


def test_images_of_another_size_are_refused_and_a_contradicting_pitch_is_said(part: Path) -> None:
    place = part.parent / "station.toml"
    place.write_text(LAMPS + "size_px = [60, 60]\n" + SCALE + "size_px = [60, 60]\n")
    (part / "capture.toml").write_text('pixel_pitch_um = 5.0\nstation = "../station.toml"\n')
    with pytest.warns(bgars.CaptureWarning, match=r"pixel_pitch_um = 5, but 20 \(u 0.01\) by .*station.toml, which is"):
        capture = bgars.read_capture(part)
    assert capture.pixel_pitch_um == 20.0
    assert "pixel_pitch_um = 5" in capture.assumed[-1]
    for text, words in (
        (LAMPS + "size_px = [120, 120]\n" + SCALE, "the positions of the lights of near are those of 120 x 120"),
        (LAMPS + SCALE + "size_px = [30, 60]\n", "60 x 60 pixels, but scale and lens of near are those of 60 x 30"),
    ):
        place.write_text(text)
        with pytest.raises(bgars.InputError, match=words):
            bgars.read_capture(part)


def test_a_calibration_keeps_the_size_of_its_images(near: Path) -> None:
    lights = bgars.read_station(near).lights
    assert lights is not None
    assert lights.size_px == (220, 220)
