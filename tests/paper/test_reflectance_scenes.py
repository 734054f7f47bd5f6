"""The limits of the reflectance estimator on rendered scenes and photographs: mean angle over balls, n_z > 0.3."""

from __future__ import annotations

import csv
from typing import TYPE_CHECKING

import bgars
import numpy as np
import pytest

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.data

# Limits in degrees; all ball pixels, priors counted.
LIMITS = {
    "A_one_ball_diffuse": 0.15,
    "A_one_ball_diffuse/16bit": 0.15,
    "B_one_ball_paper_id005": 0.2,
    "B_one_ball_paper_id010": 0.25,
    "B_one_ball_paper_id010_fixedexp": 0.25,
    "B_one_ball_paper_id050": 0.15,
    "B_one_ball_paper_id100": 0.15,
    "C_grid_4x4_paper": 0.15,
    "C_grid_4x4_paper/16bit": 0.15,
    "C2_grid_4x4_gamma": 0.3,
    "D_grid_5x5_defects": 0.15,
    "D2_grid_5x5_defects_bow": 0.15,
    "E_grid_5x5_metal": 1.0,
    "E_grid_5x5_metal/16bit": 1.0,
    "F_grid_6x6_near": 0.5,
    "G_grid_10x10_large": 0.15,
    "H_bridge": 2.0,
    "K1_two_lobe": 0.4,
    "K1_two_lobe/16bit": 0.4,
    "K2_ball_variation": 2.0,
    "K2_ball_variation/16bit": 2.0,
    "K3_realistic": 2.7,
    "K3_realistic/16bit": 2.7,
    "K4_single_material_low_diffuse": 0.85,
    "K4_single_material_low_diffuse/16bit": 0.85,
}
MEASURED_LIMITS = {"E_grid_5x5_metal": 0.6, "E_grid_5x5_metal/16bit": 0.6}
ODD_BALLS = [("D_grid_5x5_defects", "A5", 0.3), ("K3_realistic", "C5", 0.7)]


@pytest.mark.parametrize("name", LIMITS)
def test_scenes(data_folder: Path, name: str) -> None:
    result = bgars.evaluate(
        bgars.read_capture(data_folder / "scenes" / name), truth=bgars.read_truth(data_folder / "scenes" / name)
    )
    assert result.method_reason.startswith("reflectance on balls")
    assert result.normals.mean_deg <= LIMITS[name]
    if name in MEASURED_LIMITS:
        assert result.measured is not None
        assert result.measured.mean_deg <= MEASURED_LIMITS[name]


@pytest.mark.parametrize(("name", "ball", "limit_deg"), ODD_BALLS)
def test_odd_balls_are_not_pulled_to_spheres(data_folder: Path, name: str, ball: str, limit_deg: float) -> None:
    folder = data_folder / "scenes" / name
    rows = list(csv.DictReader((folder / "balls.csv").read_text(encoding="utf-8").splitlines()))
    ids = {row["name"]: int(row["id"]) for row in rows if row["present"] == "1"}
    truth = bgars.read_truth(folder)
    assert truth.ball_ids is not None
    own = (truth.ball_ids == ids[ball]) & (truth.normals[..., 2] > 0.3)
    field = bgars.estimate_normals(bgars.read_capture(folder))
    assert bgars.angular_error_deg(field.normals[own], truth.normals[own]).mean() <= limit_deg


def test_a_photographed_grey_sphere(data_folder: Path) -> None:
    folder = data_folder / "real" / "psm_gray"
    capture = bgars.read_capture(folder)
    height, width = capture.mask.shape
    col, row, radius_px = (float(word) for word in (folder / "sphere_cx_cy_r.txt").read_text().split())
    x, y = (np.arange(width) - col) / radius_px, (row - np.arange(height))[:, None] / radius_px
    n_z = np.sqrt(np.maximum(1.0 - x**2 - y**2, 0.0))
    truth = np.stack([*np.broadcast_arrays(x, y), n_z], axis=2).astype(np.float32)
    judged = capture.mask & (n_z > 0.3)
    field = bgars.estimate_normals(capture)
    assert bgars.angular_error_deg(field.normals[judged], truth[judged]).mean() <= 4.5
