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
