"""Dialects of public software that no case of the shared data has: read right, or refused with what to do."""

from __future__ import annotations

import json
from pathlib import Path

import bgars
import imageio.v3 as iio
import numpy as np
import pytest
import tifffile

AZIMUTHS_DEG = 10.0 + 45.0 * np.arange(8)
DIRECTIONS = bgars.LightRig.ring(8, elevation_deg=50.0, azimuth0_deg=10.0).directions


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Eight images of a gentle bump, without their lights."""
    part = tmp_path / "part"
    part.mkdir()
    row, col = np.mgrid[:40, :44]
    slope = np.stack([np.sin(col / 9.0) / 3, np.cos(row / 7.0) / 3, np.ones((40, 44))])
    normals = slope / np.linalg.norm(slope, axis=0)
    for index, light in enumerate(np.maximum(np.tensordot(DIRECTIONS, normals, axes=(1, 0)), 0.0)):
        iio.imwrite(part / f"img_{index}.png", np.rint(200.0 * light).astype(np.uint8))
    return part


def angle_lines(first: np.ndarray, second: np.ndarray, named: bool = False) -> str:
    names = [f"img_{index}.png," if named else "" for index in range(8)]
    return "".join(f"{name}{a:.6f},{b:.6f}\n" for name, a, b in zip(names, first, second, strict=True))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("azimuth,elevation\n" + angle_lines(AZIMUTHS_DEG, np.full(8, 50.0)), "degrees"),
        ("azimuth,elevation\n" + angle_lines(np.radians(AZIMUTHS_DEG), np.full(8, np.radians(50.0))), "radians"),
        ("image,azimuth_deg,elevation_deg\n" + angle_lines(AZIMUTHS_DEG, np.full(8, 50.0), named=True), "degrees"),
        ("Slant (deg),Tilt (deg)\n" + angle_lines(np.full(8, 40.0), AZIMUTHS_DEG), "counter-clockwise"),
        (
            "azimuth,elevation,file\n"
            + "".join(f"{azimuth},50,img_{index}.png\n" for index, azimuth in enumerate(AZIMUTHS_DEG)),
            "degrees",
        ),
    ],
    ids=["degrees", "radians", "named", "slant and tilt", "named behind"],
)
def test_angles_are_read_under_a_header_that_names_them(text: str, said: str, folder: Path) -> None:
    (folder / "lights.csv").write_text(text, encoding="utf-8")
    with pytest.warns(bgars.CaptureWarning) as warned:
        capture = bgars.read_capture(folder)
    assert any(said in str(each.message) for each in warned)
    np.testing.assert_allclose(capture.rig.directions, DIRECTIONS, atol=1e-5)


def test_an_angle_that_is_missing_is_named(folder: Path) -> None:
    (folder / "lights.csv").write_text("azimuth,elevation\n10,50\n55\n", encoding="utf-8")
    with pytest.raises(bgars.FileFormatError, match="line 3 must hold azimuth and elevation, as the header says"):
        bgars.read_capture(folder)


@pytest.mark.parametrize("header", ["theta,phi", "a,b", "azimuth,azimuth"])
def test_angles_that_could_be_either_are_not_guessed(header: str, folder: Path) -> None:
    text = header + "\n" + angle_lines(AZIMUTHS_DEG, np.full(8, 50.0))
    (folder / "lights.csv").write_text(text, encoding="utf-8")
    with pytest.raises(bgars.FileFormatError, match=r"lights\.csv"):
        bgars.read_capture(folder)


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("part.relight", json.dumps({"images": []}), "export its lights as .lp"),
        ("part.ptm", "PTM_1.2", "is a finished RTI"),
        ("Results.csv", ",X,Y,Z\n1,0,0,1\n", "If Results.csv holds the lights"),
    ],
)
def test_files_of_other_programs_are_answered_with_what_to_do(name: str, content: str, said: str, folder: Path) -> None:
    (folder / name).write_text(content, encoding="utf-8")
    with pytest.raises(bgars.InputError, match=said):
        bgars.read_capture(folder)


def test_a_capture_one_folder_down_is_pointed_at(folder: Path) -> None:
    (folder / "light_directions.txt").write_text("\n".join(" ".join(map(str, each)) for each in DIRECTIONS))
    with pytest.raises(bgars.InputError, match="seems to be a capture: name that folder"):
        bgars.read_capture(folder.parent)


def test_a_normal_map_of_floats_from_0_to_255_is_read(tmp_path: Path) -> None:
    row, col = np.mgrid[:20, :24]
    slope = np.stack([np.sin(col / 9.0) / 3, np.cos(row / 7.0) / 3, np.ones((20, 24))], axis=-1)
    normals = slope / np.linalg.norm(slope, axis=2, keepdims=True)
    tifffile.imwrite(tmp_path / "n.tif", ((normals + 1.0) * 127.5).astype(np.float32), photometric="rgb")
    with pytest.warns(UserWarning, match="floats run from 0 to 255"):
        read = bgars.read_normal_map(tmp_path / "n.tif", directx=False)
    np.testing.assert_allclose(read, normals, atol=1e-4)


def test_angles_in_radians_given_as_degrees_are_no_good_capture(folder: Path) -> None:
    angles = np.radians(np.column_stack([AZIMUTHS_DEG, np.full(8, 50.0)])).tolist()
    (folder / "capture.toml").write_text(f"[lights]\nangles_deg = {angles}\n", encoding="utf-8")
    with pytest.raises(
        bgars.InputError, match=r"angles are in degrees, but no elevation is above 0\.873, which looks like radians"
    ):
        bgars.check(folder)
