"""The blind method on photographs, and on rendered scenes as if no ball were known."""

from __future__ import annotations

from pathlib import Path

import bgars
import numpy as np
import pytest
from bgars.files.light_files import read_filenames

pytestmark = pytest.mark.data

ALLOWED_DEG = 0.2
LIMITS_DEG = {
    ("dil_bear", "ring8.txt"): 5.5,
    ("dil_bear", None): 5.0,
    ("dil_cat", "ring8.txt"): 6.0,
    ("dil_cat", None): 5.4,
}
WITHIN = (0.58, 0.86)
"""Share of the pixels of a photograph that must be within their stated error: 68 % and the worst that was seen."""
SCENES = ["A_one_ball_diffuse", "B_one_ball_paper_id100", "C_grid_4x4_paper", "H_bridge", "K2_ball_variation"]


def mean_deg(field: bgars.NormalField, capture: bgars.Capture, truth: bgars.Truth) -> float:
    """Mean angle over all pixels; what is not measured counts as facing the camera."""
    judged = truth.mask & capture.mask
    if truth.ball_ids is not None:
        judged &= truth.normals[..., 2] > 0.3
    normals = np.where(field.mask[..., None], field.normals, np.float32([0, 0, 1]))
    cosines = np.clip((normals * truth.normals).sum(axis=-1)[judged], -1, 1)
    return float(np.degrees(np.arccos(cosines)).mean())


def better_simple_deg(capture: bgars.Capture, truth: bgars.Truth) -> float:
    """Error of the better of least squares and robust filter."""
    simple = (bgars.estimate_normals(capture, method=method) for method in ("lambertian", "robust-filter"))
    return min(mean_deg(field, capture, truth) for field in simple)


@pytest.mark.parametrize(("name", "images"), LIMITS_DEG)
def test_photographs_without_balls(data_folder: Path, name: str, images: str | None) -> None:
    """The method that is chosen is blind, hardly worse than the best, and says how wrong it is."""
    folder = data_folder / "real" / name
    capture = bgars.read_capture(folder, images=read_filenames(folder / images) if images else None)
    truth, field = bgars.read_truth(folder), bgars.estimate_normals(capture)
    assert field.method == "blind"
    found = mean_deg(field, capture, truth)
    assert found <= LIMITS_DEG[name, images]
    assert found <= better_simple_deg(capture, truth) + ALLOWED_DEG
    judged = truth.mask & field.is_measured
    assert judged.sum() > 0.9 * truth.mask.sum()
    error_deg = bgars.angular_error_deg(field.normals[judged], truth.normals[judged])
    assert WITHIN[0] < (error_deg <= field.standard_error_deg[judged]).mean() < WITHIN[1]


@pytest.mark.parametrize("scene", SCENES)
def test_rendered_scenes_without_known_balls(data_folder: Path, scene: str) -> None:
    folder = data_folder / "scenes" / scene
    capture, truth = bgars.read_capture(folder), bgars.read_truth(folder)
    field = bgars.estimate_normals(capture, method="blind")
    assert mean_deg(field, capture, truth) <= better_simple_deg(capture, truth) + ALLOWED_DEG
