"""Known errors on rendered scenes and photographs with truth."""

from __future__ import annotations

from pathlib import Path

import bgars
import numpy as np
import pytest
from bgars.files.light_files import read_filenames

pytestmark = pytest.mark.data

SCENES = [
    # scene, least squares, published filter (both from an independent implementation), limit of the robust filter
    ("A_one_ball_diffuse", 3.61, 5.39, 0.61),
    ("B_one_ball_paper_id005", 7.77, 6.96, None),
    ("B_one_ball_paper_id050", 9.34, 6.76, 1.35),
    ("C_grid_4x4_paper", 9.38, 6.62, 1.35),
    ("D_grid_5x5_defects", 9.65, 6.28, 1.15),
]
PHOTOGRAPHS = [
    ("dil_cat", None, 7.3),
    ("dil_cat", "ring8.txt", 8.9),
    ("dil_bear", None, 7.0),
    ("dil_bear", "ring8.txt", 8.8),
]


def mean_deg(capture: bgars.Capture, method: str) -> float:
    return bgars.evaluate(capture, method=method).normals.mean_deg  # type: ignore[arg-type]


@pytest.mark.parametrize(("scene", "least_squares", "published", "robust_limit"), SCENES)
def test_rendered_scenes(
    data_folder: Path, scene: str, least_squares: float, published: float, robust_limit: float | None
) -> None:
    capture = bgars.read_capture(data_folder / "scenes" / scene)
    assert mean_deg(capture, "lambertian") == pytest.approx(least_squares, abs=0.05)
    assert mean_deg(capture, "specular-filter") == pytest.approx(published, abs=0.05)
    if robust_limit is not None:
        assert mean_deg(capture, "robust-filter") <= robust_limit


@pytest.mark.parametrize(("name", "images", "limit"), PHOTOGRAPHS)
def test_photographs(data_folder: Path, name: str, images: str | None, limit: float) -> None:
    folder = data_folder / "real" / name
    names = read_filenames(folder / images) if images else None
    assert mean_deg(bgars.read_capture(folder, images=names), "robust-filter") <= limit


def test_the_robust_filter_is_nowhere_worse_than_least_squares(data_folder: Path) -> None:
    for truth in sorted(data_folder.glob("scenes/*/gt.npz")):
        for folder in (truth.parent, truth.parent / "16bit"):
            if folder.is_dir():
                capture = bgars.read_capture(folder)
                assert mean_deg(capture, "robust-filter") <= mean_deg(capture, "lambertian") + 0.1, folder


def test_board_pixels_in_cast_shadows_are_right(data_folder: Path) -> None:
    folder = data_folder / "scenes" / "C_grid_4x4_paper"
    field = bgars.estimate_normals(bgars.read_capture(folder))
    with np.load(folder / "gt.npz") as truth:
        lit = np.unpackbits(truth["lit"][..., None], axis=2)
        shadowed = (truth["id"] == 0) & ~truth["mixed"] & (lit.sum(axis=2) < lit.shape[2]) & (lit.sum(axis=2) >= 4)
        error_deg = bgars.angular_error_deg(field.normals[shadowed], truth["normals"][shadowed])
    assert shadowed.sum() > 1000
    assert np.median(error_deg) < 0.1
