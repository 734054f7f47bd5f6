"""Reference captures that look right and are not: what the calibration of a station says of them."""

from __future__ import annotations

from pathlib import Path

import bgars
import imageio.v3 as iio
import numpy as np
import pytest
from numpy.typing import NDArray
from rendered_spheres import render, ring
from test_calibrate import bgars_command
from test_station_lights import LENS, capture_of

LIGHTS = ring(4, 48.0)
SMALL = (4.0, -3.0, 60.0)


def kept(folder: Path, images: NDArray[np.uint8]) -> Path:
    folder.mkdir()
    for index, image in enumerate(images):
        iio.imwrite(folder / f"image{index}.png", image)
    return folder


@pytest.fixture(scope="module")
def mirror() -> NDArray[np.uint8]:
    return render(LIGHTS, ball=SMALL, size=(180, 180), **{**LENS, "samples": 2})


def board(count: int = 3, offset: float = 0.0) -> NDArray[np.uint8]:
    y, x = np.mgrid[:90, :120] / 60.0 - 1.0
    level = 120.0 * (1.0 - 0.25 * (x**2 + y**2)) + offset
    noise = np.random.default_rng(5).normal(0.0, 1.0, (count, 90, 120))
    return np.clip(np.rint(level + noise), 0, 255).astype(np.uint8)


def test_the_same_image_twice_is_refused_by_name(tmp_path: Path, mirror: NDArray[np.uint8]) -> None:
    images = mirror.copy()
    images[3] = images[2]
    with pytest.raises(bgars.InputError, match=r"image 2 \(counted from 0\) and image 3 .* are the same picture"):
        bgars.calibrate_lights(capture_of(images))
    flat = board(4)
    flat[3] = flat[1]
    with pytest.raises(bgars.InputError, match="are the same picture; each light needs its own"):
        bgars.calibrate_flat(capture_of(flat))
    run = bgars_command("calibrate", "lights", kept(tmp_path / "ball", images), "-o", tmp_path / "station.toml")
    assert run.code == 2
    assert "ball: images: image2.png and image3.png are the same picture" in run.stderr
    assert not (tmp_path / "station.toml").exists()


def test_a_dark_frame_beside_the_images_of_a_board_is_used_and_said(tmp_path: Path) -> None:
    folder = kept(tmp_path / "board", board(offset=40.0))
    iio.imwrite(folder / "dark.png", np.full((90, 120), 40, np.uint8))
    plain = kept(tmp_path / "plain", board())
    found = []
    for each in (folder, plain):
        run = bgars_command("calibrate", "flat", each, "-o", tmp_path / f"{each.name}.toml")
        assert run.code == 0, run.stderr
        assert ("dark.png taken as the dark frame, and subtracted" in run.stderr) == (each is folder)
        flat = bgars.read_station(tmp_path / f"{each.name}.toml").flat
        assert flat is not None
        found.append(flat.coefficients)
    np.testing.assert_allclose(*found, atol=0.01)


def noisy(images: NDArray[np.uint8], seed: int) -> NDArray[np.uint8]:
    noise = np.random.default_rng(seed).normal(0.0, 1.0, images.shape)
    return np.clip(np.rint(images + noise), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("sphere", ["mirror", "matt"])
def test_a_lamp_that_fired_twice_is_named(mirror: NDArray[np.uint8], sphere: str) -> None:
    images = mirror if sphere == "mirror" else render(LIGHTS, kind="matt", ball=SMALL, size=(180, 180), samples=2)
    sound = bgars.calibrate_lights(capture_of(noisy(images, 1)), sphere)
    assert not of_kind(sound, "one-lamp-twice")
    found = bgars.calibrate_lights(capture_of(noisy(images[[0, 1, 2, 2]], 1)), sphere)
    assert "image 2 (counted from 0) and image 3" in of_kind(found, "one-lamp-twice")[0]


def of_kind(found: bgars.LightCalibration, code: str) -> list[str]:
    return [one.message for one in found.findings if one.code == code]


@pytest.mark.parametrize("exposure", [900.0, 3000.0])
@pytest.mark.parametrize("refraction", [None, 1.9])
def test_a_ball_whose_edge_is_burnt_out_is_refused(exposure: float, refraction: float | None) -> None:
    """Ground and rim are both clipped: what is seen is where the ball's reflection falls below the clip level."""
    images = render(
        LIGHTS, ball=SMALL, size=(180, 180), exposure=exposure, refraction=refraction, **{**LENS, "samples": 2}
    )
    with pytest.raises(bgars.CalibrationError, match="of the ground beside the ball is clipped, at most 33 %"):
        bgars.calibrate_lights(capture_of(images))
    stated = bgars.calibrate_lights(capture_of(images), outline=SMALL)
    assert "expose shorter" in of_kind(stated, "overexposed-ground")[0]


def test_one_light_that_burns_the_ground_is_doubted_and_counts_in_u() -> None:
    images = render(LIGHTS, ball=SMALL, size=(180, 180), refraction=1.9, **{**LENS, "samples": 2})
    power = np.array([1.0, 5.0, 1.0, 1.0])
    burnt = render(LIGHTS, ball=SMALL, size=(180, 180), intensities=power, refraction=1.9, **{**LENS, "samples": 2})
    plain, found = bgars.calibrate_lights(capture_of(images)), bgars.calibrate_lights(capture_of(burnt))
    assert not of_kind(plain, "overexposed-ground")
    assert "% of the ground beside the ball is clipped (limit 10 %)" in of_kind(found, "overexposed-ground")[0]
    assert found.balls[0].u_outline_px[2] > plain.balls[0].u_outline_px[2] + 0.3


def test_a_clipped_room_in_the_ball_is_doubted(mirror: NDArray[np.uint8]) -> None:
    images = mirror.copy()
    rows, cols = np.mgrid[:180, :180]
    apart = np.hypot(cols - 93.5, rows - 92.5) / SMALL[2]
    images[:, (apart > 0.45) & (apart < 0.7) & (rows < 92)] = 255
    found = bgars.calibrate_lights(capture_of(images), outline=SMALL)
    assert "of the ball is clipped (limit 10 %), which hides highlights" in of_kind(found, "overexposed-ball")[0]


@pytest.mark.parametrize("share", [0.66, 0.70, 0.74, 0.8])
def test_a_stated_radius_near_the_horizon_in_the_ball_is_doubted(mirror: NDArray[np.uint8], share: float) -> None:
    """It snapped to the mirrored horizon: 19 degrees off, with a stated uncertainty of 0.05."""
    found = bgars.calibrate_lights(capture_of(mirror), outline=(SMALL[0], SMALL[1], share * SMALL[2]))
    off = np.degrees(2 * np.arcsin(np.linalg.norm(found.rig.directions - LIGHTS, axis=1) / 2))
    assert off.min() > 5.0
    assert (off < 2 * np.sqrt(2) * found.u_deg).all()
    message = of_kind(found, "wrong-outline")[0]
    assert "but the images show the horizon in the ball near it, and its edge at --outline 93.5,92.5,60." in message
    assert len(of_kind(found, "unsure")) == 1


def test_a_right_radius_is_not_doubted(mirror: NDArray[np.uint8]) -> None:
    assert not bgars.calibrate_lights(capture_of(mirror, camera_distance_mm=np.inf), outline=SMALL).doubts


def test_a_message_names_an_outline_that_can_be_pasted(tmp_path: Path, mirror: NDArray[np.uint8]) -> None:
    folder, place = kept(tmp_path / "ball", mirror), tmp_path / "station.toml"
    run = bgars_command("calibrate", "lights", folder, "-o", place, "--outline", "93.5,92.5,57.0")
    assert run.code == 0, run.stderr
    option, value = run.stdout.partition("but the images show an edge at ")[2].splitlines()[0].split()
    run = bgars_command("calibrate", "lights", folder, "-o", place, option, value)
    assert run.code == 0, run.stderr
    assert "warning" not in run.stdout


def test_either_of_two_like_highlights_may_be_the_lamp(mirror: NDArray[np.uint8]) -> None:
    """The wrong one was 21 degrees off, with a stated uncertainty of 0.06."""
    second = render(ring(4, 60.0, azimuth0_deg=40.0), ball=SMALL, size=(180, 180), **{**LENS, "samples": 2, "seed": 3})
    found = bgars.calibrate_lights(capture_of(np.maximum(mirror, second)))
    off = np.degrees(2 * np.arcsin(np.linalg.norm(found.rig.directions - LIGHTS, axis=1) / 2))
    assert off.max() > 10.0
    assert (off < 2 * np.sqrt(2) * found.u_deg).all()
    assert len(of_kind(found, "two-highlights")) == 1
    assert "all lights: two highlights on the ball" in of_kind(found, "two-highlights")[0]


@pytest.mark.parametrize("blur_px", [5.0, 7.0])
def test_a_blurred_ball_is_out_of_focus_though_its_outline_is_stated(blur_px: float) -> None:
    ball = (4.0, -3.0, 100.0)
    images = render(
        LIGHTS, ball=ball, size=(260, 260), **{**LENS, "samples": 1, "blur_px": blur_px, "lamp_level": 20.0}
    )
    found = bgars.calibrate_lights(capture_of(images), outline=ball)
    assert "the ball is out of focus: its edge is" in of_kind(found, "out-of-focus")[0]


@pytest.mark.parametrize("kind", ["mirror", "matt"])
def test_a_second_ball_that_is_not_used_is_named(kind: str) -> None:
    more = LENS if kind == "mirror" else {"kind": "matt", "board": 0.05}
    left, right = (
        render(LIGHTS, ball=(x, y, radius), size=(150, 280), **{**more, "samples": 2})
        for x, y, radius in ((-70.0, 5.0, 45.0), (70.0, -4.0, 40.0))
    )
    both = np.concatenate([left[:, :, :140], right[:, :, 140:]], axis=2)
    message = of_kind(bgars.calibrate_lights(capture_of(both), sphere=kind), "another-ball")[0]
    assert "another ball is in view, and not used; to use both, give --outline" in message
    assert "--outline 209.5,78.5,40." in message.replace("39.9", "40.").replace("78.6", "78.5")
    assert not of_kind(bgars.calibrate_lights(capture_of(left[:, :, :140]), sphere=kind), "another-ball")


def board_with(shade: NDArray[np.float64], noise: float = 1.0) -> bgars.Capture:
    levels = 150.0 * shade + np.random.default_rng(11).normal(0.0, noise, (3, *shade.shape))
    return capture_of(np.clip(np.rint(levels), 0, 255).astype(np.uint8))


@pytest.mark.parametrize("noise", [1.0, 4.0])
def test_corners_that_the_lens_cuts_off_are_doubted(noise: float) -> None:
    """The map was 16 % off there without a word: the mean misfit of all blocks was below 1 %."""
    y, x = np.mgrid[:240, :240] / 120.0 - 1.0
    _, findings = bgars.calibrate_flat(board_with(1.0 - 0.4 / (1.0 + np.exp(-(np.hypot(x, y) - 1.1) / 0.06)), noise))
    assert {one.light for one in findings if one.code == "flat-structure"} == {0, 1, 2}
    _, findings = bgars.calibrate_flat(board_with(1.0 / (1.0 + 0.5 * (x**2 + y**2)) ** 2, noise))
    assert {one.code for one in findings} == {"evenness"}


def test_a_printed_grid_is_no_board() -> None:
    rows, cols = np.mgrid[:240, :240]
    dots = np.where(np.hypot(rows % 30 - 15.0, cols % 30 - 15.0) < 7.0, 0.25, 1.0)
    with pytest.raises(bgars.CalibrationError, match="no smooth map fits the board: a place is off by"):
        bgars.calibrate_flat(board_with(dots))


@pytest.mark.parametrize("part", ["lights", "flat"])
def test_an_empty_folder_is_said_to_lack_images(tmp_path: Path, part: str) -> None:
    (tmp_path / "empty").mkdir()
    run = bgars_command("calibrate", part, tmp_path / "empty", "-o", tmp_path / "station.toml")
    assert run.code == 2
    assert "empty: 0 images (none found), one per light is needed, 3 or more; seen: nothing at all" in run.stderr
