"""Captures that would hang, fill the memory, or end in a traceback: one line each, at once."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import bgars
import numpy as np
import pytest
from bgars.files.safe_files import need_regular, read_bounded, read_text
from bgars.io.toml_text import read_values
from case_captures import LIGHTS, lp_lines, recipe, refused, write_directions, write_images, write_lp

LINUX = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
PIPES = {"pipe": "a named pipe", "device": "a device", "loop": "", "folder": "a folder"}


def put(path: Path, what: str) -> None:
    path.unlink(missing_ok=True)
    if what == "pipe":
        os.mkfifo(path)
    elif what == "device":
        path.symlink_to("/dev/zero")
    elif what == "loop":
        path.symlink_to(path.name)
    else:
        path.mkdir()


@LINUX
@pytest.mark.parametrize("what", PIPES)
@pytest.mark.parametrize(
    "key", ["mask", "dark", "images", "response", "directions", "lp", "positions_mm", "angles_deg", "intensities"]
)
def test_whatever_a_recipe_names_must_be_a_regular_file(tmp_path: Path, what: str, key: str) -> None:
    write_images(tmp_path)
    write_directions(tmp_path)
    put(tmp_path / "odd.png", what)
    lights = {"directions": "light_directions.txt"}
    top = ""
    if key in ("directions", "lp", "positions_mm", "angles_deg"):
        lights = {key: "odd.png"}
    elif key == "intensities":
        lights[key] = "odd.png"
    elif key == "images":
        top = 'images = ["odd.png", "img_02.png", "img_03.png"]'
        lights = {}
    else:
        top = 'response = { table = "odd.png" }' if key == "response" else f'{key} = "odd.png"'
    told = "\n".join(f'{name} = "{value}"' for name, value in lights.items()) or "ring = { count = 3 }"
    recipe(tmp_path, f"pixel_pitch_um = 5.0\n{top}\n[lights]\n{told}\n")
    refused(tmp_path, "odd.png", "no such image file" if key == "images" else PIPES[what])


@LINUX
@pytest.mark.parametrize("what", PIPES)
@pytest.mark.parametrize(
    "name",
    ["capture.toml", "light_directions.txt", "lights.lp", "filenames.txt", "light_intensities.txt", "img_03.png"],
)
def test_whatever_lies_there_must_be_a_regular_file(tmp_path: Path, what: str, name: str) -> None:
    names = write_images(tmp_path)
    if name == "img_03.png":
        write_lp(tmp_path, lp_lines(names))
    elif name != "lights.lp":
        write_directions(tmp_path)
    put(tmp_path / name, what)
    if what == "folder" and name not in ("capture.toml", "img_03.png"):
        return  # a folder that is called so is no such file
    refused(tmp_path, name)


@LINUX
def test_the_command_line_ends_at_once(tmp_path: Path) -> None:
    write_images(tmp_path)
    write_directions(tmp_path)
    os.mkfifo(tmp_path / "mask.fifo")
    recipe(tmp_path, 'mask = "mask.fifo"\n[lights]\ndirections = "light_directions.txt"\n')
    done = subprocess.run(
        [sys.executable, "-m", "bgars", "info", str(tmp_path)], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 2
    assert "mask.fifo: is a named pipe" in done.stderr


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a." * 50_000 + "b = 1\n", ["line 1", "a key of 50001 parts"]),
        ("[" + "a." * 50_000 + "b]\n", ["line 1", "parts"]),
        ("a = " + "[" * 50_000 + "]" * 50_000, ["nested too deeply"]),
        ("a = " + "{b = " * 500 + "1" + "}" * 500, ["not valid TOML"]),
        ("a = [[[[[[[[[[[[[[[[[[[[[[[[[1]]]]]]]]]]]]]]]]]]]]]]]]]\n", ["more than 20 levels"]),
        ("x = " + "9" * 10_000, ["not valid TOML"]),
        ("#" * 1_100_000, ["larger than", "1000000"]),
        ("\0", ["not a text file"]),
        ("[lights]\nring = { count = 1e9 }\n", ["lights.ring.count", "10000", "1000000000"]),
        ("[lights]\nring = { count = 1000000000 }\n", ["lights.ring.count", "10000"]),
        ("[lights]\nring = { count = 100000000000000000000000 }\n", ["lights.ring.count"]),
        (f"[lights]\n{'k' * 5000} = 1\n", ["unknown key 'lights.kkk", "..."]),
        ('mask = "a\\u0000b.png"\n[lights]\nring = { count = 8 }\n', ["a\\x00b.png", "possible name"]),
        (f'mask = "{"m" * 300}.png"\n[lights]\nring = {{ count = 8 }}\n', ["mmm", "name too long"]),
        (f'images = ["{"m" * 300}.png", "b", "c"]\n[lights]\nring = {{ count = 3 }}\n', ["no such image"]),
        ('images = ["a\\u0000.png", "b", "c"]\n[lights]\nring = { count = 3 }\n', ["no such image"]),
        (f'[lights]\ndirections = "{"m" * 300}.txt"\n', ["mmm", "name too long"]),
        ('[lights]\nlp = "\\u0000"\n', ["possible name"]),
        ('[lights]\ndirections = ""\n', ["is a folder"]),
        (f'response = "{"r" * 10_000}"\n', ["response", "..."]),
    ],
)  # fmt: skip
def test_recipes_that_are_made_to_hurt(tmp_path: Path, text: str, words: list[str]) -> None:
    write_images(tmp_path)
    recipe(tmp_path, text)
    with pytest.raises(bgars.BgarsError) as caught:
        bgars.read_capture(tmp_path)
    message = str(caught.value)
    assert "\n" not in message
    assert len(message) < 2000
    for word in words:
        assert word.lower() in message.lower(), message


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('mask = "masks\\part.png"\n', ["write the path with /", 'mask = "masks/part.png"']),
        ("pixel_pitch_um = 3,4\n", ["decimal point", "pixel_pitch_um = 3.4"]),
        ("mask = mask.png\n", ["text in quotes", 'mask = "mask.png"']),
        ("response = srgb\n", ['response = "srgb"']),
        (b"mask = \"m\xfcnze.png\"\n", ["UTF-8"]),
    ],
)  # fmt: skip
def test_common_mistakes_are_answered_by_what_to_write(tmp_path: Path, text: str | bytes, words: list[str]) -> None:
    path = tmp_path / "capture.toml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(bgars.FileFormatError) as caught:
        read_values(path)
    for word in ("capture.toml", *words):
        assert word in str(caught.value)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_recipes_of_windows_editors(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "capture.toml"
    path.write_bytes("pixel_pitch_um = 3.4\r\n[lights]\r\nring = { count = 8 }\r\n".encode(encoding))
    assert read_values(path)["pixel_pitch_um"] == 3.4


def test_deep_json(tmp_path: Path) -> None:
    path = tmp_path / "part.json"
    for text in ("[" * 100_000, '{"a":' * 100_000, '{"a":' * 30 + "1" + "}" * 30, '{"a": ' + "9" * 10_000 + "}"):
        path.write_text(text, encoding="utf-8")
        with pytest.raises(bgars.FileFormatError, match=r"part\.json"):
            read_values(path)


def test_texts_are_bounded(tmp_path: Path) -> None:
    path = tmp_path / "light_directions.txt"
    with path.open("wb") as file:
        file.truncate(1 << 40)  # takes no room on the disc
    with pytest.raises(bgars.FileFormatError, match="larger than"):
        read_text(path)
    write_images(tmp_path)
    refused(tmp_path, "light_directions.txt", "larger than")
    path.unlink()
    with (tmp_path / "lights.mat").open("wb") as file:
        file.truncate(1 << 40)
    refused(tmp_path, "lights.mat", "larger than")


def test_rigs_of_any_size() -> None:
    for count in (10**9, 10**30):
        with pytest.raises(bgars.InputError, match="at most 10000"):
            bgars.LightRig.ring(count)


def test_arrays_that_promise_more_than_they_hold(tmp_path: Path) -> None:
    write_images(tmp_path)
    np.save(tmp_path / "lights.npy", LIGHTS)
    content = (tmp_path / "lights.npy").read_bytes()
    (tmp_path / "lights.npy").write_bytes(content.replace(b"(8, 3)", b"(99999999, 3)"))
    refused(tmp_path, "lights.npy")
    (tmp_path / "lights.npy").unlink()
    write_directions(tmp_path)
    for path in tmp_path.glob("img_*.png"):
        path.unlink()
    np.save(tmp_path / "stack.npy", np.zeros((8, 4, 4), np.uint8))
    content = (tmp_path / "stack.npy").read_bytes()
    for shape in (b"(8, 444444444, 4)", b"(8, 4, 444444)", b"(8, -4, 4)", b"(8, 4, 0)"):
        (tmp_path / "stack.npy").write_bytes(content.replace(b"(8, 4, 4)", shape))
        refused(tmp_path, "stack.npy")


def test_names_that_no_file_can_have() -> None:
    for name in ("a\0b", "x" * 5000, "a\nb" * 300):
        for ask in (need_regular, read_bounded, read_text, bgars.read_capture, bgars.read_part_recipe):
            with pytest.raises(bgars.FileFormatError) as caught:
                ask(name)
            assert "\n" not in str(caught.value)
            assert len(str(caught.value)) < 500


def test_a_folder_with_very_many_files_is_not_read_for_ever(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bgars.io.image_listing.MAX_ENTRIES", 5)
    write_images(tmp_path)
    refused(tmp_path, "8 entries", "(5)")
