"""Values of a recipe in another unit than they are asked for: refused or said, and what is right stays silent."""

from __future__ import annotations

from pathlib import Path

import bgars
import numpy as np
import pytest
from case_captures import (
    AZIMUTHS_DEG,
    COUNT,
    ELEVATIONS_DEG,
    LIGHTS,
    SHAPE,
    levels,
    radiances,
    read_with_notes,
    reads_right,
    recipe,
    refused,
    write_directions,
    write_images,
)
from PIL import Image

RAD = np.radians(np.column_stack([AZIMUTHS_DEG, ELEVATIONS_DEG]))
LIST = f"[lights]\ndirections = {LIGHTS.tolist()}\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_images(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    ("lights", "told"),
    [
        ("ring = { count = 8, elevation_deg = 0.785 }", ["elevation_deg", "looks like radians (45 degrees)"]),
        (f"angles_deg = {RAD.tolist()}", ["angles are in degrees", "looks like radians"]),
        ("angles_deg = 'a.txt'", ["a.txt", "looks like radians"]),
        ("directions = 'a.csv'", ["a.csv", "the header says degrees, but no angle is above 5.55"]),
    ],
)
def test_radians_are_no_degrees(folder: Path, lights: str, told: list[str]) -> None:
    np.savetxt(folder / "a.txt", RAD)
    np.savetxt(folder / "a.csv", RAD, delimiter=",", header="azimuth_deg,elevation_deg", comments="")
    recipe(folder, f"[lights]\n{lights}\n")
    refused(folder, *told)


def test_low_rings_are_read(folder: Path) -> None:
    recipe(folder, "[lights]\nring = { count = 8, elevation_deg = 2.0 }\n")
    assert not read_with_notes(folder)[1]


@pytest.mark.parametrize("scale", [255.0, 1e-6, 4000.0])
@pytest.mark.parametrize("columns", [1, 3])
def test_intensities_are_relative(folder: Path, scale: float, columns: int) -> None:
    strength = np.linspace(0.7, 1.2, COUNT)
    write_images(folder, images=np.rint(strength[:, None, None] * levels() * 0.8).astype(np.uint8))
    write_directions(folder)
    np.savetxt(folder / "light_intensities.txt", np.repeat(scale * strength[:, None], columns, axis=1))
    capture = reads_right(folder, "taken relative to their median", within_deg=0.6)
    np.testing.assert_allclose(capture.rig.intensities, strength / np.median(strength))
    assert [finding.kind for finding in bgars.check(capture).findings if finding.severity == "error"] == []


@pytest.mark.parametrize("scale", [0.2, 1.0, 9.0])
def test_intensities_near_1_stay(folder: Path, scale: float) -> None:
    write_directions(folder)
    np.savetxt(folder / "light_intensities.txt", np.full(COUNT, scale))
    np.testing.assert_array_equal(reads_right(folder).rig.intensities, scale)


@pytest.mark.parametrize(("unit_mm", "said"), [(1e-3, True), (1.0, False)])
def test_positions_in_um_are_said(folder: Path, unit_mm: float, said: bool) -> None:
    positions = (300.0 / unit_mm * LIGHTS).tolist()
    recipe(folder, f"pixel_pitch_um = 20.0\n[lights]\npositions_mm = {positions}\n")
    notes = read_with_notes(folder)[1]
    assert [note for note in notes if "lights up to 300 m from the image centre" in note] == (notes if said else [])
    assert bool(notes) == said


@pytest.mark.parametrize(
    ("black_level", "bits", "told"),
    [
        (0.08, 8, "less than one of 255 grey levels; if it is a share of full scale, write black_level = 20.4"),
        (0.5, 16, "write black_level = 3.277e+04"),
        (20.0, 8, ""),
        (1.0, 16, ""),
        (120.0, 8, "below black_level = 120 by more than noise; it must be the grey level that no light reads"),
    ],
)
def test_a_black_level_is_a_grey_level(tmp_path: Path, black_level: float, bits: int, told: str) -> None:
    write_images(tmp_path, images=levels(bits))
    recipe(tmp_path, f"black_level = {black_level}\n{LIST}")
    notes = read_with_notes(tmp_path)[1]
    assert len(notes) == bool(told)
    assert all(told in note for note in notes)


def test_a_saturation_is_a_grey_level(folder: Path) -> None:
    recipe(folder, f"saturation = 1.0\n{LIST}")
    refused(folder, "capture.toml: saturation: must be the grey level that clips, of 255, got 1")


@pytest.mark.parametrize(("dark", "said"), [(0, False), (38, False), (120, True)])
def test_a_dark_frame_of_a_lit_part_is_said(folder: Path, dark: int, said: bool) -> None:
    Image.fromarray(np.full(SHAPE, dark, np.uint8)).save(folder / "dark.png")
    recipe(folder, f'dark = "dark.png"\n{LIST}')
    assert [("darker than the dark frame" in note) for note in read_with_notes(folder)[1]] == [True] * said


@pytest.mark.parametrize("noise", [0.0, 0.4, 3.0, 12.0])
def test_noise_of_shadows_is_above_the_black_level(tmp_path: Path, noise: float) -> None:
    rng = np.random.default_rng(5)
    light = np.where(np.arange(64) < 32, 20.0, 160.0) * np.ones((48, 1))
    images = np.clip(np.rint(light + noise * rng.normal(size=(COUNT, *light.shape))), 0, 255).astype(np.uint8)
    write_images(tmp_path, images=images)
    recipe(tmp_path, f"black_level = 20\n{LIST}")
    assert not read_with_notes(tmp_path)[1]
    recipe(tmp_path, f"black_level = {25 + round(noise)}\n{LIST}")
    assert "below black_level" in read_with_notes(tmp_path)[1][0]


def test_levels_are_those_of_light() -> None:
    assert radiances().min() * 255 > 37, "the black levels above are below or among them"
