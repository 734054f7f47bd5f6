"""Damaged and random files of captures: each reader gives a result or one line, never a raw exception or a hang."""

from __future__ import annotations

import io
import json
import os
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import bgars
import numpy as np
import pytest
import tifffile
from bgars.files.light_files import read_filenames, read_intensities, read_numbers
from bgars.files.light_formats import LIGHT_FORMATS, read_light_file
from bgars.files.safe_files import decode_text
from bgars.io.decoders.npy import npy_array
from bgars.io.image_formats import format_of, read_pixels
from bgars.io.image_listing import choose_series, natural_key, role_of
from bgars.io.image_names import find_named_images
from bgars.io.image_tags import read_tags
from bgars.io.masks import read_mask
from bgars.io.recipe import read_recipe
from bgars.io.response import read_response_table
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image
from scipy.io import savemat

EXAMPLES = int(os.environ.get("BGARS_FUZZ", "40"))
"""Examples a test; ``make fuzz`` asks for many more."""
QUICK = settings(
    max_examples=EXAMPLES,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
LIGHT_SUFFIXES = sorted({suffix for kind in LIGHT_FORMATS for suffix in kind.suffixes})
LIGHTS = bgars.LightRig.ring(4).directions


@contextmanager
def named(name: str, content: bytes) -> Iterator[Path]:
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        path = Path(folder) / name
        path.write_bytes(content)
        yield path


def refuses_in_one_line(read: object, path: Path) -> None:
    try:
        read(path)  # type: ignore[operator]
    except bgars.BgarsError as error:
        message = str(error)
        assert "\n" not in message
        assert "\0" not in message
        assert len(message) < 3000


def saved(write: object, *values: object, **options: object) -> bytes:
    buffer = io.BytesIO()
    write(buffer, *values, **options)  # type: ignore[operator]
    return buffer.getvalue()


def picture(name: str, pixels: np.ndarray) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, name)
    return buffer.getvalue()


GREY = np.random.default_rng(0).integers(0, 255, (9, 11), dtype=np.uint8)
RGBA = np.random.default_rng(1).integers(0, 255, (9, 11, 4), dtype=np.uint8)
IMAGES = {
    ".png": picture("png", RGBA),
    ".jpg": picture("jpeg", GREY),
    ".tif": saved(tifffile.imwrite, np.stack([GREY] * 4), photometric="minisblack"),
    ".bmp": picture("bmp", GREY),
    ".pgm": picture("ppm", GREY),
    ".tga": picture("tga", RGBA),
    ".gif": picture("gif", GREY),
    ".webp": picture("webp", RGBA),
    ".npy": saved(np.save, GREY),
    ".hdr": b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 9\n" + (b"\2\2\0\x09" + b"\x89\x10" * 4) * 2,
    ".pfm": b"Pf\n3 2\n-1.0\n" + bytes(24),
    ".exr": b"\x76\x2f\x31\x01" + b"\2\0\0\0channels\0chlist\0" + bytes(80),
}  # fmt: skip
TABLES = {
    ".lp": b"4\nimg_1.png 0.7 0 0.7\nimg_2.png 0 0.7 0.7\nimg_3.png -0.7 0 0.7\nimg_4.png 0 -0.7 0.7\n",
    ".txt": b"0.7 0 0.7\n0 0.7 0.7\n-0.7 0 0.7\n0 -0.7 0.7\n",
    ".csv": b"x;y;z\n0,7;0;0,7\n0;0,7;0,7\n-0,7;0;0,7\n0;-0,7;0,7\n",
    ".tsv": b"x\ty\tz\n0.7\t0\t0.7\n0\t0.7\t0.7\n-0.7\t0\t0.7\n",
    ".dat": b"N_img nrows ncols f x0 y0 mean_distance\n1 9 11 100 5 4 300\n1 2 3 0 0 1 1 1 1 0 0\n",
    ".json": json.dumps({"lights": [{"direction": [0.1, 0.2, -0.9], "intensity": [1, 1, 1]}] * 4}).encode(),
    ".dome": json.dumps({"directions": [{"x": 0.1, "y": 0, "z": 1}] * 4, "ledAdjust": []}).encode(),
    ".npy": saved(np.save, LIGHTS),
    ".mat": saved(savemat, {"L": LIGHTS, "intensities": np.ones(4)}),
}  # fmt: skip
OTHER_TABLES = {
    ".txt": b"N_img nrows ncols f x0 y0 mean_distance\n1 9 11 100 5 4 300\n1 2 3 0 0 1 1 1 1 0 0\n",
    ".csv": b'"0,7","0,0","0,7"\n"0,0","0,7","0,7"\n[0.1, 0.2, 0.9]\n',
    ".json": json.dumps({f"img_{index}.png": [0.1, 0.2, 0.9] for index in range(4)}).encode(),
    ".mat": saved(savemat, {"L": LIGHTS, "text": "hello"}, do_compression=True),
}  # fmt: skip
TOML = b"""pixel_pitch_um = 10.0
mask = "mask.png"
response = { gamma = 2.2 }
[lights]
directions = [[0.0, 0.6, 0.8], [0.6, 0.0, 0.8], [-0.6, 0.0, 0.8]]
u_deg = 0.1
"""


@st.composite
def damaged(draw: st.DrawFn, content: bytes) -> bytes:
    """Some bytes with a few changed, cut out, doubled or put in."""
    data = bytearray(content)
    for _ in range(draw(st.integers(1, 6))):
        place = draw(st.integers(0, max(len(data) - 1, 0)))
        how = draw(st.sampled_from(["set", "cut", "end", "insert", "double"]))
        if how == "set" and data:
            data[place] = draw(st.sampled_from([0, 1, 9, 0x2C, 0x2E, 0x3B, 0x7F, 0x80, 0xFF]) | st.integers(0, 255))
        elif how == "cut":
            del data[place : place + draw(st.integers(1, 9))]
        elif how == "end":
            del data[place:]
        elif how == "insert":
            data[place:place] = draw(
                st.binary(max_size=9) | st.sampled_from([b"9" * 30, b"\xff\xff\xff\xff", b"-1e999"])
            )
        else:
            data[place:place] = data[place : place + 40]
    return bytes(data)


@pytest.mark.parametrize("suffix", LIGHT_SUFFIXES)
@QUICK
@given(data=st.data())
def test_light_files(suffix: str, data: st.DataObject) -> None:
    content = data.draw(
        damaged(TABLES[suffix]) | damaged(OTHER_TABLES.get(suffix, TABLES[suffix])) | st.binary(max_size=200)
    )
    with named(f"lights{suffix}", content) as path:
        refuses_in_one_line(read_light_file, path)


@pytest.mark.parametrize("suffix", IMAGES)
@QUICK
@given(data=st.data())
def test_image_files(suffix: str, data: st.DataObject) -> None:
    content = data.draw(damaged(IMAGES[suffix]) | st.binary(max_size=200))
    with named(f"img{suffix}", content) as path:
        refuses_in_one_line(lambda path: read_tags(path, format_of(path)), path)
        refuses_in_one_line(lambda path: read_pixels(path, 1.0), path)
        refuses_in_one_line(lambda path: read_mask(path, (9, 11)), path)


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".tif", ".tga", ".npy"])
@QUICK
@given(data=st.data())
def test_captures_with_a_damaged_image(suffix: str, data: st.DataObject) -> None:
    with named(f"img_2{suffix}", data.draw(damaged(IMAGES[suffix]))) as path:
        for index in (1, 3, 4):
            path.with_name(f"img_{index}{suffix}").write_bytes(IMAGES[suffix])
        path.with_name("light_directions.txt").write_bytes(TABLES[".txt"])
        refuses_in_one_line(lambda path: bgars.read_capture(path.parent, max_megapixels=1.0), path)


@pytest.mark.parametrize("suffix", [".tif", ".npy"])
@QUICK
@given(data=st.data())
def test_damaged_stacks(suffix: str, data: st.DataObject) -> None:
    whole = IMAGES[".tif"] if suffix == ".tif" else saved(np.save, np.stack([GREY] * 4))
    with named(f"stack{suffix}", data.draw(damaged(whole))) as path:
        path.with_name("light_directions.txt").write_bytes(TABLES[".txt"])
        refuses_in_one_line(lambda path: bgars.read_capture(path.parent, max_megapixels=1.0), path)


@QUICK
@given(content=damaged(TOML) | st.binary(max_size=200) | st.text(max_size=200).map(str.encode))
def test_recipes(content: bytes) -> None:
    with named("capture.toml", content) as path:
        refuses_in_one_line(read_recipe, path)
        refuses_in_one_line(lambda path: bgars.read_capture(path.parent), path)


@QUICK
@given(content=damaged(TABLES[".csv"]) | st.binary(max_size=200))
def test_tables_of_numbers(content: bytes) -> None:
    with named("numbers.csv", content) as path:
        refuses_in_one_line(read_filenames, path)
        refuses_in_one_line(read_intensities, path)
        refuses_in_one_line(lambda path: read_numbers(path, (2,), "pairs"), path)
        refuses_in_one_line(lambda path: read_response_table(path, 255.0), path)


@QUICK
@given(names=st.lists(st.text(min_size=1, max_size=300), max_size=6))
def test_names_of_any_kind(names: list[str]) -> None:
    for name in names:
        role_of(name)
        natural_key(name)
    sorted(names, key=natural_key)
    choose_series(names, 3)
    with named("img_1.png", IMAGES[".png"]) as path:
        refuses_in_one_line(lambda path: find_named_images(path.parent, names or ["x"], None), path)


@QUICK
@given(content=st.binary(max_size=300))
def test_text_of_any_bytes(content: bytes) -> None:
    refuses_in_one_line(lambda path: decode_text(content, path), Path("a.txt"))


@QUICK
@given(text=st.text(st.characters(exclude_categories=["Cs", "Cc"]), min_size=1, max_size=60))
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-32"])
def test_text_survives_its_encoding(encoding: str, text: str) -> None:
    if not text.startswith("\ufeff"):
        assert decode_text(text.encode(encoding), "a.txt").content == text


@QUICK
@given(
    vectors=st.lists(st.tuples(*[st.floats(-1, 1)] * 2, st.floats(0.1, 1)), min_size=4, max_size=9),
    separator=st.sampled_from([" ", "\t", ",", ", ", ";", "  "]),
    decimal_comma=st.booleans(),
    count=st.booleans(),
)
def test_what_is_written_is_read(
    vectors: list[tuple[float, float, float]], separator: str, decimal_comma: bool, count: bool
) -> None:
    if decimal_comma and "," in separator:
        return
    lines = [
        separator.join([f"my img {index}.png", *(f"{v:.6f}" for v in vector)]) for index, vector in enumerate(vectors)
    ]
    text = "\n".join([str(len(lines))] * count + lines)
    if decimal_comma:
        text = "\n".join(
            line if line.isdecimal() else line.replace(".", ",").replace(",png", ".png") for line in text.split("\n")
        )
    with named("lights.lp", text.encode()) as path:
        table = read_light_file(path)
    np.testing.assert_allclose(table.vectors, np.round(vectors, 6), atol=1e-6)
    assert table.files[3] == "my img 3.png"


def test_a_header_of_an_array_is_checked_before_anything_is_allocated() -> None:
    content = IMAGES[".npy"].replace(b"(9, 11)", b"(99999999, 11)")
    with named("img.npy", content) as path, pytest.raises(ValueError, match=r"mmap|shape|size"):
        npy_array(path)
