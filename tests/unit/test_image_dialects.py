"""Image files of every format, stacks, orientation and grey levels: read right, and what is assumed is said."""

from __future__ import annotations

import struct
from pathlib import Path

import bgars
import imageio.v3 as iio
import numpy as np
import pytest
import tifffile
from bgars.io.image_tags import upright
from case_captures import (
    COUNT,
    levels,
    names_of,
    pfm,
    radiances,
    read_with_notes,
    reads_right,
    recipe,
    refused,
    write_directions,
    write_images,
)
from PIL import Image, ImageCms, PngImagePlugin

LOSSY = "hardly ever linear"


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
        ("a{}.pfm", []),
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
        elif path.suffix == ".pfm":
            path.write_bytes(pfm(exact, order=">" if len(name) % 2 else "<"))
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


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b"Pf\n4 3\n-1.0\n" + bytes(47), "47 bytes of pixels, 48 expected"),
        (b"PF\n4 x\n-1.0\n", "no PFM header"),
        (b"Pf\n0 3\n-1.0\n", "0 x 3 pixels"),
        (b"Pf\n900000000 900000000\n-1.0\n", "megapixels"),
    ],
)
def test_a_damaged_pfm_is_refused(tmp_path: Path, content: bytes, told: str) -> None:
    from bgars.io.image_formats import read_pixels  # noqa: PLC0415 - pixels alone

    (tmp_path / "a.pfm").write_bytes(content)
    with pytest.raises(bgars.FileFormatError, match=told):
        read_pixels(tmp_path / "a.pfm", 100.0)


@pytest.mark.parametrize("packed", [False, True])
def test_radiance_values_are_exact(tmp_path: Path, packed: bool) -> None:
    from bgars.io.image_formats import read_pixels  # noqa: PLC0415 - pixels alone

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


@pytest.mark.parametrize("suffix", [".png", ".tif"])
def test_a_colour_profile_is_doubted_as_jpeg_is(tmp_path: Path, suffix: str) -> None:
    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    write_directions(tmp_path)
    for name, image in zip(names_of("a{}" + suffix), levels(), strict=True):
        Image.fromarray(np.dstack([image] * 3)).save(tmp_path / name, icc_profile=profile)
    reads_right(tmp_path, "colour profile (a1.", LOSSY)


@pytest.mark.parametrize(
    ("gamma", "words"), [(1.0, []), (0.45455, ["gamma 0.455 by its header (a1.png)", LOSSY]), (0.0, [])]
)
@pytest.mark.parametrize("bits", [8, 16])
def test_a_gamma_in_the_header_is_doubted_too(tmp_path: Path, gamma: float, words: list[str], bits: int) -> None:
    write_directions(tmp_path)
    chunk = PngImagePlugin.PngInfo()
    chunk.add(b"gAMA", struct.pack(">I", round(100_000 * gamma)))
    for name, image in zip(names_of("a{}.png"), levels(bits), strict=True):
        Image.fromarray(image).save(tmp_path / name, pnginfo=chunk)
    reads_right(tmp_path, *words)


def test_an_animation_is_not_one_image(tmp_path: Path) -> None:
    write_images(tmp_path)
    write_directions(tmp_path)
    frames = [Image.fromarray(image) for image in levels()[:2]]
    frames[0].save(tmp_path / "img_03.png", save_all=True, append_images=frames[1:])
    refused(tmp_path, "img_03.png", "holds 2 images")


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
