"""The morning check of a station: what all lights share, what cannot be compared, and its options."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import bgars
import imageio.v3 as iio
import numpy as np
import pytest
from bgars.station import drift
from numpy.typing import NDArray
from rendered_spheres import render, ring
from test_calibrate import bgars_command
from test_station_lights import capture_of

LIGHTS = ring(4, 48.0)
BALL = (3.0, 2.0, 50.0)


def shot(ball: tuple[float, float, float] = BALL, seed: int = 0, **more: object) -> NDArray[np.uint8]:
    return render(
        LIGHTS, ball=ball, size=(150, 150), kind="matt", board=0.05, samples=2, seed=seed, **more
    )  # fmt: skip


def kept(folder: Path, images: NDArray[np.uint8]) -> Path:
    folder.mkdir(exist_ok=True)
    for index, image in enumerate(images):
        iio.imwrite(folder / f"image{index}.png", image)
    return folder


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A station file on its way through the disc."""
    path = tmp_path_factory.mktemp("station") / "station.toml"
    found = bgars.calibrate_lights(capture_of(shot(), camera_distance_mm=np.inf), sphere="matt")
    bgars.write_station(bgars.Station("line 3", lights=found), path)
    return path


def failures(place: Path, images: NDArray[np.uint8]) -> set[str]:
    found = drift(bgars.read_station(place), capture_of(images, camera_distance_mm=np.inf))
    return {one.code for one in found if one.severity == "fail"}


def test_what_stays_within_its_limits_is_no_drift(place: Path) -> None:
    assert failures(place, shot(seed=1)) == set()
    assert failures(place, shot(seed=2, exposure=180.0 * 1.05)) == set()


def test_all_lights_dimmer_is_drift_of_the_level(place: Path) -> None:
    assert failures(place, shot(seed=3, exposure=180.0 * 0.6)) == {"level"}


@pytest.mark.parametrize("share", [0.92, 1.02, 1.08])
def test_another_magnification_is_drift_of_the_scale(place: Path, share: float) -> None:
    assert failures(place, shot(tuple(share * value for value in BALL), seed=4)) == {"scale"}


def test_limits_of_strengths_hold_what_may_differ_between_two_calibrations_only(place: Path) -> None:
    """How a ball differs from Lambert's law is alike in both: it was counted twice, and a limit of 5 % was 8 to 14."""
    found = drift(bgars.read_station(place), capture_of(shot(seed=8), camera_distance_mm=np.inf))
    limits = [one.limit for one in found if one.code == "light-strength"]
    assert limits == pytest.approx([0.05] * 4, abs=0.01)
    assert next(one.limit for one in found if one.code == "level") == pytest.approx(0.10, abs=0.01)
    weak = shot(seed=9, intensities=np.array([1.0, 1.0, 0.91, 1.0]))
    assert failures(place, weak) == {"light-strength"}


def test_what_cannot_be_compared_is_said(place: Path) -> None:
    known = bgars.read_station(place)
    now = capture_of(shot((17.0, 2.0, 50.0), seed=5), camera_distance_mm=np.inf)
    message = next(one.message for one in drift(known, now) if one.code == "not-compared")
    assert "the place of the ball (14.0 px from that of the calibration; it is put there by hand)" in message
    assert known.lights is not None
    older = replace(known, lights=replace(known.lights, balls=(), level=np.nan, level_by=""))
    found = drift(older, now)
    message = next(one.message for one in found if one.code == "not-compared")
    assert "the level of all lights (none in the station file)" in message
    assert "the magnification (no outline in the station file)" in message
    assert not {"level", "scale"} & {one.code for one in found}


def test_a_board_shows_the_level_too() -> None:
    y, x = np.mgrid[:90, :120] / 60.0 - 1.0
    noise = np.random.default_rng(5).normal(0.0, 1.0, (2, 3, 90, 120))
    first, second = (
        capture_of(np.clip(np.rint(level * (1 - 0.2 * (x**2 + y**2)) + one), 0, 255).astype(np.uint8))
        for level, one in zip((150.0, 90.0), noise, strict=True)
    )
    found = drift(bgars.Station("line 3", flat=bgars.calibrate_flat(first)[0]), second)
    assert {one.code for one in found if one.severity == "fail"} == {"level"}
    assert "the directions of the lights and the magnification" in found[-1].message


def test_check_takes_the_options_of_its_synonym(tmp_path: Path, place: Path) -> None:
    same, dim = kept(tmp_path / "same", shot(seed=6)), kept(tmp_path / "dim", shot(seed=7, exposure=108.0))
    for command in (["check"], ["calibrate", "drift"]):
        options = ["--station", place, "--camera", "telecentric", "--outline", "77.5,72.5,50.0"]
        run = bgars_command(*command, same, *options)
        assert run.code == 0, run.stderr
        assert "line 3: nothing moved (10 comparisons)" in run.stdout
        assert "note: not compared: the place of the ball" in run.stdout
        run = bgars_command(*command, dim, *options, "--log")
        assert run.code == 1, run.stderr
        (line,) = run.stdout.splitlines()
        assert 'station="line 3" capture=dim verdict=fail moved=1 compared=10' in line
        assert "level=-0.40" in line
        assert 'reason="the level of all lights changed by -40' in line
    run = bgars_command("check", same, "--log")
    assert (run.code, run.stdout) == (2, "")
    assert "--log: goes with --station only" in run.stderr
