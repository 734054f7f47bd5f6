"""Folders as people leave them: masks of any name, surplus files, images elsewhere; read right and said, or refused."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import imageio.v3 as iio
import numpy as np
import pytest
import tifffile
from bgars.io.image_formats import IMAGE_FORMATS
from case_captures import (
    COUNT,
    LIGHTS,
    SHAPE,
    levels,
    lp_lines,
    names_of,
    read_with_notes,
    reads_right,
    recipe,
    refused,
    write_directions,
    write_images,
    write_lp,
)
from PIL import Image

MASK = np.zeros(SHAPE, np.uint8)
MASK[4:15, 3:20] = 255


@pytest.mark.parametrize(
    ("name", "pixels", "words"),
    [
        ("mask.png", MASK, []),
        ("mask.png", np.dstack([MASK] * 3), []),
        ("mask.png", np.dstack([np.full(SHAPE, 255, np.uint8)] * 3 + [MASK]), []),
        ("mask.png", np.dstack([np.zeros(SHAPE, np.uint8)] * 3 + [MASK]), []),
        ("mask.png", np.dstack([np.full(SHAPE, 255, np.uint8), MASK]), []),
        ("mask.png", np.dstack([MASK] * 3 + [np.full(SHAPE, 255, np.uint8)]), []),
        ("mask.png", MASK.astype(np.uint16) * 257, []),
        ("Mask.png", MASK, ["Mask.png taken as the mask"]),
        ("MASK.PNG", MASK, ["MASK.PNG taken"]),
        ("mask.tif", MASK, ["mask.tif taken"]),
        ("mask.jpg", MASK, ["mask.jpg taken"]),
        ("mask.bmp", MASK, ["mask.bmp taken"]),
        ("buddha.mask.tga", MASK, ["buddha.mask.tga taken"]),
        ("coin_mask.png", MASK, ["coin_mask.png taken"]),
        ("mask.npy", MASK > 0, ["mask.npy taken"]),
    ],
)
def test_masks_of_any_name(tmp_path: Path, name: str, pixels: np.ndarray, words: list[str]) -> None:
    write_images(tmp_path)
    write_directions(tmp_path)
    if name.endswith(".npy"):
        np.save(tmp_path / name, pixels)
    elif pixels.dtype == np.uint16:
        iio.imwrite(tmp_path / name, pixels)
    else:
        Image.fromarray(pixels).save(tmp_path / name)
    capture = reads_right(tmp_path, *words)
    np.testing.assert_array_equal(capture.mask, MASK > 0)


def test_a_mask_that_is_not_used_is_named(tmp_path: Path) -> None:
    write_images(tmp_path)
    write_directions(tmp_path)
    for name in ("mask_left.png", "mask_right.png"):
        iio.imwrite(tmp_path / name, MASK)
    assert reads_right(tmp_path, "not used: mask_left.png, mask_right.png").mask.all()
    iio.imwrite(tmp_path / "mask.png", MASK)
    assert not reads_right(tmp_path, "mask_left.png, mask_right.png").mask.all()
    write_directions(tmp_path, "l.txt")
    recipe(tmp_path, '[lights]\ndirections = "l.txt"\n')
    told = 'mask_right.png are not used: capture.toml names no mask; add mask = "mask.png"'
    assert reads_right(tmp_path, told).mask.all(), "a recipe says everything"
    recipe(tmp_path, 'mask = "mask.png"\n[lights]\ndirections = "l.txt"\n')
    assert not reads_right(tmp_path).mask.all()


def test_a_mask_of_ones(tmp_path: Path) -> None:
    write_images(tmp_path)
    write_directions(tmp_path)
    iio.imwrite(tmp_path / "mask.png", MASK // 255)
    refused(tmp_path, "mask.png", "empty", "largest value is 1")


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_transparent_pixels_are_outside(tmp_path: Path, kind: type) -> None:
    write_directions(tmp_path)
    top = np.iinfo(kind).max
    suffix = ".png" if kind is np.uint8 else ".tif"
    for name, image in zip(names_of("a{}" + suffix), levels(8 if kind is np.uint8 else 16), strict=True):
        use = MASK > 0
        pixels = np.dstack([image * use] * 3 + [use * kind(top)]).astype(kind)
        if suffix == ".png":
            iio.imwrite(tmp_path / name, pixels)
        else:
            tifffile.imwrite(tmp_path / name, pixels, photometric="rgb", extrasamples=["unassalpha"])
    capture = reads_right(tmp_path, "transparent pixels")
    np.testing.assert_array_equal(capture.mask, MASK > 0)


def test_a_channel_of_unstated_meaning_is_no_opacity(tmp_path: Path) -> None:
    write_directions(tmp_path)
    for name, image in zip(names_of("a{}.tif"), levels(8), strict=True):
        pixels = np.dstack([image] * 3 + [image.max() - image])
        tifffile.imwrite(tmp_path / name, pixels, photometric="rgb", extrasamples=["unspecified"])
    assert reads_right(tmp_path, "unstated meaning is not used").mask.all()


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (["ambient.png"], ["not used: ambient.png", 'dark = "ambient.png"']),
        (["image_ambient.png"], ["not used: image_ambient.png"]),
        (["dark.png"], ["not used: dark.png", 'dark = "dark.png"']),
        (["Normal_gt.png"], ["not used: Normal_gt.png"]),
        (["normals.png", "albedo.png", "depth.tif"], ["normals.png", "albedo.png", "depth.tif"]),
        (["preview.png"], ["preview.png"]),
        (["final result.png"], ["final result.png"]),
        (["._img_01.png", "._img_02.png", ".hidden.png"], []),
        (["notes.txt", "Thumbs.db", "desktop.ini", ".DS_Store"], []),
    ],
)
def test_surplus_files_are_named_and_hidden_ones_ignored(tmp_path: Path, names: list[str], words: list[str]) -> None:
    write_images(tmp_path)
    write_directions(tmp_path)
    for name in names:
        (tmp_path / name).write_bytes((tmp_path / "img_01.png").read_bytes())
    reads_right(tmp_path, *words)


@pytest.mark.parametrize(
    "pattern", ["dark_{}.png", "normal_{}.png", "mask{}.png", "Ambient {}.png", "{}.png", "x1y2_{}.png"]
)
def test_a_series_may_be_called_anything(tmp_path: Path, pattern: str) -> None:
    if "mask" in pattern:
        pytest.skip("a series of masks is one of masks")
    names = write_images(tmp_path, names_of(pattern, 3))
    write_directions(tmp_path)
    assert [path.name for path in read_with_notes(tmp_path)[0].files] == names


def test_images_one_folder_down(tmp_path: Path) -> None:
    write_images(tmp_path / "images")
    write_directions(tmp_path)
    iio.imwrite(tmp_path / "images" / "mask.png", MASK)
    (tmp_path / "notes").mkdir()
    capture = reads_right(tmp_path, "folder images")
    np.testing.assert_array_equal(capture.mask, MASK > 0)
    write_images(tmp_path / "masks")
    reads_right(tmp_path, "folder images")
    write_images(tmp_path / "again")
    refused(tmp_path, "2 folders with 8 each", "again, images")


@pytest.mark.parametrize("pattern", ["L ({})/000.tif", "light{}/shot.png", "{}/IMG_0001.jpg"])
def test_a_folder_for_each_light(tmp_path: Path, pattern: str) -> None:
    names = write_images(tmp_path, names_of(pattern, 5))
    write_directions(tmp_path)
    capture, notes = read_with_notes(tmp_path)
    assert [path.relative_to(tmp_path).as_posix() for path in capture.files] == names
    assert "one image taken from each of 8 folders" in notes[0]


def test_what_is_there_is_said_where_no_image_fits(tmp_path: Path) -> None:
    write_directions(tmp_path)
    (tmp_path / "._a.png").touch()
    (tmp_path / "mask.png").touch()
    (tmp_path / "IMG_1.heic").touch()
    (tmp_path / "sub").mkdir()
    refused(tmp_path, "0 images (none found)", "8 lights", "._a.png", "mask.png", "IMG_1.heic", "sub")
    write_images(tmp_path)
    iio.imwrite(tmp_path / "img_09.png", levels()[0])
    refused(tmp_path, "9 images", "8 lights", "img_01.png")
    (tmp_path / "light_directions.txt").unlink()
    refused(tmp_path, "no description of the lights", "9 images")


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n", ["PostScript"]),
        (b"\xc5\xd0\xd3\xc6" + b"\0" * 64, ["PostScript"]),
        (b"%PDF-1.7\n", ["PDF"]),
        (b"\0\0\0\x18ftypheic" + b"\0" * 64, ["HEIF"]),
        (b"8BPS" + b"\0" * 64, ["Photoshop"]),
        (b"hello", ["unknown file format"]),
        (b"BMxx", ["cannot be decoded"]),
        (b"RIFF....WEBP", ["cannot be decoded"]),
    ],
)
@pytest.mark.parametrize("name", ["img_03.png", "mask.png"])
def test_bytes_choose_the_decoder_and_only_listed_ones_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, content: bytes, words: list[str], name: str
) -> None:
    def started(*_: object, **__: object) -> None:
        pytest.fail("a program was started")

    monkeypatch.setattr(subprocess, "Popen", started)
    write_images(tmp_path)
    write_directions(tmp_path)
    (tmp_path / name).write_bytes(content)
    refused(tmp_path, name, "cannot be decoded", *words)


def test_names_with_numbers_of_other_alphabets(tmp_path: Path) -> None:
    write_images(tmp_path, [f"img1²2_{index}.png" for index in range(COUNT)])
    write_directions(tmp_path)
    reads_right(tmp_path)


def test_images_in_a_list_of_another_place(tmp_path: Path) -> None:
    names = write_images(tmp_path)
    write_directions(tmp_path)
    (tmp_path / "filenames.txt").write_text("\r\n".join(rf"D:\work\{name}" for name in names), encoding="utf-8-sig")
    reads_right(tmp_path, "last part of their paths")


def test_images_of_an_lp_that_are_left_over_are_named(tmp_path: Path) -> None:
    names = write_images(tmp_path)
    write_lp(tmp_path, lp_lines(names[:6], LIGHTS[:6]))
    capture, notes = read_with_notes(tmp_path)
    assert len(capture.images) == 6
    assert "img_07.png, img_08.png" in notes[0]


def test_camera_raw_needs_its_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rawpy", None)
    for name in names_of("DSC_{}.NEF"):
        (tmp_path / name).write_bytes(b"II*\0" + b"\0" * 200)
    write_directions(tmp_path)
    refused(tmp_path, "DSC_1.NEF", "camera raw", "pip install 'bgars[raw]'")


def test_damaged_camera_raw_is_refused(tmp_path: Path) -> None:
    pytest.importorskip("rawpy")
    for name in names_of("DSC_{}.NEF"):
        (tmp_path / name).write_bytes(b"II*\0" + b"\0" * 200)
    write_directions(tmp_path)
    refused(tmp_path, "DSC_1.NEF", "cannot be decoded")


def test_every_format_is_in_the_table_once() -> None:
    suffixes = [suffix for kind in IMAGE_FORMATS for suffix in kind.suffixes]
    assert len(suffixes) == len(set(suffixes))


def test_of_a_series_developed_twice_the_better_one_is_taken(tmp_path: Path) -> None:
    write_directions(tmp_path)
    names = write_images(tmp_path, names_of("DSC_{:04d}.png"))
    write_images(tmp_path, names_of("DSC_{:04d}.JPG"))
    capture = reads_right(tmp_path, "not used: DSC_0001.JPG")
    assert [path.name for path in capture.files] == names


def test_the_course_images_of_buddha(tmp_path: Path) -> None:
    names = write_images(tmp_path, names_of("buddha.{}.tga", 0))
    Image.fromarray(MASK).save(tmp_path / "buddha.mask.tga")
    (tmp_path / "lights.txt").write_text(
        f"{COUNT}\n" + "\n".join(" ".join(f"{v:.6f}" for v in vector) for vector in LIGHTS), encoding="utf-8"
    )
    capture = reads_right(tmp_path, "buddha.mask.tga", "lights.txt")
    assert [path.name for path in capture.files] == names
    np.testing.assert_array_equal(capture.mask, MASK > 0)


def test_names_that_are_no_text(tmp_path: Path) -> None:
    write_directions(tmp_path)
    names = [f"m\udcfcnze_{index}.png" for index in range(COUNT)]
    try:
        write_images(tmp_path, names)
    except (OSError, UnicodeError):
        pytest.skip("this file system takes no such names")
    (tmp_path / "M\udcfcnze_mask.png").write_bytes((tmp_path / names[0]).read_bytes())
    done = subprocess.run(
        [sys.executable, "-m", "bgars", "info", str(tmp_path)], capture_output=True, text=True, timeout=120, check=False
    )
    assert "Traceback" not in done.stderr
    assert done.returncode in (0, 2)


def test_paths_of_windows_in_a_recipe(tmp_path: Path) -> None:
    names = write_images(tmp_path, names_of("images/a{}.png"))
    write_directions(tmp_path / "images", "l.txt")
    iio.imwrite(tmp_path / "images" / "part.png", MASK)
    listed = ", ".join(f"'{name}'".replace("/", "\\") for name in names)
    recipe(tmp_path, f"images = [{listed}]\nmask = 'images\\part.png'\n[lights]\ndirections = 'images\\l.txt'\n")
    np.testing.assert_array_equal(reads_right(tmp_path).mask, MASK > 0)


def test_a_recipe_whose_name_hides_its_ending(tmp_path: Path) -> None:
    write_images(tmp_path)
    (tmp_path / "capture.toml.txt").write_text("[lights]\nring = { count = 8 }\n", encoding="utf-8")
    refused(tmp_path, "capture.toml.txt is not read", "must be capture.toml")


def test_the_same_image_for_two_lights(tmp_path: Path) -> None:
    names = write_images(tmp_path)
    write_directions(tmp_path)
    (tmp_path / "filenames.txt").write_text("\n".join([*names[:7], names[2]]), encoding="utf-8")
    refused(tmp_path, "filenames.txt", "img_03.png", "twice")


def test_notes_are_printed_and_machines_get_json_alone(tmp_path: Path) -> None:
    names = write_images(tmp_path)
    write_lp(tmp_path, lp_lines([name.upper() for name in names]), count=False)
    done = subprocess.run(
        [sys.executable, "-m", "bgars", "info", str(tmp_path), "--json"],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    assert [line[:6] for line in done.stderr.splitlines()] == ["note: ", "note: "]
    assert len(json.loads(done.stdout)["assumed"]) == 2
