"""Bilateral integration on the DiLiGenT maps with measured depth, and of whole parts with known heights."""

from __future__ import annotations

from pathlib import Path

import bgars
import numpy as np
import pytest
from bgars import _bgars
from PIL import Image

pytestmark = pytest.mark.data

# Mean absolute depth error in mm as published (Cao et al., ECCV 2022, and its public implementation).
PUBLISHED_MM = {"bear": 0.334, "cat": 0.074, "goblet": 9.018, "harvest": 1.838, "pot1": 0.636}


def read_map(folder: Path) -> tuple[np.ndarray, np.ndarray, bgars.Pinhole]:
    codes, bits = _bgars.read_color(folder / "normal_map.png", 100.0)
    normals = codes[..., :3].astype(np.float64) / (2**bits - 1) * 2 - 1
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    mask = np.asarray(Image.open(folder / "mask.png").convert("L")) > 0
    return normals.astype(np.float32), mask, bgars.Pinhole(np.loadtxt(folder / "K.txt"))


def made_mm(found: bgars.DepthMap, folder: Path) -> float:
    truth = np.load(folder / "depth_gt.npz")["depth_gt"]
    depth = found.depth * np.nanmedian(truth / found.depth)
    return float(np.nanmean(abs(depth - truth)))


@pytest.mark.parametrize("name", PUBLISHED_MM)
def test_the_published_maps(data_folder: Path, name: str) -> None:
    """The published error to 0.01 mm; the converged energy is never above the compatible."""
    folder = data_folder / "normal_maps" / "diligent" / name
    normals, mask, camera = read_map(folder)
    compatible, converged = (
        bgars.integrate_normals(normals, mask=mask, method="bilateral", camera=camera, solver=solver)
        for solver in ("compatible", "converged")
    )
    assert made_mm(compatible, folder) == pytest.approx(PUBLISHED_MM[name], abs=0.01)
    # Normals moved in their last digits: rounding does not decide where a solve ends.
    for seed in range(3):
        moved = (normals + 1e-7 * np.random.default_rng(seed).normal(size=normals.shape)).astype(np.float32)
        again = bgars.integrate_normals(moved, mask=mask, method="bilateral", camera=camera, solver="compatible")
        assert made_mm(again, folder) == pytest.approx(PUBLISHED_MM[name], abs=0.01)
    assert compatible.bilateral.converged
    assert converged.bilateral.converged
    assert converged.residual <= 1e-6
    assert converged.bilateral.energies[-1] <= compatible.bilateral.energies[-1]


@pytest.mark.parametrize("name", ["C_grid_4x4_paper", "D_grid_5x5_defects"])
def test_a_part_with_anchors_has_absolute_heights(data_folder: Path, name: str) -> None:
    folder = data_folder / "scenes" / name
    capture, truth = bgars.read_capture(folder), bgars.read_truth(folder)
    assert truth.height_um is not None
    assert truth.ball_ids is not None
    field = bgars.estimate_normals(capture)
    anchors = bgars.anchors_from_part(bgars.inspect(capture), capture.mask.shape)
    found = bgars.integrate_normals(field, anchors=anchors)
    assert found.height_um is not None
    judged = (truth.normals[..., 2] > 0.3) & np.isfinite(truth.height_um) & (truth.ball_ids >= 0)
    assert found.mask[judged].all()
    error_um = (found.height_um - truth.height_um)[judged]
    assert np.sqrt((error_um**2).mean()) <= 1.5
    balls = truth.ball_ids[judged] > 0
    assert np.sqrt((error_um[balls] ** 2).mean()) <= 0.5
    # Without them the same normals put the balls somewhere else altogether.
    free = bgars.integrate_normals(field).height_um
    assert free is not None
    off_um = (free - truth.height_um)[judged]
    assert np.std(off_um) > 50.0
