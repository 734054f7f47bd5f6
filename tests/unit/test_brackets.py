"""Exposure brackets in capture.toml: merged images, and what is refused of them."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import bgars
import imageio.v3 as iio
import numpy as np
import pytest
from bgars.io.capture import read_unlit
from bgars.io.provenance import capture_files

if TYPE_CHECKING:
    from pathlib import Path

TIMES = (1.0, 4.0, 16.0)
READ, GAIN = 1.2, 0.05
"""Noise: read-out in grey levels, and variance of photons per level."""


def scene() -> np.ndarray:
    """Light (4, 60, 80) at 16 ms: a smooth matt part and a highlight that is eight times as bright as full scale."""
    rows, cols = np.mgrid[:60, :80]
    matt = 20.0 + 180.0 * cols / 80.0
    lights = []
    for light in range(4):
        spot = 2000.0 * np.exp(-((rows - 20.0 - 5 * light) ** 2 + (cols - 30.0) ** 2) / 18.0)
        lights.append(matt * (1.0 - 0.1 * light) + spot)
    return np.array(lights)


def write(folder: Path, names: tuple[int, ...] = (0, 1, 2), dark: float = 8.0, more: str = "") -> np.ndarray:
    rng = np.random.default_rng(4)
    truth = scene()
    folder.mkdir()
    for light, image in enumerate(truth):
        for place, time in zip(names, TIMES, strict=True):
            level = image * time / TIMES[-1]
            noisy = level + dark + rng.normal(0.0, 1.0, level.shape) * np.sqrt(READ**2 + GAIN * level)
            iio.imwrite(folder / f"l{light}_{place}.png", np.clip(np.rint(noisy), 0, 255).astype(np.uint8))
    (folder / "capture.toml").write_text(
        f'exposures_ms = [1, 4, 16]\nimages = "l{{light}}_{{exposure}}.png"\nblack_level = {dark}\nsaturation = 255\n'
        f"{more}[lights]\nring = {{ count = 4 }}\n",
        encoding="utf-8",
    )
    return truth


def test_a_bracket_is_the_long_exposure_where_that_is_not_clipped(tmp_path: Path) -> None:
    truth = write(tmp_path / "part")
    capture = bgars.read_capture(tmp_path / "part")
    assert capture.images.dtype == np.float32
    assert capture.full_scale == 255.0
    single = np.stack([iio.imread(tmp_path / "part" / f"l{light}_2.png").astype(float) - 8.0 for light in range(4)])
    plain = single < 240.0
    off_merged, off_single = (capture.images - truth)[plain], (single - truth)[plain]
    assert abs(float(np.mean(off_merged))) < 0.1
    assert float(np.std(off_merged)) < float(np.std(off_single))


def test_highlights_of_metal_are_measured_not_clipped(tmp_path: Path) -> None:
    truth = write(tmp_path / "part")
    capture = bgars.read_capture(tmp_path / "part")
    bright = truth > 1000.0
    assert not (capture.images[bright] >= capture.saturation).any()
    np.testing.assert_allclose(capture.images[bright], truth[bright], rtol=0.25)
    assert abs(float(np.mean(capture.images[bright] / truth[bright])) - 1.0) < 0.02
    assert capture.saturation == pytest.approx(16.0 * (255.0 - 8.0))


def test_a_pixel_is_clipped_only_where_the_shortest_exposure_clips(tmp_path: Path) -> None:
    write(tmp_path / "part")
    path = tmp_path / "part" / "l0_0.png"
    image = iio.imread(path)
    image[20, 30] = 255
    iio.imwrite(path, image)
    capture = bgars.read_capture(tmp_path / "part")
    assert (np.argwhere(capture.images >= capture.saturation) == [[0, 20, 30]]).all()


def test_weights_are_those_of_the_noise(tmp_path: Path) -> None:
    """Nearly as good as the best weights: the maximum-likelihood mean of all exposures."""
    truth = write(tmp_path / "part")
    capture = bgars.read_capture(tmp_path / "part")
    share = np.array(TIMES) / TIMES[-1]
    plain = truth < 200.0
    best = 1.0 / sum(part**2 / (READ**2 + 1.0 / 12.0 + GAIN * part * truth[plain]) for part in share)
    scaled = (capture.images - truth)[plain] / np.sqrt(best)
    assert float(np.std(scaled)) < 1.08


def test_files_in_another_order_are_named(tmp_path: Path) -> None:
    write(tmp_path / "part", names=(2, 1, 0))
    with pytest.raises(bgars.InputError, match=r"l0_1\.png is 0\.2\d times as bright as .*l0_0\.png.*says 4 times"):
        bgars.read_capture(tmp_path / "part")


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    write(tmp_path / "part")
    (tmp_path / "part" / "l2_1.png").unlink()
    with pytest.raises(bgars.BgarsError, match=r"l2_1\.png"):
        bgars.read_capture(tmp_path / "part")


def test_a_list_names_all_exposures_of_a_light_then_those_of_the_next(tmp_path: Path) -> None:
    write(tmp_path / "part")
    pattern = bgars.read_capture(tmp_path / "part").images
    path = tmp_path / "part" / "capture.toml"
    names = [f"l{light}_{place}.png" for light in range(4) for place in range(3)]
    text = path.read_text(encoding="utf-8").replace('"l{light}_{exposure}.png"', str(names))
    path.write_text(text, encoding="utf-8")
    np.testing.assert_array_equal(bgars.read_capture(tmp_path / "part").images, pattern)
    path.write_text(text.replace("'l0_0.png', ", ""), encoding="utf-8")
    with pytest.raises(bgars.InputError, match="11 names, but 4 lights at 3 exposures are 12"):
        bgars.read_capture(tmp_path / "part")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[1, 4, 16]", "[1, 4, 4]", "exposures_ms: must differ from each other"),
        ("l{light}_{exposure}.png", "l{light}.png", "a pattern must hold {light}, and {exposure} or {ms}"),
        ("l{light}_{exposure}.png", "l{light}_{exposure}_{lens}.png", "may hold {light} and {exposure}"),
        ("exposures_ms = [1, 4, 16]\n", "", "a pattern goes with exposures_ms"),
    ],
)
def test_a_bracket_that_makes_no_sense_is_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    write(tmp_path / "part")
    path = tmp_path / "part" / "capture.toml"
    path.write_text(path.read_text(encoding="utf-8").replace(old, new), encoding="utf-8")
    with pytest.raises(bgars.InputError) as error:
        bgars.read_capture(tmp_path / "part")
    assert message in str(error.value)


def test_a_bracket_without_lights_is_read_for_calibration(tmp_path: Path) -> None:
    write(tmp_path / "part")
    path = tmp_path / "part" / "capture.toml"
    path.write_text(path.read_text(encoding="utf-8").partition("[lights]")[0], encoding="utf-8")
    assert read_unlit(tmp_path / "part").images.shape == (4, 60, 80)


def test_all_files_of_a_bracket_are_recorded(tmp_path: Path) -> None:
    write(tmp_path / "part")
    names = {path.name for path in capture_files(bgars.read_capture(tmp_path / "part"))}
    assert {f"l{light}_{place}.png" for light in range(4) for place in range(3)} < names


@pytest.mark.parametrize("noise", [0.0, 0.5])
@pytest.mark.parametrize(("shortest", "told"), [(0.02, True), (0.01, False)])
def test_a_short_exposure_of_few_grey_levels_is_in_order(
    tmp_path: Path, noise: float, shortest: float, told: bool
) -> None:
    """The median ratio of rounded levels, of pixels that noise helped to choose, was off by a third: refused."""
    rng = np.random.default_rng(6)
    folder = tmp_path / "part"
    folder.mkdir()
    light_of = np.full((60, 80), 52.0)  # at 9 ms; 3.5 levels at 0.6 ms
    light_of[:10] = 630.0  # 42 levels at 0.6 ms, and 1.4 or 0.7 in the shortest
    for light in range(4):
        for place, time in enumerate((shortest, 0.6, 9.0)):
            shown = 8.0 + light_of * time / 9.0 + rng.normal(0.0, noise, light_of.shape)
            iio.imwrite(folder / f"l{light}_{place}.png", np.clip(np.rint(shown), 0, 255).astype(np.uint8))
    (folder / "capture.toml").write_text(
        f'exposures_ms = [{shortest}, 0.6, 9]\nimages = "l{{light}}_{{exposure}}.png"\nblack_level = 8\n'
        "saturation = 255\n[lights]\nring = { count = 4 }\n",
        encoding="utf-8",
    )
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        bgars.read_capture(folder)
    notes = " ".join(str(one.message) for one in said)
    assert ("images at 0.01 ms are too dark to tell" in notes) is not told
    assert "not as bright" not in notes
