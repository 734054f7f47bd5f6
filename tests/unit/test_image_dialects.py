"""Image files and folders in every dialect: read right, and what had to be assumed is said; or refused in one line."""

from __future__ import annotations

import json
import struct
import subprocess
import sys
from pathlib import Path

import imageio.v3 as iio
import numpy as np
import pytest
import tifffile
from bgars.io.image_formats import IMAGE_FORMATS
from bgars.io.image_tags import upright
from case_captures import (
    COUNT,
    LIGHTS,
    SHAPE,
    levels,
    lp_lines,
    radiances,
    read_with_notes,
    reads_right,
    recipe,
    refused,
    write_directions,
    write_images,
    write_lp,
)
from PIL import Image

LOSSY = "hardly ever proportional"


def names_of(pattern: str, first: int = 1) -> list[str]:
    return [pattern.format(index) for index in range(first, first + COUNT)]


@pytest.mark.parametrize(
    ("pattern", "words"),
    [
        ("a.{}.tga", []),
        ("a{}.webp", ["WebP", LOSSY]),
        ("a{}.gif", ["GIF", LOSSY]),
        ("a{}.bmp", []),
        ("a{}.pgm", []),
        ("a{}.TIF", []),
        ("DSC_{}.PNG", []),
        ("a{}.npy", []),
        ("a{}.exr", []),
        ("a{}.hdr", []),
    ],
)
def test_formats(tmp_path: Path, pattern: str, words: list[str]) -> None:
    names = names_of(pattern)
    write_directions(tmp_path)
    for name, image, exact in zip(names, levels(), radiances(), strict=True):
        path = tmp_path / name
        if path.suffix == ".npy":
            np.save(path, image)
        elif path.suffix == ".exr":
            write_exr(path, exact)
        elif path.suffix == ".hdr":
            write_hdr(path, exact, packed=bool(len(name) % 2))
        elif path.suffix == ".webp":
            Image.fromarray(image).save(path, lossless=True)
        else:
            iio.imwrite(path, image)
    reads_right(tmp_path, *words, within_deg=1.0 if pattern.endswith("hdr") else 0.5)


def write_exr(path: Path, image: np.ndarray, channels: str = "RGB") -> None:
    open_exr = pytest.importorskip("OpenEXR")
    pixels = {channel: image.astype(np.float32) for channel in channels}
    open_exr.File({"compression": open_exr.ZIP_COMPRESSION, "type": open_exr.scanlineimage}, pixels).write(str(path))


def write_hdr(path: Path, image: np.ndarray, *, packed: bool) -> None:
    mantissa, exponent = np.frexp(image)
    rgbe = np.stack([np.floor(mantissa * 256.0)] * 3 + [exponent + 128.0], axis=-1).astype(np.uint8)
    rows, columns = image.shape
    body = rgbe.tobytes()
    if packed:
        lines = []
        for row in rgbe:
            lines.append(b"\x02\x02" + struct.pack(">H", columns))
            for channel in row.T:
                if (channel == channel[0]).all():
                    lines.append(bytes([128 + columns, channel[0]]))
                else:
                    lines.append(bytes([columns]) + channel.tobytes())
        body = b"".join(lines)
    path.write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n" + f"-Y {rows} +X {columns}\n".encode() + body)


@pytest.mark.parametrize("packed", [False, True])
def test_radiance_values_are_exact(tmp_path: Path, packed: bool) -> None:
    from bgars.io.image_formats import read_pixels  # noqa: PLC0415 - the only test of pixels alone

    exact = np.array([[0.5, 0.25, 1.0, 96.0, 0.75, 0.5, 0.5, 0.5, 2.0]] * 3)
    write_hdr(tmp_path / "a.hdr", exact, packed=packed)
    np.testing.assert_allclose(read_pixels(tmp_path / "a.hdr", 1.0)[..., 1], exact, rtol=1 / 128)


def test_exr_of_one_channel(tmp_path: Path) -> None:
    write_directions(tmp_path)
    for name, image in zip(names_of("a{}.exr"), radiances(), strict=True):
        write_exr(tmp_path / name, image, "Y")
    reads_right(tmp_path)


@pytest.mark.parametrize("order", ["lights first", "colour", "lights last", "tiff", "tiff colour", "float tiff"])
def test_one_file_with_all_images(tmp_path: Path, order: str) -> None:
    write_directions(tmp_path)
    images = levels(16)
    color = np.repeat(images[..., None], 3, axis=3)
    if order.endswith("tiff"):
        pages = radiances().astype(np.float32) if order.startswith("float") else images
        tifffile.imwrite(tmp_path / "stack.tif", pages, photometric="minisblack")
    elif order == "tiff colour":
        tifffile.imwrite(tmp_path / "stack.tif", color, photometric="rgb")
    else:
        array = {"lights first": images, "colour": color, "lights last": np.moveaxis(images, 0, 2)}[order]
        np.save(tmp_path / "stack.npy", array)
    capture = reads_right(tmp_path, "stack of 8 images")
    assert len(capture.files) == COUNT
    assert capture.rig.files[3].endswith("[3]")


def test_a_stack_named_in_the_recipe(tmp_path: Path) -> None:
    tifffile.imwrite(tmp_path / "all.tif", levels(), photometric="minisblack")
    write_directions(tmp_path, "l.txt")
    recipe(tmp_path, 'images = ["all.tif"]\n[lights]\ndirections = "l.txt"\n')
    reads_right(tmp_path, "stack of 8")


def test_a_stack_of_another_number(tmp_path: Path) -> None:
    tifffile.imwrite(tmp_path / "all.tif", levels()[:5], photometric="minisblack")
    write_directions(tmp_path)
    refused(tmp_path, "all.tif", "5 images", "8")
    (tmp_path / "all.tif").unlink()
    np.save(tmp_path / "all.npy", levels()[:5])
    refused(tmp_path, "all.npy", "8 images", "(5, 20, 26)")


def test_pages_of_single_images_are_not_dropped(tmp_path: Path) -> None:
    write_directions(tmp_path)
    names = write_images(tmp_path, names_of("a{}.tif"))
    tifffile.imwrite(tmp_path / names[2], levels()[:2], photometric="minisblack")
    refused(tmp_path, "a3.tif", "holds 2 images")


def test_a_reduced_page_is_a_preview(tmp_path: Path) -> None:
    write_directions(tmp_path)
    for name, image in zip(names_of("a{}.tif"), levels(), strict=True):
        with tifffile.TiffWriter(tmp_path / name) as file:
            file.write(image, photometric="minisblack")
            file.write(image[::2, ::2], photometric="minisblack", subfiletype=1)
    reads_right(tmp_path)


@pytest.mark.parametrize("orientation", range(1, 9))
@pytest.mark.parametrize("suffix", [".jpg", ".tif", ".png", ".webp"])
def test_orientation_is_applied(tmp_path: Path, orientation: int, suffix: str) -> None:
    write_directions(tmp_path)
    for name, image in zip(names_of("a{}" + suffix), levels(), strict=True):
        write_turned(tmp_path / name, image, orientation)
    words = [LOSSY] if suffix in (".jpg", ".webp") else []
    reads_right(tmp_path, *words, *([f"orientation tag ({orientation})"] if orientation > 1 else []))


def write_turned(path: Path, image: np.ndarray, orientation: int) -> None:
    """Store an image so that its tag turns it upright."""
    back = {5: 5, 6: 8, 7: 7, 8: 6}.get(orientation, orientation)
    exif = Image.Exif()
    exif[274] = orientation
    options = {"quality": 100} if path.suffix == ".jpg" else {"lossless": True} if path.suffix == ".webp" else {}
    Image.fromarray(upright(image, back)).save(path, exif=exif, **options)


def test_different_orientations_are_refused(tmp_path: Path) -> None:
    write_directions(tmp_path)
    for index, (name, image) in enumerate(zip(names_of("a{}.tif"), levels(), strict=True)):
        write_turned(tmp_path / name, image, 3 if index == 4 else 1)
    refused(tmp_path, "a5.tif", "orientation tag is 3", "a1.tif is 1")


def test_srgb_files_are_linearised_exactly(tmp_path: Path) -> None:
    linear = radiances()
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    for bits, kind in ((8, np.uint8), (16, np.uint16)):
        write_images(tmp_path, images=np.rint(encoded * (2**bits - 1)).astype(kind))
        write_directions(tmp_path, "l.txt")
        recipe(tmp_path, 'response = "srgb"\n[lights]\ndirections = "l.txt"\n')
        capture = reads_right(tmp_path, within_deg=0.5 if bits == 8 else 0.01)
        assert capture.response is not None
        code = 128 * (2**bits - 1) // 255
        exact = ((code / (2**bits - 1) + 0.055) / 1.055) ** 2.4
        assert capture.response[code] == pytest.approx(exact * (2**bits - 1), rel=1e-6)


def test_jpeg_is_doubted_until_the_recipe_says_what_it_is(tmp_path: Path) -> None:
    write_images(tmp_path, names_of("a{}.jpg"))
    write_directions(tmp_path)
    assert LOSSY in read_with_notes(tmp_path)[1][0]
    write_directions(tmp_path, "l.txt")
    recipe(tmp_path, 'response = "linear"\n[lights]\ndirections = "l.txt"\n')
    assert read_with_notes(tmp_path)[1] == []


@pytest.mark.parametrize("bits", [10, 12, 14])
@pytest.mark.parametrize("shift", [False, True])
def test_the_depth_of_the_camera(tmp_path: Path, bits: int, shift: bool) -> None:
    top = 2**bits - 1
    images = np.minimum(np.rint(radiances() * 1.6 * top), top).astype(np.uint16)
    write_images(tmp_path, images=images << (16 - bits) if shift else images)
    write_directions(tmp_path)
    expected = top << (16 - bits) if shift else top
    capture, notes = read_with_notes(tmp_path)
    assert f"{bits} bits" in notes[0]
    assert f"saturation = {expected}" in notes[0]
    assert capture.saturation == capture.full_scale == expected
    recipe(tmp_path, '[lights]\ndirections = "light_directions.txt"\n')
    for stated, full_scale in ((65535, 65535), (expected, 65535 if shift else expected), (1000, 65535)):
        recipe(tmp_path, f'saturation = {stated}\n[lights]\ndirections = "light_directions.txt"\n')
        capture, notes = read_with_notes(tmp_path)
        assert notes == []
        assert (capture.saturation, capture.full_scale) == (stated, full_scale)


def test_a_response_table_of_a_12_bit_camera(tmp_path: Path) -> None:
    encoded = np.rint(4095 * np.minimum(radiances() * 1.4, 1.0) ** 0.5).astype(np.uint16)
    write_images(tmp_path, images=encoded)
    write_directions(tmp_path)
    rows = "\n".join(f"{level},{(level / 4095) ** 2}" for level in range(4096))
    (tmp_path / "r.csv").write_text(rows, encoding="utf-8")
    recipe(tmp_path, 'response = { table = "r.csv" }\n[lights]\ndirections = "light_directions.txt"\n')
    capture, _ = read_with_notes(tmp_path)
    assert capture.response is not None
    assert len(capture.response) == 65536
    assert capture.response[2048] == pytest.approx(4095 * (2048 / 4095) ** 2, rel=1e-5)
    assert capture.full_scale == 4095


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
    assert reads_right(tmp_path).mask.all(), "a recipe says everything"


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
    refused(tmp_path, "capture.toml.txt is not read", "must be called capture.toml")


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
