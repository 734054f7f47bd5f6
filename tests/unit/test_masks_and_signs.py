"""What lies in a capture and would be passed over: masks that nothing names, inverted bits, light below 0."""

from __future__ import annotations

from pathlib import Path

import imageio.v3 as iio
import numpy as np
import pytest
import tifffile
from bgars.io.capture_values import note_light_below_zero
from bgars.io.masks import read_mask
from bgars.io.normal_map import read_stored_normals
from case_captures import (
    SHAPE,
    names_of,
    radiances,
    read_with_notes,
    reads_right,
    recipe,
    write_directions,
    write_images,
)
from PIL import Image
from scipy.io import savemat

MASK = np.zeros(SHAPE, np.bool_)
MASK[4:15, 3:20] = True


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_images(tmp_path)
    write_directions(tmp_path)
    return tmp_path


@pytest.mark.parametrize("name", ["msk.png", "silhouette.png", "segmentation.png", "roi.png", "part-roi.png"])
def test_an_image_that_may_be_a_mask_is_named_with_what_to_write(name: str, folder: Path) -> None:
    iio.imwrite(folder / name, MASK.astype(np.uint8) * 255)
    assert reads_right(folder, f'{name}: not used; if it is a mask, write mask = "{name}" in capture.toml').mask.all()


def test_a_mask_in_a_folder_of_its_own_is_named(folder: Path) -> None:
    (folder / "mask").mkdir()
    iio.imwrite(folder / "mask" / "a.png", MASK.astype(np.uint8) * 255)
    assert reads_right(folder, 'mask/a.png: not used; if it is a mask, write mask = "mask/a.png"').mask.all()
    (folder / "l.txt").write_bytes((folder / "light_directions.txt").read_bytes())
    recipe(folder, 'mask = "mask/a.png"\n[lights]\ndirections = "l.txt"\n')
    np.testing.assert_array_equal(reads_right(folder).mask, MASK)


@pytest.mark.parametrize("name", ["mask.npz", "mask.mat"])
def test_a_mask_of_a_kind_that_is_not_read_is_named(name: str, folder: Path) -> None:
    if name.endswith("z"):
        np.savez(folder / name, mask=MASK)
    else:
        savemat(folder / name, {"mask": MASK})
    assert reads_right(folder, f"{name}: not used; a mask is an image or a .npy").mask.all()


def test_images_that_are_called_so_are_no_masks(tmp_path: Path) -> None:
    write_images(tmp_path, names_of("roi_{}.png"))
    write_directions(tmp_path)
    reads_right(tmp_path)


@pytest.mark.parametrize("options", [{}, {"compression": "zlib"}, {"metadata": None}, {"software": "mine"}])
def test_true_of_a_boolean_array_in_a_tiff_means_use(options: dict[str, str], folder: Path) -> None:
    tifffile.imwrite(folder / "mask.tif", MASK, **options)
    capture = reads_right(folder, "mask.tif taken", "its bits of 1 are used, as True of the array")
    np.testing.assert_array_equal(capture.mask, MASK)


def test_white_of_a_bilevel_picture_means_use(tmp_path: Path) -> None:
    """A file of 0 = white from a program that writes pictures (TIFF 6.0, section 3)."""
    tifffile.imwrite(tmp_path / "m.tif", ~MASK, photometric="miniswhite", metadata=None, software="scanner")
    notes: list[str] = []
    np.testing.assert_array_equal(read_mask(tmp_path / "m.tif", SHAPE, notes), MASK)
    assert notes == ["m.tif: its bits of 0 are used, since 0 is white in this TIFF"]
    Image.fromarray(MASK).save(tmp_path / "black.tif")
    np.testing.assert_array_equal(read_mask(tmp_path / "black.tif", SHAPE, notes), MASK)
    assert len(notes) == 1


def test_a_boolean_mask_of_a_normal_map_is_said(tmp_path: Path) -> None:
    np.save(tmp_path / "n.npy", np.tile(np.float32([0, 0, 1]), (*SHAPE, 1)))
    tifffile.imwrite(tmp_path / "m.tif", MASK)
    found = read_stored_normals(tmp_path / "n.npy", mask=tmp_path / "m.tif")
    np.testing.assert_array_equal(np.isfinite(found.vectors[..., 0]), MASK)
    assert "bits of 1 are used" in found.notes[0]


def float_images(folder: Path, images: np.ndarray) -> list[str]:
    write_directions(folder)
    for name, image in zip(names_of("a{}.tif"), images.astype(np.float32), strict=True):
        tifffile.imwrite(folder / name, image)
    return [note for note in read_with_notes(folder)[1] if "by more than noise" in note]


@pytest.mark.parametrize("level", [0.5, 0.65])
def test_images_that_were_centred_are_said(level: float, tmp_path: Path) -> None:
    (note,) = float_images(tmp_path, radiances() - level)
    assert "a0.tif" in note or ".tif and" in note
    assert "black_level" in note


def test_what_was_subtracted_is_judged_after_the_black_level(tmp_path: Path) -> None:
    recipe(tmp_path, 'black_level = 0.6\n[lights]\ndirections = "light_directions.txt"\n')
    assert float_images(tmp_path, radiances())
    recipe(tmp_path, 'dark = "dark.tif"\n[lights]\ndirections = "light_directions.txt"\n')
    tifffile.imwrite(tmp_path / "dark.tif", np.full(SHAPE, -0.5, np.float32))
    assert not float_images(tmp_path, radiances() - 0.5)


@pytest.mark.parametrize("noise", [0.0, 0.002, 0.02, 0.1])
@pytest.mark.parametrize("dark_share", [0.1, 0.6])
def test_noise_of_shadows_is_no_light_below_0(noise: float, dark_share: float, tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    light = np.where(np.arange(200) < 200 * dark_share, 0.0, 0.6) * np.ones((160, 1))
    images = np.float32([light + noise * rng.normal(size=light.shape) for _ in range(8)])
    notes: list[str] = []
    names = [tmp_path / f"{index}.tif" for index in range(8)]
    note_light_below_zero(images, 0.0, np.ones(light.shape, np.bool_), names, notes)
    assert not notes
    note_light_below_zero(images - np.float32(0.02 + noise), 0.0, np.ones(light.shape, np.bool_), names, notes)
    assert notes
    notes.clear()
    note_light_below_zero(images - np.float32(0.1), 0.0, light > 0, names, notes)
    assert not notes, "only used pixels count"


def test_defects_of_a_sensor_are_no_light_below_0() -> None:
    images = np.full((3, 80, 80), 0.5, np.float32)
    images[:, 10, 20:24] = -3.0
    notes: list[str] = []
    note_light_below_zero(images, 0.0, np.ones((80, 80), np.bool_), [Path(name) for name in "abc"], notes)
    assert not notes
