"""Every wrong input gets one message that names file or argument, rule and value."""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bgars
import imageio.v3 as iio
import numpy as np
import pytest

RING = "[lights]\nring = { count = 4, elevation_deg = 45.0 }\n"
PITCH = "pixel_pitch_um = 10.0\n"


def recipe(folder: Path, text: str) -> None:
    (folder / "capture.toml").write_text(text, encoding="utf-8")


def refused(folder: Path, error: type[Exception], *words: str) -> None:
    with pytest.raises(error) as caught:
        bgars.read_capture(folder)
    message = str(caught.value)
    assert "\n" not in message
    for word in words:
        assert word in message, message


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("pixel_pich_um = 3\n" + RING, ["unknown key 'pixel_pich_um'", "'pixel_pitch_um'"]),
        ("[lights]\nrings = { count = 4 }\n", ["unknown key 'lights.rings'", "'ring'"]),
        ("[lights]\nring = { count = 4, elevation = 45 }\n", ["lights.ring.elevation", "'elevation_deg'"]),
        ("response = { gama = 2.2 }\n" + RING, ["gama", "'gamma'"]),
        ("pixel_pitch_um = -3\n" + RING, ["pixel_pitch_um", "greater than 0", "-3"]),
        ('pixel_pitch_um = "wide"\n' + RING, ["pixel_pitch_um", "number", "wide"]),
        ("pixel_pitch_u_um = 0.1\n" + RING, ["pixel_pitch_u_um: goes with pixel_pitch_um", "got 0.1"]),
        (PITCH + "pixel_pitch_u_um = 1.01\n" + RING, ["pixel_pitch_u_um", "a tenth of pixel_pitch_um (1)", "got 1.01"]),
        (PITCH + "pixel_pitch_u_um = 0\n" + RING, ["pixel_pitch_u_um", "greater than 0", "got 0"]),
        (PITCH + "pixel_pitch_u_um = nan\n" + RING, ["pixel_pitch_u_um", "finite", "got nan"]),
        (PITCH + "pixel_pitch_u_um = true\n" + RING, ["pixel_pitch_u_um", "number", "got True"]),
        ('camera = "entocentric"\n' + RING, ['camera: must be "telecentric" or { distance_mm', "got 'entocentric'"]),
        ("camera = 150\n" + RING, ["camera: must be", "distance_mm", "got 150"]),
        ("camera = { distance_um = 5 }\n" + RING, ["unknown key 'camera.distance_um'", "'distance_mm'"]),
        ("camera = {}\n" + RING, ["camera.distance_mm", "required"]),
        ("camera = { distance_mm = -150 }\n" + RING, ["camera.distance_mm: ", "greater than 0", "got -150"]),
        ("camera = { distance_mm = nan }\n" + RING, ["camera.distance_mm: ", "greater than 0", "got nan"]),
        ('camera = { distance_mm = "150" }\n' + RING, ["camera.distance_mm: ", "number", "got '150'"]),
        (RING + "u_deg = 0\n", ["lights.u_deg: ", "greater than 0", "got 0"]),
        (RING + "u_deg = inf\n", ["lights.u_deg: ", "finite", "got inf"]),
        (RING + "u_deg = true\n", ["lights.u_deg: ", "number", "got True"]),
        (RING + 'u_deg = "0.05"\n', ["lights.u_deg: ", "number", "got '0.05'"]),
        (RING + "u_deg = [0.1, 0.1, -0.1, 0.1]\n", ["lights.u_deg.2: ", "greater than 0", "got -0.1"]),
        (RING + "u_deg = [0.1, 0.1, 0.1]\n", ["(lights.u_deg): 3 uncertainties", "4 lights"]),
        (RING + "u_deg = []\n", ["(lights.u_deg): 0 uncertainties", "4 lights"]),
        ("u_deg = 0.05\n" + RING, ["unknown key 'u_deg'"]),
        ("response = { gamma = -1 }\n" + RING, ["response.gamma: ", "greater than 0", "got -1"]),
        ("response = { table = 5 }\n" + RING, ["response.table: ", "string", "got 5"]),
        (RING + 'intensities = [1, "x", 1, 1]\n', ["lights.intensities.1: ", "number", "got 'x'"]),
        ("black_level = 300\n" + RING, ["black_level", "255", "300"]),
        ("[lights]\nring = { count = 2 }\n", ["lights.ring.count", "3", "2"]),
        ("[lights]\nring = { count = 4, elevation_deg = 95 }\n", ["elevation_deg", "90", "95"]),
        ('[lights]\nlp = "a.lp"\nring = { count = 4 }\n', ["exactly one of", "lp and ring"]),
        ("[lights]\nintensities = [1, 1, 1, 1]\n", ["exactly one of", "none of them"]),
        ("pixel_pitch_um = 3\n", ["lights: missing"]),
        ("[lights]\nring = { count = 5 }\n", ["4 images", "5 lights"]),
        ("[lights]\nring = { count = 4 }\nintensities = [1, 1, 1]\n", ["3 intensities", "4 lights"]),
        ("[lights]\nring = { count = 4 }\nintensities = [1, 1, 0, 1]\n", ["light 2", "above 0", "0"]),
        ("[lights]\ndirections = [[0, 0, 1], [0, 0, 1]]\n", ["at least 3 lights", "2"]),
        ("[lights]\ndirections = [[0, 0, 2], [1, 0, 0], [0, 1, 0], [0, 0, 1]]\n", ["[0]", "unit vector", "2"]),
        ("[lights]\nangles_deg = [[0, 45], [90, 45], [180, -5], [270, 45]]\n", ["light 2", "(0, 90]", "-5"]),
        (
            "[lights]\npositions_mm = [[1, 0, 9], [0, 1, 9], [0, 0, -9], [1, 1, 9]]\n",
            ["[2]", "above the board", "-9000"],
        ),
        ("[lights]\npositions_mm = [[1, 0, 9], [0, 1, 9], [0, 0, 9], [1, 1, 9]]\n", ["pixel_pitch_um", "needed"]),
        ("[lights]\nring = { count = 4 }\nintensity_distance_mm = 5\n", ["intensity_distance_mm", "positions_mm"]),
        ("not toml at all", ["is not valid TOML"]),
    ],
)
def test_recipes(capture_folder: Path, text: str, words: list[str]) -> None:
    recipe(capture_folder, text)
    refused(capture_folder, bgars.BgarsError, "capture.toml", *words)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ("0,0\n100,1\n", ["cover grey levels 0 to 255", "0 to 100"]),
        ("0,0\n100,2\n255,1\n", ["radiance must grow", "2 then 1"]),
        ("0,0\n0,1\n255,2\n", ["grey level must grow"]),
        ("level,radiance\n0,0\nx,y\n", ["line 3", "two numbers"]),
        ("level,radiance\n", ["at least 2 lines"]),
    ],
)
def test_response_tables(capture_folder: Path, table: str, words: list[str]) -> None:
    (capture_folder / "response.csv").write_text(table, encoding="utf-8")
    recipe(capture_folder, 'response = { table = "response.csv" }\n' + RING)
    refused(capture_folder, bgars.BgarsError, "response.csv", *words)


def test_parallel_lights_are_refused_before_any_work() -> None:
    with pytest.raises(bgars.InputError, match=r"rank-deficient.*one plane"):
        bgars.estimate_normals(np.zeros((4, 2, 2), np.uint8), np.tile([0.0, 0.0, 1.0], (4, 1)))


def test_a_folder_without_lights(capture_folder: Path) -> None:
    (capture_folder / "capture.toml").unlink()
    refused(capture_folder, bgars.InputError, "no description of the lights", "capture.toml", ".lp")


def test_a_folder_that_is_missing_or_a_file(tmp_path: Path) -> None:
    refused(tmp_path / "none", bgars.FileFormatError, "none", "no such folder")
    (tmp_path / "file").touch()
    refused(tmp_path / "file", bgars.FileFormatError, "is not a folder")


def test_a_missing_image(capture_folder: Path) -> None:
    recipe(capture_folder, 'images = ["img0.png", "img1.png", "img2.png", "gone.png"]\n' + RING)
    refused(capture_folder, bgars.FileFormatError, "gone.png", "no such image")


def test_another_image_size_and_depth(capture_folder: Path) -> None:
    iio.imwrite(capture_folder / "img2.png", np.zeros((5, 7), np.uint8))
    refused(capture_folder, bgars.FileFormatError, "img2.png", "7 x 5", "6 x 5")
    iio.imwrite(capture_folder / "img2.png", np.zeros((5, 6), np.uint16))
    refused(capture_folder, bgars.FileFormatError, "img2.png", "16 bit", "8 bit")


@pytest.mark.parametrize("suffix", [".png", ".tif", ".jpg", ".bmp", ".pgm"])
def test_an_image_without_a_byte_is_called_empty(capture_folder: Path, suffix: str) -> None:
    for index in range(4):
        (capture_folder / f"img{index}.png").unlink()
        iio.imwrite(capture_folder / f"img{index}{suffix}", np.full((5, 6), 99, np.uint8))
    (capture_folder / f"img1{suffix}").write_bytes(b"")
    refused(capture_folder, bgars.FileFormatError, f"img1{suffix}: is empty (0 bytes), not an image")


@pytest.mark.parametrize("suffix", [".png", ".tif", ".jpg", ".bmp", ".pgm"])
def test_truncated_images(capture_folder: Path, suffix: str) -> None:
    for index in range(4):
        (capture_folder / f"img{index}.png").unlink()
        noise = np.random.default_rng(index).integers(0, 255, (60, 60), dtype=np.uint8)
        iio.imwrite(capture_folder / f"img{index}{suffix}", noise)
    path = capture_folder / f"img1{suffix}"
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 3])
    refused(capture_folder, bgars.FileFormatError, path.name, "cannot be decoded")


def test_a_text_file_named_png(capture_folder: Path) -> None:
    (capture_folder / "img1.png").write_text("hello", encoding="utf-8")
    refused(capture_folder, bgars.FileFormatError, "img1.png", "cannot be decoded")


def test_a_gigantic_header_is_refused(capture_folder: Path) -> None:
    header = struct.pack(">IIBBBBB", 100_000, 100_000, 8, 0, 0, 0, 0)

    def chunk(kind: bytes, body: bytes) -> bytes:
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    blob = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(b"")) + chunk(b"IEND", b"")
    (capture_folder / "img1.png").write_bytes(blob)
    refused(capture_folder, bgars.FileFormatError, "img1.png", "100000 x 100000", "10000 megapixels", "256")


def test_nan_in_a_float_stack(capture_folder: Path) -> None:
    for index in range(4):
        (capture_folder / f"img{index}.png").unlink()
        image = np.full((5, 6), 0.5, np.float32)
        if index == 2:
            image[3, 4] = np.nan
        iio.imwrite(capture_folder / f"img{index}.tif", image)
    refused(capture_folder, bgars.InputError, "img2.tif", "1 pixels", "row 3, column 4")
    mask = np.full((5, 6), 255, np.uint8)
    mask[3, 4] = 0
    iio.imwrite(capture_folder / "mask.png", mask)
    recipe(capture_folder, 'mask = "mask.png"\n' + RING)
    assert bgars.estimate_normals(bgars.read_capture(capture_folder)).mask.sum() == 29


def test_masks(capture_folder: Path) -> None:
    recipe(capture_folder, 'mask = "m.png"\n' + RING)
    refused(capture_folder, bgars.FileFormatError, "m.png")
    iio.imwrite(capture_folder / "m.png", np.zeros((5, 6), np.uint8))
    refused(capture_folder, bgars.InputError, "m.png", "empty")
    iio.imwrite(capture_folder / "m.png", np.zeros((6, 5), np.uint8))
    refused(capture_folder, bgars.InputError, "m.png", "5 x 6", "6 x 5")


def test_dark_frames(capture_folder: Path) -> None:
    recipe(capture_folder, 'dark = "d.png"\n' + RING)
    iio.imwrite(capture_folder / "d.png", np.zeros((6, 5), np.uint8))
    refused(capture_folder, bgars.InputError, "d.png", "5 x 6", "6 x 5")
    iio.imwrite(capture_folder / "d.png", np.zeros((5, 6), np.uint16))
    refused(capture_folder, bgars.InputError, "d.png", "uint16", "uint8")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ["line 1", "number of lights"]),
        ("5\nimg0.png 0 0 1\n", ["announces 5", "1 follow"]),
        ("1\nimg0.png 0 zero 1\n", ["line 2", "file x y z"]),
        ("1\nimg0.png 0 0 0\n", ["line 2", "not zero"]),
    ],
)
def test_lp_files(capture_folder: Path, text: str, words: list[str]) -> None:
    (capture_folder / "capture.toml").unlink()
    (capture_folder / "a.lp").write_text(text, encoding="utf-8")
    refused(capture_folder, bgars.FileFormatError, "a.lp", *words)


@pytest.mark.parametrize(
    "function",
    [
        bgars.calibrate_flat,
        bgars.calibrate_lights,
        bgars.calibrate_material,
        bgars.estimate_normals,
        bgars.evaluate,
        bgars.find_balls,
        bgars.inspect,
        bgars.reconstruct,
    ],
)
def test_a_path_is_no_capture(function: Callable[[Any], object]) -> None:
    with pytest.raises(bgars.InputError, match=r"capture: must be a Capture, as bgars.read_capture\(FOLDER\).*got str"):
        function("folder")


@pytest.mark.parametrize(
    "call",
    [
        bgars.read_truth,
        bgars.read_references,
        lambda path: bgars.write_normals(np.tile(np.float32([0, 0, 1]), (2, 2, 1)), f"{path}.png"),
        lambda path: bgars.write_height(bgars.HeightMap.from_array(np.ones((2, 2))), f"{path}.npy"),
        lambda path: bgars.write_points(bgars.HeightMap.from_array(np.ones((2, 2))), f"{path}.xyz"),
    ],
)
def test_a_name_that_no_file_can_have(call: Callable[[str], object]) -> None:
    with pytest.raises(bgars.FileFormatError, match=r"^a\\x00b.*: (cannot be|no such)"):
        call("a\0b")


def test_a_path_is_no_station() -> None:
    capture = bgars.read_capture(bgars.sample_capture())
    with pytest.raises(bgars.InputError, match=r"station: must be a Station, as bgars.read_station\(FILE\).*got str"):
        bgars.with_station(capture, "station.toml")
    with pytest.raises(bgars.FileFormatError, match=r"no\.toml"):
        bgars.inspect_place(capture, "no.toml", "R1C1")
    with pytest.raises(bgars.InputError, match="strip: the recipe names none"):
        bgars.inspect_place(capture, bgars.sample_part_recipe(), "R1C1")


def test_arrays() -> None:
    rig = bgars.LightRig.ring(4)
    images = np.zeros((4, 2, 2), np.uint8)
    cases = [
        (lambda: bgars.estimate_normals(images), "light_directions: needed"),
        (lambda: bgars.estimate_normals(images[:3], rig.directions), "3 images but 4 lights"),
        (lambda: bgars.estimate_normals(images[0], rig.directions), "must have shape"),
        (lambda: bgars.estimate_normals(images.astype(np.int64) - 1, rig.directions), "0 to 65535, got int64 from -1"),
        (lambda: bgars.estimate_normals(images.astype(np.int64) + 65536, rig.directions), "got int64 from 65536"),
        (lambda: bgars.estimate_normals(images.astype(bool), rig.directions), "float32, got bool"),
        (lambda: bgars.estimate_normals(images, rig.directions, method="magic"), "'magic'"),
        (lambda: bgars.estimate_normals(images, rig.directions, mask=np.zeros((2, 2), bool)), "no pixel"),
        (lambda: bgars.estimate_normals(images, rig.directions, mask=np.ones((3, 2), bool)), r"\(3, 2\)"),
        (lambda: bgars.estimate_normals(images, rig.directions, light_intensities=[1, 1, 1]), r"\(4,\)"),
        (
            lambda: bgars.estimate_normals(images, rig.directions, method="specular-filter", threshold=0),
            "threshold.*got 0",
        ),
        (lambda: bgars.LightRig.ring(2), "at least 3"),
        (lambda: bgars.LightRig.ring(4, u_deg=-0.1), r"u_deg\[0\].*above 0, got -0.1"),
        (lambda: bgars.LightRig.ring(4, u_deg=[0.1, 0.1]), r"u_deg.*\(4,\), one per light, got \(2,\)"),
        (lambda: rig.with_u_deg("a"), "u_deg: must be an array of numbers"),
        (lambda: rig.with_u_deg([0.1, 0.1, np.nan, 0.1]), r"u_deg\[2\].*finite and above 0, got nan"),
        (lambda: bgars.integrate_normals(np.zeros((2, 2))), r"\(H, W, 3\)"),
        (lambda: bgars.integrate_normals(np.full((2, 2, 3), np.nan)), "no pixel"),
        (
            lambda: bgars.integrate_normals(np.full((2, 2, 3), np.nan), mask=np.ones((2, 2), bool)),
            "row 0, column 0",
        ),
        (lambda: bgars.integrate_normals(np.ones((2, 2, 3)), method="magic"), "'magic'"),
        (lambda: bgars.integrate_normals(np.ones((2, 2, 3)), weights=np.ones((3, 3))), r"\(3, 3\)"),
        (lambda: bgars.integrate_normals(np.ones((2, 2, 3)), pixel_pitch_um=-1), "pixel_pitch_um.*-1"),
    ]
    for call, words in cases:
        with pytest.raises(bgars.InputError, match=words):
            call()


def test_a_solver_that_may_not_iterate_enough_says_so() -> None:
    normals = np.random.default_rng(0).normal([0, 0, 3], 0.3, (40, 40, 3)).astype(np.float32)
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    with pytest.raises(bgars.ConvergenceError, match="4 iterations") as caught:
        bgars.integrate_normals(normals, max_iters=4)
    assert caught.value.iterations == 4
    assert caught.value.residual > 1e-8


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_unwritable_output(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    height = bgars.integrate_normals(np.tile(np.float32([0, 0, 1]), (3, 3, 1)))
    with pytest.raises(bgars.FileFormatError, match="cannot be written"):
        bgars.write_height(height, tmp_path / "h.tif")


def test_outputs_where_nothing_can_be_written(tmp_path: Path) -> None:
    height = bgars.integrate_normals(np.tile(np.float32([0, 0, 1]), (3, 3, 1)))
    mesh = bgars.mesh_from_height(height)
    (tmp_path / "file").touch()
    (tmp_path / "folder.ply").mkdir()
    cases = [
        (lambda: bgars.write_height(height, tmp_path / "none" / "h.tif"), "cannot be written"),
        (lambda: bgars.write_height(height, tmp_path / "h.bmp"), "must end in"),
        (lambda: bgars.write_mesh(mesh, tmp_path / "file" / "m.ply"), "cannot be written"),
        (lambda: bgars.write_mesh(mesh, tmp_path / "folder.ply"), "is a folder"),
        (lambda: bgars.write_mesh(mesh, tmp_path / "m.xyz"), r"\.ply, \.obj, \.stl, \.glb"),
    ]
    for call, words in cases:
        with pytest.raises(bgars.BgarsError, match=words):
            call()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "folder.ply"], "nothing half-written"


def test_a_failing_write_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    height = bgars.integrate_normals(np.tile(np.float32([0, 0, 1]), (3, 3, 1)))
    path = tmp_path / "h.npy"
    bgars.write_height(height, path)
    before = path.read_bytes()

    def full_disk(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np, "save", full_disk)
    with pytest.raises(bgars.FileFormatError, match="No space left"):
        bgars.write_height(height, path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]
