"""Light files, lists and folders as programs and other systems write them: read right, or refused with the cure."""

from __future__ import annotations

import json
import os
import unicodedata
from pathlib import Path

import bgars
import numpy as np
import pytest
import tifffile
from case_captures import (
    AZIMUTHS_DEG,
    COUNT,
    ELEVATIONS_DEG,
    LIGHTS,
    levels,
    lp_lines,
    names_of,
    radiances,
    reads_right,
    recipe,
    refused,
    write_directions,
    write_images,
    write_lp,
)

ROWS = ["{:.6f} {:.6f} {:.6f}".format(*vector) for vector in LIGHTS]
WITH_COMMAS = [row.replace(" ", ", ") for row in ROWS]


@pytest.mark.parametrize(
    "text",
    [
        np.array2string(LIGHTS),
        repr(LIGHTS),
        repr(LIGHTS.astype(np.float32)),
        f"lights = np.array({LIGHTS.tolist()})",
        str(LIGHTS.tolist()),
        "L = [\n" + ";\n".join(ROWS) + "];",
        "L=[" + "; ".join(WITH_COMMAS) + "]",
        "\n".join(f"{row};" for row in WITH_COMMAS),
        "{" + ",\n".join("{" + row.replace(",", "f,") + "f}" for row in WITH_COMMAS) + "}",
        "# measured in March\n(" + "),\n(".join(WITH_COMMAS) + ")\n",
    ],
    ids=["printed", "repr", "float32", "assigned", "list", "MATLAB", "one line", "semicolons", "C", "tuples"],
)
def test_matrices_as_programs_write_them(text: str, tmp_path: Path) -> None:
    write_images(tmp_path)
    (tmp_path / "light_directions.txt").write_text(text, encoding="utf-8")
    reads_right(tmp_path)


def table(header: str, pattern: str, order: slice = slice(None)) -> str:
    names = names_of("img_{:02d}.png")
    lines = [
        pattern.format(i=index, n=name, x=x, y=y, z=z)
        for index, (name, (x, y, z)) in enumerate(zip(names, LIGHTS, strict=True))
    ]
    return "\n".join([header, *lines[order]]) + "\n"


BACKWARDS = slice(None, None, -1)
ANGLES = "\n".join(
    ["led,azimuth,elevation"]
    + [f"{index},{AZIMUTHS_DEG[index]},{ELEVATIONS_DEG[index]}" for index in range(COUNT)][BACKWARDS]
)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (table(",filename,x,y,z", "{i},{n},{x},{y},{z}"), "lights taken"),
        (table("x,y,z,filename", "{x},{y},{z},{n}", slice(None, None, -1)), "lights taken"),
        (table("intensity;Lx;Ly;Lz", "1.0;{x};{y};{z}"), "fourth number"),
        (table("x,y,z,azimuth,elevation", "{x},{y},{z},10,20"), "not used: azimuth, elevation"),
        (table("led,x,y,z", "{i},{x},{y},{z}", BACKWARDS), "sorted by their numbers"),
        (table("Lamp;Lx;Ly;Lz", "LED {i};{x};{y};{z}", BACKWARDS), "sorted by their numbers"),
        (table("# a table", "{i} {x} {y} {z}", BACKWARDS), "sorted by their numbers"),
        (table("# a table", "{i} {n} {x} {y} {z}", BACKWARDS), "number of the light"),
        (ANGLES, "sorted by their numbers"),
    ],
    ids=[
        "index of pandas",
        "name last, reversed",
        "intensity first",
        "angles besides",
        "numbers backwards",
        "numbered names backwards",
        "numbers without a header",
        "numbers before names",
        "numbers of angles",
    ],
)
def test_columns_are_found_by_their_header(text: str, said: str, tmp_path: Path) -> None:
    write_images(tmp_path)
    (tmp_path / "LightDirs.csv").write_text(text, encoding="utf-8")
    reads_right(tmp_path, said)


@pytest.mark.parametrize(("header", "per_mm"), [("x_mm,y_mm,z_mm", 1.0), ("X [m],Y [m],Z [m]", 1e-3)])
def test_positions_have_the_unit_of_their_header(header: str, per_mm: float, tmp_path: Path) -> None:
    write_images(tmp_path)
    places_mm = LIGHTS * np.linspace(200.0, 400.0, COUNT)[:, None]
    rows = "\n".join(",".join(f"{value:.6f}" for value in place) for place in places_mm * per_mm)
    (tmp_path / "lights.csv").write_text(f"{header}\n{rows}\n", encoding="utf-8")
    refused(tmp_path, "lights.csv", "not directions", "positions_mm")
    recipe(tmp_path, 'pixel_pitch_um = 10\n[lights]\npositions_mm = "lights.csv"\n')
    capture = bgars.read_capture(tmp_path)
    assert capture.rig.positions_um is not None
    np.testing.assert_allclose(capture.rig.positions_um, places_mm * 1000.0, atol=1.0)


def test_positions_on_a_dome_are_near_lights_where_the_scale_is_known(tmp_path: Path) -> None:
    write_images(tmp_path)
    rows = "".join(",".join(f"{value:.6f}" for value in place) + "\n" for place in LIGHTS * 300.0)
    (tmp_path / "lights.csv").write_text(f"x_mm,y_mm,z_mm\n{rows}", encoding="utf-8")
    reads_right(tmp_path, "positions at 300 mm taken as directions; with pixel_pitch_um in capture.toml they are near")
    recipe(tmp_path, 'pixel_pitch_um = 10\n[lights]\ndirections = "lights.csv"\n')
    capture = reads_right(tmp_path, "lights.csv: positions in the unit of its header, so near lights")
    assert capture.rig.positions_um is not None
    np.testing.assert_allclose(capture.rig.positions_um, LIGHTS * 300_000.0, atol=1.0)
    (tmp_path / "lights.csv").write_text(f"x,y,z\n{rows}", encoding="utf-8")
    assert reads_right(tmp_path, "vectors of length 300 taken as directions").rig.positions_um is None


@pytest.mark.parametrize(
    "text",
    [
        "sep=;\nx;y;z\n" + "".join(";".join(f"{v:.6f}" for v in light) + "\n" for light in LIGHTS),
        "sep=;\r\n" + "".join(";".join(f"{v:.6f}".replace(".", ",") for v in light) + "\r\n" for light in LIGHTS),
        '"sep=,"\nx,y,z\n' + "".join(",".join(f"{v:.6f}" for v in light) + "\n" for light in LIGHTS),
        "".join(" ".join(f"{v:.6f}" for v in light).replace("-", "\N{MINUS SIGN}") + "\n" for light in LIGHTS),
        "".join(",".join(f"{v:.6e}" for v in light).replace("-", "\N{MINUS SIGN}") + "\n" for light in LIGHTS),
        "".join(" ".join(f"{v:.6e}".replace("e", "D") for v in light) + "\n" for light in LIGHTS),
        "".join(" ".join(f"{v / 10:.6f}".replace("0.", ".") + "d+1" for v in light) + "\n" for light in LIGHTS),
        "azimuth_deg,elevation_deg\n"
        + "".join(
            f"{a},{e}\n".replace("-", "\N{MINUS SIGN}") for a, e in zip(AZIMUTHS_DEG - 360, ELEVATIONS_DEG, strict=True)
        ),
    ],
    ids=[
        "sep",
        "sep and decimal commas",
        "quoted sep",
        "minus",
        "minus in exponents",
        "Fortran",
        "bare point",
        "angles",
    ],
)
def test_numbers_as_excel_and_fortran_write_them(text: str, tmp_path: Path) -> None:
    write_images(tmp_path)
    (tmp_path / "lights.csv").write_text(text, encoding="utf-8")
    reads_right(tmp_path, "lights.csv")


def test_rows_of_an_lp_file_that_look_like_numbers(tmp_path: Path) -> None:
    write_images(tmp_path, names_of("{}.png"))
    write_lp(tmp_path, lp_lines(names_of("{}")))
    reads_right(tmp_path, "by stem")
    write_lp(tmp_path, [line.replace(" ", ", ").replace(", ", " ", 1) for line in lp_lines(names_of("{}.png"))])
    reads_right(tmp_path)


@pytest.mark.parametrize("form", ["NFC", "NFD"])
def test_accents_of_another_system(form: str, tmp_path: Path) -> None:
    names = [unicodedata.normalize("NFC" if form == "NFD" else "NFD", name) for name in names_of("Münze_{}.png")]
    write_images(tmp_path, names)
    write_lp(tmp_path, lp_lines([unicodedata.normalize(form, name) for name in names]))
    reads_right(tmp_path, "accents")


def test_an_archive_of_macos(tmp_path: Path) -> None:
    write_lp(tmp_path, lp_lines(write_images(tmp_path)))
    (tmp_path / "._lights.lp").write_bytes(b"\0\5\x16\7" * 9)
    reads_right(tmp_path)


def test_names_with_a_dot_before_them(tmp_path: Path) -> None:
    write_lp(tmp_path, lp_lines([f"./{name}" for name in write_images(tmp_path)]))
    reads_right(tmp_path)


def test_a_list_of_names_with_quotes_and_a_comment(tmp_path: Path) -> None:
    names = write_images(tmp_path)
    write_directions(tmp_path)
    (tmp_path / "filenames.txt").write_text("# images\n" + "\n".join(f"'{name}'" for name in names), encoding="utf-8")
    reads_right(tmp_path)


@pytest.mark.parametrize("images", [".", "images"])
def test_lights_in_a_folder_beside_the_images(images: str, tmp_path: Path) -> None:
    write_images(tmp_path / images)
    (tmp_path / "calibration").mkdir()
    write_directions(tmp_path / "calibration")
    reads_right(tmp_path, "lights taken from calibration/light_directions.txt")


def test_angles_of_a_recipe_are_read_by_their_header(tmp_path: Path) -> None:
    names = write_images(tmp_path)
    angles = np.degrees(np.column_stack([np.arcsin(LIGHTS[:, 2]), np.arctan2(LIGHTS[:, 1], LIGHTS[:, 0])]))
    lines = [f"{name},{up:.5f},{around:.5f}" for name, (up, around) in zip(names, angles, strict=True)]
    (tmp_path / "a.csv").write_text("\n".join(["file,elevation,azimuth", *lines[::-1]]), encoding="utf-8")
    recipe(tmp_path, '[lights]\nangles_deg = "a.csv"\n')
    reads_right(tmp_path, "in degrees")


def test_json_in_three_rows_and_with_axes(tmp_path: Path) -> None:
    write_images(tmp_path)
    (tmp_path / "lights.json").write_text(json.dumps(LIGHTS.T.tolist()), encoding="utf-8")
    reads_right(tmp_path, "3 rows of 8 numbers")
    values = {"lights": [dict(zip("xyz", vector, strict=True)) for vector in LIGHTS.tolist()]}
    (tmp_path / "lights.json").write_text(json.dumps(values), encoding="utf-8")
    reads_right(tmp_path, "lights taken")


STRENGTHS = [1.0, 0.5, 0.9, 0.8, 0.7, 0.6, 1.0, 0.9]
VECTORS = LIGHTS.tolist()
IN_ORDER = list(zip(names_of("img_{:02d}.png"), VECTORS, STRENGTHS, strict=True))


def write_images_under_lamps(folder: Path) -> None:
    write_images(folder, images=np.rint(255 * np.array(STRENGTHS)[:, None, None] * radiances()).astype(np.uint8))


@pytest.mark.parametrize(
    "values",
    [
        {"lights": [{"direction": vector, "intensity": strength} for _, vector, strength in IN_ORDER]},
        [{"X": x, "Y": y, "Z": z, "intensity": strength} for _, (x, y, z), strength in IN_ORDER],
        [{"name": n, "x": x, "y": y, "z": z, "intensity": strength} for n, (x, y, z), strength in IN_ORDER[::-1]],
        {"directions": VECTORS, "intensities": STRENGTHS},
        {"lights": VECTORS, "light_intensities": [[strength] * 3 for strength in STRENGTHS]},
    ],
    ids=["with a direction", "with X, Y, Z", "with a name", "beside directions", "beside lights, of colours"],
)
def test_json_with_intensities(values: object, tmp_path: Path) -> None:
    write_images_under_lamps(tmp_path)
    (tmp_path / "lights.json").write_text(json.dumps(values), encoding="utf-8")
    reads_right(tmp_path, "lights taken")


def test_intensities_of_colours_in_three_rows(tmp_path: Path) -> None:
    gains = np.column_stack([np.linspace(0.6, 1.1, COUNT), np.linspace(1.1, 0.6, COUNT), np.full(COUNT, 0.8)])
    colored = levels()[..., None] * gains[:, None, None, :]
    write_images(tmp_path, images=np.rint(colored).astype(np.uint8))
    write_directions(tmp_path)
    np.savetxt(tmp_path / "light_intensities.txt", gains.T)
    reads_right(tmp_path)


def test_a_tiff_whose_preview_comes_first(tmp_path: Path) -> None:
    write_directions(tmp_path)
    for name, image in zip(names_of("a{}.tif"), levels(16), strict=True):
        with tifffile.TiffWriter(tmp_path / name) as file:
            file.write(image[::4, ::4], subfiletype=1, metadata=None)
            file.write(image, metadata=None)
    reads_right(tmp_path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no pipes")
def test_a_mask_that_is_no_file_is_not_passed_over(tmp_path: Path) -> None:
    write_images(tmp_path)
    write_directions(tmp_path)
    os.mkfifo(tmp_path / "mask.png")
    refused(tmp_path, "mask.png", "named pipe, not an image file")
    (tmp_path / "mask.png").unlink()
    (tmp_path / "mask.png").symlink_to("nowhere.png")
    refused(tmp_path, "mask.png", "a link to what is not there")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("dark = \u201cdark.png\u201d\n", ["capture.toml", 'straight quotes: dark = "dark.png"']),
        ('lights = "x.lp"\n', ["lights: must be a table", "'x.lp'"]),
        ("[lights]\nangles_deg = [[1, 2, 3]]\n", ["lights.angles_deg.0: must hold 2 numbers", "[1, 2, 3]"]),
        ("response = 2.2\n[lights]\nring = { count = 8 }\n", ["response", "{ gamma = 2.2 }", "got 2.2"]),
        ("response = { gamma = 0.4545 }\n[lights]\nring = { count = 8 }\n", ["gamma", "write 2.2, got 0.4545"]),
        ("saturation = 4095\n[lights]\nring = { count = 8 }\n", ["saturation", "can exceed 255, got 4095"]),
        ("pixel_pitch_um = 0.0034\n[lights]\nring = { count = 8 }\n", ["pixel_pitch_um", "is it in mm?, got 0.0034"]),
        (f"pixel_pitch_um = 10\n[lights]\npositions_mm = {VECTORS}\n", ["positions_mm", "write directions"]),
        (
            f"pixel_pitch_um = 50\n[lights]\npositions_mm = {(LIGHTS * 0.3).tolist()}\n",
            ["capture.toml", "within 0.3 mm of the image centre", "are positions_mm in mm"],
        ),
    ],
)
def test_a_recipe_says_what_to_write(text: str, words: list[str], tmp_path: Path) -> None:
    write_images(tmp_path)
    recipe(tmp_path, text)
    refused(tmp_path, *words)


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("lights.yaml", b"lights: []\n", ["lights.yaml is not read", ".lp"]),
        ("capture.yaml", b"lights: []\n", ["capture.yaml is not read", "TOML into capture.toml"]),
        ("light_directions.txt", b"0 0 1\noops\n", ["line 2", "x y z of a light", "'oops'"]),
        ("lights.csv", b"phi,theta\n1,2\n", ["line 1", "azimuth, elevation"]),
        ("lights.lp", b"8\n#1.png 0 0 1\n", ["announces 8", "begin with # are comments"]),
        (
            "light_directions.txt",
            "".join(f"LED{i} 0 0.{i} 0.9\n" for i in range(8)).encode(),
            ["0 of 8", "remove them"],
        ),
    ],
)
def test_a_light_file_that_is_not_read_says_why(name: str, content: bytes, words: list[str], tmp_path: Path) -> None:
    write_images(tmp_path)
    (tmp_path / name).write_bytes(content)
    refused(tmp_path, *words)


@pytest.mark.parametrize(
    ("pattern", "content", "words"),
    [
        ("IMG_{}.heic", b"\0\0\0\x18ftypheic", [".heic is not read as images", "PNG or TIFF"]),
        ("a{}.png", b"version https://git-lfs.github.com/spec/v1\noid sha256:0\n", ["a1.png", "git lfs pull"]),
        ("a{}.jpg", b"<!DOCTYPE html><html>", ["a1.jpg", "a web page"]),
    ],
)
def test_images_that_are_none_say_what_they_are(pattern: str, content: bytes, words: list[str], tmp_path: Path) -> None:
    write_directions(tmp_path)
    for name in names_of(pattern):
        (tmp_path / name).write_bytes(content)
    refused(tmp_path, *words)
