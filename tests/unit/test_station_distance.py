"""Distance of the camera and tilt of a grid, from pictures of the grid at known heights."""

from __future__ import annotations

from pathlib import Path

import bgars
import imageio.v3 as iio
import numpy as np
import pytest
from numpy.typing import NDArray
from test_calibrate import bgars_command

SIZE = (300, 400)
GRID_UM, PITCH_UM = 500.0, 20.0
FINE = 3


def grid(distance_mm: float, height_um: float, tilt_deg: float = 0.0, seed: int = 0) -> NDArray[np.uint8]:
    """(3, H, W) dots on a plane, tilted about y, seen by a pinhole at a distance over height 0."""
    height, width = SIZE
    y, x = np.mgrid[: height * FINE, : width * FINE]
    x, y = ((x + 0.5) / FINE - width / 2) * PITCH_UM, (height / 2 - (y + 0.5) / FINE) * PITCH_UM
    away, slope = 1000.0 * distance_mm, np.tan(np.radians(tilt_deg))
    along = np.ones_like(x) if np.isinf(away) else (away - height_um) / (away + x * slope)
    a, b = along * x / np.cos(np.radians(tilt_deg)) / GRID_UM, along * y / GRID_UM
    dots = np.hypot(a - np.rint(a), b - np.rint(b)) < 0.25
    picture = np.where(dots, 40.0, 200.0).reshape(height, FINE, width, FINE).mean(axis=(1, 3))
    noisy: NDArray[np.float64] = picture + np.random.default_rng(seed).normal(0, 1, (3, *SIZE))
    return np.rint(noisy).astype(np.uint8)


def capture(images: NDArray[np.uint8], camera_distance_mm: float | None = None) -> bgars.Capture:
    rig = bgars.LightRig.ring(len(images))
    return bgars.Capture(images, rig, np.ones(SIZE, np.bool_), saturation=255.0, camera_distance_mm=camera_distance_mm)


@pytest.mark.parametrize(("distance_mm", "tilt_deg"), [(60.0, 0.0), (180.0, 1.5), (400.0, -2.0)])
def test_two_heights_tell_the_distance_the_pitch_at_the_board_and_the_tilt(distance_mm: float, tilt_deg: float) -> None:
    heights = [1000.0, 21000.0]
    shots = [capture(grid(distance_mm, height, tilt_deg, seed)) for seed, height in enumerate(heights)]
    scale, said = bgars.calibrate_scale(shots, GRID_UM, heights_um=heights)
    assert scale.camera_distance_mm == pytest.approx(distance_mm, rel=0.02)
    assert abs(scale.pixel_pitch_um - PITCH_UM) < 3.0 * scale.pixel_pitch_u_um
    assert scale.tilt_deg == pytest.approx(abs(tilt_deg), abs=0.1)
    told = next(one for one in said if one.code == "distance")
    u_mm = float(told.message.split("(u ")[1].split(" mm")[0])
    assert scale.camera_distance_mm is not None
    assert (f"by {scale.tilt_deg:.2f} deg" in said[-1].message) == (tilt_deg != 0.0)
    assert abs(scale.camera_distance_mm - distance_mm) < 3.0 * u_mm < 0.1 * distance_mm


@pytest.mark.parametrize("off_um", [150.0, -200.0])
def test_heights_that_are_off_by_a_hundredth_of_their_range_are_in_u(off_um: float) -> None:
    """The board is not among them: its pitch is what they lead to, 0.3 % off."""
    shots = [capture(grid(60.0, height, seed=seed)) for seed, height in enumerate((1000.0, 21000.0))]
    scale, _ = bgars.calibrate_scale(shots, GRID_UM, heights_um=[1000.0 + off_um, 21000.0 + off_um])
    assert 0.002 < abs(scale.pixel_pitch_um / PITCH_UM - 1.0) < 2.0 * scale.pixel_pitch_u_um / PITCH_UM < 0.02


def test_a_telecentric_lens_is_told_and_too_little_height_tells_nothing() -> None:
    far = [capture(grid(np.inf, 0.0, seed=seed)) for seed in (1, 2)]
    scale, said = bgars.calibrate_scale(far, GRID_UM, heights_um=[0.0, 10000.0])
    assert scale.camera_distance_mm == np.inf
    assert any("telecentric" in one.message for one in said)
    scale, said = bgars.calibrate_scale(far, GRID_UM, heights_um=[0.0, 20.0])
    assert scale.camera_distance_mm is None
    assert any("raise the grid further" in one.message for one in said)


def test_wrong_heights_are_doubted_or_refused() -> None:
    shots = [capture(grid(80.0, height, seed=seed)) for seed, height in enumerate((0.0, 5000.0, 10000.0))]
    for heights, told in (([0.0, -5000.0, -10000.0], "count upward"), ([0.0, 9000.0, 10000.0], "is a height wrong")):
        _, said = bgars.calibrate_scale(shots, GRID_UM, heights_um=heights)
        assert any(told in one.message and one.severity == "doubt" for one in said), told
    wrong: list[tuple[list[float] | None, str]] = [
        (None, "3 captures of a grid need its height"),
        ([0.0, 1.0], "one height per capture"),
        ([1.0, 1.0, 1.0], "two different heights"),
        ([0.0, np.nan, 1.0], "finite"),
    ]
    for given, told in wrong:
        with pytest.raises(bgars.InputError, match=told):
            bgars.calibrate_scale(shots, GRID_UM, heights_um=given)


def test_a_stated_distance_turns_the_change_of_scale_into_a_tilt() -> None:
    scale, said = bgars.calibrate_scale(capture(grid(120.0, 0.0, 2.0), camera_distance_mm=120.0), GRID_UM)
    assert scale.tilt_deg == pytest.approx(2.0, abs=0.1)
    assert any(f"tilted against the camera, by {scale.tilt_deg:.2f} deg" in one.message for one in said)
    unknown, _ = bgars.calibrate_scale(capture(grid(120.0, 0.0, 2.0)), GRID_UM)
    assert np.isnan(unknown.tilt_deg)


def test_the_command_keeps_the_distance_and_other_commands_use_it(tmp_path: Path) -> None:
    folders = []
    for index, height in enumerate((0.0, 10000.0)):
        folders.append(tmp_path / f"grid{index}")
        folders[-1].mkdir()
        for number, image in enumerate(grid(90.0, height, 1.0, index)):
            iio.imwrite(folders[-1] / f"i{number}.png", image)
    station = tmp_path / "station.toml"
    wanted = ["calibrate", "scale", *folders, "-o", station, "--pitch-mm", GRID_UM / 1000]
    run = bgars_command(*wanted, "--heights-mm", "0,10")
    assert run.code == 0, run.stderr
    assert "90." in run.stdout + run.stderr
    scale = bgars.read_station(station).scale
    assert scale is not None
    assert scale.camera_distance_mm == pytest.approx(90.0, rel=0.02)
    assert scale.tilt_deg == pytest.approx(1.0, abs=0.1)
    seen = bgars.with_station(capture(grid(90.0, 0.0)), bgars.Station("s", scale=scale))
    assert seen.camera_distance_mm == scale.camera_distance_mm
    options: list[tuple[list[str], str]] = [
        ([], "--heights-mm: needed with several folders"),
        (["--heights-mm", "0;10"], "--heights-mm: must be"),
    ]
    for more, told in options:
        run = bgars_command(*wanted, *more)
        assert run.code == 2
        assert told in run.stderr
    endless = bgars.Station("s", scale=bgars.Scale(20.0, 0.01, camera_distance_mm=np.inf))
    bgars.write_station(endless, tmp_path / "far.toml")
    read = bgars.read_station(tmp_path / "far.toml").scale
    assert read is not None
    assert read.camera_distance_mm == np.inf
