"""TIFF pages of every meaning, one a file and all in one: more is brighter, or the meaning is refused by name."""

from __future__ import annotations

import re
from pathlib import Path

import bgars
import numpy as np
import pytest
import tifffile
from bgars.io.masks import read_mask
from case_captures import COUNT, levels, radiances, reads_right, refused, truth, write_directions
from PIL import Image

RAMP = np.tile(np.arange(256)[::-1], (3, 1)).astype(np.uint16)
"""A table of colours from white down to black."""


def page(kind: str, image: np.ndarray) -> tuple[np.ndarray, dict[str, object]]:
    """Numbers that mean an image (H, W) of 8 or 16 bits under a photometric interpretation, and how they are written.

    Luma and CMYK are written by Pillow, which is asked for the numbers.
    """
    full = np.iinfo(image.dtype).max
    colour = np.repeat(image[..., None], 3, axis=2)
    if kind == "miniswhite":
        return full - image, {}
    if kind.startswith("palette"):
        return full - image, {"photometric": "palette", "colormap": RAMP * {"palette 256": 256}.get(kind, 257)}
    if kind == "separated":
        return np.dstack([full - colour, 0 * image]), {}
    if kind == "black ink":
        return np.dstack([0 * colour, full - image]), {"photometric": "separated"}
    if kind == "ycbcr":
        return np.asarray(Image.fromarray(colour).convert("YCbCr")), {}
    return (colour if kind in {"rgb", "cielab"} else image), {}


READ = [
    ("minisblack", 8),
    ("minisblack", 16),
    ("miniswhite", 8),
    ("miniswhite", 16),
    ("rgb", 8),
    ("palette", 8),
    ("palette 256", 8),
    ("separated", 8),
    ("separated", 16),
    ("black ink", 8),
    ("ycbcr", 8),
]


@pytest.mark.parametrize("stack", [False, True], ids=["one a file", "stack"])
@pytest.mark.parametrize(("kind", "bits"), READ)
def test_what_a_page_means_is_read(tmp_path: Path, kind: str, bits: int, stack: bool) -> None:
    write_directions(tmp_path)
    write(tmp_path, kind, levels(bits), stack)
    capture = reads_right(tmp_path, *(["stack of 8 images"] if stack else []))
    np.testing.assert_allclose(capture.images.astype(int), levels(bits).astype(int), atol=1)


@pytest.mark.parametrize("stack", [False, True], ids=["one a file", "stack"])
@pytest.mark.parametrize("kind", ["cielab", "cfa"])
def test_other_meanings_are_refused_by_name(tmp_path: Path, kind: str, stack: bool) -> None:
    write_directions(tmp_path)
    write(tmp_path, kind, levels(), stack)
    refused(tmp_path, "a.tif" if stack else "a0.tif", f"of {kind.upper()}")


def test_floats_whose_0_is_white_have_no_white(tmp_path: Path) -> None:
    write_directions(tmp_path)
    tifffile.imwrite(tmp_path / "a.tif", radiances().astype(np.float32), photometric="miniswhite")
    refused(tmp_path, "a.tif", "float32", "MINISWHITE")


def write(folder: Path, kind: str, images: np.ndarray, stack: bool) -> None:
    for index in range(1 if stack else COUNT):
        with tifffile.TiffWriter(folder / ("a.tif" if stack else f"a{index}.tif")) as file:
            for image in images if stack else images[index : index + 1]:
                numbers, options = page(kind, image)
                file.write(numbers, **{"photometric": kind, "metadata": None, **options})  # type: ignore[arg-type]


@pytest.mark.parametrize("mode", ["L", "RGB", "YCbCr"])
@pytest.mark.parametrize("stack", [False, True], ids=["one a file", "stack"])
def test_jpeg_within_a_tiff(tmp_path: Path, mode: str, stack: bool) -> None:
    write_directions(tmp_path)
    pages = [Image.fromarray(image).convert("RGB").convert(mode) for image in levels()]
    for index, image in enumerate(pages[: 1 if stack else COUNT]):
        rest = pages[1:] if stack else []
        image.save(tmp_path / f"a{index}.tif", compression="jpeg", quality=95, save_all=True, append_images=rest)
    capture = reads_right(tmp_path, *(["stack of 8 images"] if stack else []), within_deg=2.0)
    np.testing.assert_allclose(capture.images.astype(int), levels().astype(int), atol=3)


@pytest.mark.parametrize("kind", ["CMYK", "YCbCr", "P"])
def test_normal_maps_too(tmp_path: Path, kind: str) -> None:
    codes = Image.fromarray(np.rint((truth() + 1.0) * 127.5).astype(np.uint8))
    (codes.quantize(256) if kind == "P" else codes.convert(kind)).save(tmp_path / "n.tif")
    read = bgars.read_normal_map(tmp_path / "n.tif", directx=False)
    within_deg = 5.0 if kind == "P" else 2.0  # 256 colours; two roundings
    assert np.degrees(np.arccos(np.clip((read * truth()).sum(axis=2), -1.0, 1.0))).max() < within_deg


def test_a_normal_map_in_lab_says_so(tmp_path: Path) -> None:
    tifffile.imwrite(tmp_path / "n.tif", np.zeros((4, 5, 3), np.uint8), photometric="cielab")
    with pytest.raises(bgars.FileFormatError, match=re.escape("n.tif: holds uint8 in 3 channels of CIELAB")):
        bgars.read_normal_map(tmp_path / "n.tif")


def test_a_palette_is_no_height_map(tmp_path: Path) -> None:
    tifffile.imwrite(tmp_path / "n.tif", levels()[0], photometric="palette", colormap=RAMP * 257)
    with pytest.raises(bgars.FileFormatError, match="one grey image"):
        bgars.read_height(tmp_path / "n.tif")


def test_opacity_of_a_stack_is_the_mask(tmp_path: Path) -> None:
    write_directions(tmp_path)
    alpha = np.full(levels().shape, 255, np.uint8)
    alpha[:, :, :4] = 0
    alpha[3, 0, 7] = 0
    pixels = np.concatenate([np.repeat(levels()[..., None], 3, axis=3), alpha[..., None]], axis=3)
    tifffile.imwrite(tmp_path / "a.tif", pixels, photometric="rgb", extrasamples=["unassalpha"])
    capture = reads_right(tmp_path, "stack of 8 images", "transparent pixels")
    np.testing.assert_array_equal(capture.mask, alpha.min(axis=0) > 0)


def test_a_mask_whose_0_is_white(tmp_path: Path) -> None:
    shown = np.zeros((6, 8), np.uint8)
    shown[2:4, 3:6] = 255
    tifffile.imwrite(tmp_path / "m.tif", 255 - shown, photometric="miniswhite", metadata=None)
    np.testing.assert_array_equal(read_mask(tmp_path / "m.tif", (6, 8)), shown > 0)
