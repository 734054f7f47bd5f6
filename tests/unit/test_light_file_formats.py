"""Files of lights beside .lp: text, tables, arrays, JSON, near lights; read right and said, or refused in one line."""

from __future__ import annotations

import io
import json
from pathlib import Path

import bgars
import numpy as np
import pytest
from bgars.files.light_formats import LIGHT_FORMATS, read_light_file
from bgars.files.mat_files import read_arrays
from case_captures import (
    COUNT,
    LIGHTS,
    PLAIN,
    radiances,
    read_with_notes,
    reads_right,
    recipe,
    refused,
    write_directions,
    write_images,
    write_lp,
)
from scipy.io import savemat


def text_of(vectors: np.ndarray, separator: str = " ") -> str:
    return "\n".join(separator.join(f"{value:.6f}" for value in vector) for vector in vectors) + "\n"


NAMES = [f"img_{index:02d}.png" for index in range(1, COUNT + 1)]
CV = LIGHTS * [1, -1, -1]
TEXT_DIALECTS = {
    "commas": ("light_directions.txt", text_of(LIGHTS, ","), []),
    "semicolons": ("light_directions.txt", text_of(LIGHTS, ";"), []),
    "decimal commas": ("light_directions.txt", text_of(LIGHTS).replace(".", ","), ["decimal commas"]),
    "byte order mark": ("light_directions.txt", "\ufeff" + text_of(LIGHTS), []),
    "3 x L": ("light_directions.txt", text_of(LIGHTS.T), ["3 rows of 8 numbers"]),
    "3 x L with commas": ("light_directions.txt", text_of(LIGHTS.T, ", "), ["3 rows of 8 numbers"]),
    "names": ("light_directions.txt", "\n".join(PLAIN), []),
    "names without endings": ("light_directions.txt", "\n".join(PLAIN).replace(".png", ""), ["by stem"]),
    "index column": (
        "light_directions.txt",
        "\n".join(f"{index + 1} {line}" for index, line in enumerate(text_of(LIGHTS).splitlines())),
        ["number of the light"],
    ),
    "printed by a program": (
        "light_directions.txt",
        str(LIGHTS.round(6)).replace("[", " [", 1),
        [],
    ),
    "a Python list": ("light_directions.txt", ",\n".join(str(list(vector)) for vector in LIGHTS.tolist()), []),
    "a csv with decimal commas in quotes": (
        "lights.csv",
        "\n".join(",".join(f'"{value:.6f}"'.replace(".", ",") for value in vector) for vector in LIGHTS),
        ["decimal commas"],
    ),
    "a count": ("lights.txt", f"{COUNT}\n{text_of(LIGHTS)}", ["lights taken from lights.txt"]),
    "a csv with a header": ("light_directions.csv", "x,y,z\n" + text_of(LIGHTS, ","), ["light_directions.csv"]),
    "a csv with names": (
        "lights.csv",
        "file,x,y,z\n" + "\n".join(PLAIN).replace(" ", ","),
        ["lights.csv"],
    ),
    "a csv of a spreadsheet": (
        "Light_Directions.csv",
        "lx;ly;lz\n" + text_of(LIGHTS, ";").replace(".", ","),
        ["Light_Directions.csv", "decimal commas"],
    ),
    "one length": ("light_directions.txt", text_of(LIGHTS * 60), ["length 60", "directions"]),
    "norm is intensity": ("light_directions.txt", text_of(LIGHTS * 1.0), []),
    "an intensity column": ("light_dirs.dat", text_of(np.column_stack([LIGHTS, np.ones(COUNT)])), ["fourth number"]),
    "rgb intensities": ("led.txt", text_of(np.column_stack([LIGHTS, np.ones((COUNT, 3))])), ["red, green and blue"]),
    "json by name": ("lights.json", json.dumps(dict(zip(NAMES, LIGHTS.tolist(), strict=True))), ["lights.json"]),
    "json by stem": (
        "lights.json",
        json.dumps({name[:-4]: vector for name, vector in zip(NAMES, LIGHTS.tolist(), strict=True)}),
        ["lights.json", "by stem"],
    ),
    "json list": ("lights.json", json.dumps(LIGHTS.tolist()), ["lights.json"]),
    "json list with names": (
        "lights.json",
        json.dumps([{"image": name, "direction": v} for name, v in zip(NAMES, LIGHTS.tolist(), strict=True)][::-1]),
        ["lights.json"],
    ),
    "json of Meshroom": (
        "lights.json",
        json.dumps(
            {
                "lights": [
                    {"viewId": 100 + index, "type": "directional", "direction": vector, "intensity": [2.0, 2.0, 2.0]}
                    for index, vector in enumerate(CV.tolist())
                ]
            }
        ),
        ["order of the images", "y down, z away"],
    ),
    "json of an older Meshroom": (
        "lights.json",
        json.dumps(
            {
                "lights": {
                    name[:-4]: {"direction": vector, "intensity": [1, 1, 1]}
                    for name, vector in zip(NAMES, CV.tolist(), strict=True)
                }
            }
        ),
        ["y down, z away", "by stem"],
    ),
    "dome of relight": (
        "my.dome",
        json.dumps(
            {
                "lightConfiguration": "directional",
                "domeDiameter": 0,
                "directions": [dict(zip("xyz", vector, strict=True)) for vector in LIGHTS.tolist()],
                "positions3d": [],
                "ledAdjust": [],
            }
        ),
        ["my.dome"],
    ),
    "dome of relight in space": (
        "my.dome",
        json.dumps(
            {
                "lightConfiguration": "lights3d",
                "directions": [{"x": 0, "y": 0, "z": 1}] * COUNT,
                "positions3d": [dict(zip("xyz", vector, strict=True)) for vector in (LIGHTS * 30).tolist()],
                "ledAdjust": [{"r": 1, "g": 1, "b": 1}] * COUNT,
            }
        ),
        ["my.dome", "positions3d taken as directions"],
    ),
}  # fmt: skip


@pytest.mark.parametrize("dialect", TEXT_DIALECTS)
def test_light_files(tmp_path: Path, dialect: str) -> None:
    name, content, words = TEXT_DIALECTS[dialect]
    write_images(tmp_path)
    (tmp_path / name).write_text(content, encoding="utf-8")
    reads_right(tmp_path, *words)


@pytest.mark.parametrize(
    ("name", "variables", "words"),
    [
        ("L.mat", {"L": LIGHTS}, ["L.mat", "'L'"]),
        ("L.mat", {"L": LIGHTS.T}, ["3 rows of 8"]),
        ("light_directions.mat", {"light_directions": LIGHTS, "mask": np.ones((5, 5))}, ["light_directions.mat"]),
        ("lights.mat", {"whatever": LIGHTS, "n": 8}, ["'whatever'"]),
        ("lights.mat", {"L": LIGHTS, "intensities": np.ones((COUNT, 1))}, ["'intensities' as their intensities"]),
    ],
)
def test_matlab_files(tmp_path: Path, name: str, variables: dict[str, object], words: list[str]) -> None:
    write_images(tmp_path)
    savemat(tmp_path / name, variables)
    reads_right(tmp_path, *words)


@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize("kind", ["f8", "f4", "i4", "u1", "i2"])
def test_matlab_arrays_of_every_kind(compressed: bool, kind: str) -> None:
    arrays = {
        "L": (LIGHTS * 100).astype(kind),
        "deep": np.arange(24).reshape(2, 3, 4).astype(kind),
        "one": np.ones((1, 1)),
    }
    buffer = io.BytesIO()
    others = {
        "text": "hello",
        "cells": np.array([1, "a"], dtype=object),
        "struct": {"a": 1},
        "complex": np.ones(2) * 1j,
    }
    savemat(buffer, {**arrays, **others}, do_compression=compressed)
    read = read_arrays(buffer.getvalue(), 1_000_000)
    assert set(arrays) <= set(read)
    for name, array in arrays.items():
        np.testing.assert_array_equal(read[name], array)
    with pytest.raises(ValueError, match="bytes"):
        read_arrays(buffer.getvalue()[:-40], 1_000_000)


@pytest.mark.parametrize("array", [LIGHTS, LIGHTS.T, LIGHTS.astype(np.float32), np.asfortranarray(LIGHTS)])
def test_numpy_files(tmp_path: Path, array: np.ndarray) -> None:
    write_images(tmp_path)
    np.save(tmp_path / "lights.npy", array)
    reads_right(tmp_path, "lights.npy")


def test_vectors_of_different_lengths_carry_the_intensity(tmp_path: Path) -> None:
    strength = np.linspace(0.7, 1.2, COUNT)
    write_images(tmp_path, images=np.rint(strength[:, None, None] * 0.8 * 255 * radiances()).astype(np.uint8))
    write_directions(tmp_path, vectors=LIGHTS * strength[:, None])
    capture = reads_right(tmp_path, "direction times intensity")
    np.testing.assert_allclose(capture.rig.intensities, strength, atol=1e-5)


@pytest.mark.parametrize("shape", [(COUNT, 1), (1, COUNT), (COUNT, 3), (3, COUNT)])
def test_intensities_in_rows_or_columns(tmp_path: Path, shape: tuple[int, int]) -> None:
    strength = np.linspace(0.7, 1.2, COUNT)
    write_images(tmp_path, images=np.rint(strength[:, None, None] * 0.8 * 255 * radiances()).astype(np.uint8))
    write_directions(tmp_path)
    columns = np.repeat(strength[:, None], 3, axis=1) if 3 in shape else strength[:, None]
    np.savetxt(tmp_path / "light_intensities.txt", columns if shape[0] == COUNT else columns.T)
    np.testing.assert_allclose(reads_right(tmp_path).rig.intensities, strength)


@pytest.mark.parametrize(
    "name", ["light_intensities.csv", "intensities.txt", "LightIntensities.npy", "led_strengths.dat"]
)
def test_intensities_of_other_names_are_used(name: str, tmp_path: Path) -> None:
    strength = np.linspace(1.0, 0.5, COUNT)
    write_images(tmp_path, images=np.rint(255 * strength[:, None, None] * radiances()).astype(np.uint8))
    write_directions(tmp_path)
    if name.endswith(".npy"):
        np.save(tmp_path / name, strength)
    else:
        np.savetxt(tmp_path / name, strength)
    np.testing.assert_allclose(reads_right(tmp_path, f"taken from {name}").rig.intensities, strength)


def test_intensities_that_are_not_used_are_said(tmp_path: Path) -> None:
    write_images(tmp_path)
    write_directions(tmp_path)
    savemat(tmp_path / "light_intensities.mat", {"I": np.ones(COUNT)})
    reads_right(tmp_path, "not used: light_intensities.mat")


def test_positions_are_no_directions(tmp_path: Path) -> None:
    write_images(tmp_path)
    write_directions(tmp_path, vectors=LIGHTS * np.linspace(200, 300, COUNT)[:, None])
    refused(tmp_path, "light_directions.txt", "200 to 300", "positions_mm")
    (tmp_path / "light_directions.txt").rename(tmp_path / "led_positions.txt")
    refused(tmp_path, "led_positions.txt", "positions_mm", "pixel_pitch_um")
    recipe(tmp_path, 'pixel_pitch_um = 10.0\n[lights]\npositions_mm = "led_positions.txt"\n')
    assert bgars.read_capture(tmp_path).rig.is_near


def test_leds_of_luces(tmp_path: Path) -> None:
    distance_mm, focal_px = 300.0, 3000.0
    rows, cols = 20, 26
    positions = LIGHTS * 200.0
    camera = np.column_stack([positions[:, 0], -positions[:, 1], distance_mm - positions[:, 2]])
    lines = ["N_img nrows ncols f x0 y0 mean_distance sfull:[Lpos Ldir Phi mu 0]"]
    lines += [f"{COUNT} {cols} {rows} {focal_px} {cols / 2} {rows / 2} {distance_mm}"]
    lines += [" ".join(f"{v:.4f}" for v in [*place, 0, 0, 1, 2, 2, 2, 1.0, 0]) for place in camera]
    (tmp_path / "led_params.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
    write_images(tmp_path, [f"{index:02d}.png" for index in range(1, COUNT + 1)])
    capture, notes = read_with_notes(tmp_path)
    assert "300 mm from the camera" in " ".join(notes)
    assert capture.rig.positions_um is not None
    np.testing.assert_allclose(capture.rig.positions_um, positions * 1000, atol=1)
    assert capture.pixel_pitch_um == pytest.approx(100.0)
    field = bgars.estimate_normals(capture, method="lambertian")
    assert field.mask.all()


def test_leds_of_near_light_data_need_the_distance(tmp_path: Path) -> None:
    write_images(tmp_path)
    positions = LIGHTS * 200.0
    camera = np.column_stack([positions[:, 0], -positions[:, 1], 300.0 - positions[:, 2]])
    savemat(tmp_path / "light.mat", {"S": camera, "Dir": LIGHTS, "mu": np.ones((8, 1)), "Phi": np.ones((8, 3))})
    refused(tmp_path, "light.mat", "camera = { distance_mm", "capture.toml")
    recipe(
        tmp_path,
        'pixel_pitch_um = 10.0\ncamera = { distance_mm = 300.0 }\n[lights]\ndirections = "light.mat"\n',
    )
    rig = read_with_notes(tmp_path)[0].rig
    assert rig.positions_um is not None
    np.testing.assert_allclose(rig.positions_um, positions * 1000, atol=1)


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("lights.json", b"{", ["lights.json", "not valid JSON"]),
        ("lights.json", b"[" * 100_000, ["lights.json", "nested too deeply"]),
        ("lights.json", b'{"a": [1, 2]}', ["three numbers", "[1, 2]"]),
        ("lights.json", b'{"lights": [{"intensity": [1, 1, 1]}]}', ["three numbers per light, got {'intensity'"]),
        (
            "lights.json",
            b"[[0, 0.1, 0.2, 0.9], [1, 0.3, 0.1, 0.9]]",
            ["three numbers per light, got [0, 0.1"],
        ),
        ("lights.json", b'[{"azimuth": 3, "elevation": 52}]', ["got {'azimuth': 3", "lights.angles_deg"]),
        ("lights.json", b'{"lights": [[0, 0, 1]], "intensities": [1, 2]}', ["2 intensities, but 1 lights"]),
        ("lights.json", b'{"a.png": [1e999, 0, 1]}', ["finite"]),
        ("lights.dome", b'{"lights": 5}', ["neither directions nor positions"]),
        ("lights.npy", b"\x93NUMPY nonsense", ["lights.npy", "not a NumPy array"]),
        ("lights.mat", b"nonsense" * 100, ["lights.mat", "not a MATLAB file"]),
        ("lights.mat", b"MATLAB 7.3 MAT-file, " + b" " * 600, ["MATLAB 7.3", "-v7"]),
        ("lights.txt", b"\0\1\2\3", ["lights.txt", "not a text file"]),
        ("lights.txt", b"0 45\n90 45\n180 45\n", ["line 1", "3 numbers", "angles_deg"]),
        ("lights.txt", b"N_img nrows ncols f x0 y0 mean_distance\n8 2 2 1 1 1 1\n", ["announces 8", "0 follow"]),
        ("lights.txt", b"N_img nrows ncols f x0 y0 mean_distance\n1e999 2 2 1 1 1 1\n", ["announces inf", "0 follow"]),
        ("lights.txt", b"N_img nrows ncols f x0 y0 mean_distance\n0 2 2 1 1 1 1e999\n", ["above 0", "inf"]),
    ],
)
def test_light_files_that_cannot_be_right(tmp_path: Path, name: str, content: bytes, words: list[str]) -> None:
    write_images(tmp_path)
    (tmp_path / name).write_bytes(content)
    refused(tmp_path, *words)


def test_several_descriptions_are_not_guessed_between(tmp_path: Path) -> None:
    write_images(tmp_path)
    write_lp(tmp_path, PLAIN, name="coin_ball1.lp")
    write_lp(tmp_path, PLAIN, name="coin_ball2.lp")
    refused(tmp_path, "2 .lp files", "coin_ball1.lp, coin_ball2.lp", "capture.toml")
    for name in ("coin_ball1.lp", "coin_ball2.lp"):
        (tmp_path / name).rename(tmp_path / name.replace(".lp", "_light.csv"))
    refused(tmp_path, "2 files about lights", "capture.toml")


def test_the_best_named_of_several_is_taken_and_the_others_are_named(tmp_path: Path) -> None:
    write_images(tmp_path)
    write_directions(tmp_path, "lights.txt")
    write_directions(tmp_path, "lights_of_yesterday.txt")
    reads_right(tmp_path, "lights.txt", "lights_of_yesterday.txt")


def test_a_recipe_may_name_any_of_the_formats(tmp_path: Path) -> None:
    write_images(tmp_path)
    np.save(tmp_path / "any.npy", LIGHTS)
    recipe(tmp_path, '[lights]\ndirections = "any.npy"\n')
    reads_right(tmp_path)
    (tmp_path / "any.npy").unlink()
    write_lp(tmp_path, PLAIN, name="any.lp")
    recipe(tmp_path, '[lights]\nlp = "any.lp"\n')
    reads_right(tmp_path)


def test_every_suffix_has_a_reader_that_refuses_an_empty_file(tmp_path: Path) -> None:
    for suffix in sorted({suffix for kind in LIGHT_FORMATS for suffix in kind.suffixes}):
        path = tmp_path / f"lights{suffix}"
        path.touch()
        with pytest.raises(bgars.FileFormatError, match=path.name):
            read_light_file(path)
