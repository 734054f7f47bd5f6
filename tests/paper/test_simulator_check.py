"""The simulator against images of an independent renderer; docs/simulator.md shows the same tables."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import bgars
import numpy as np
import pytest

pytestmark = pytest.mark.data

SCRIPT = Path(__file__).parents[2] / "docs" / "make_simulator_check.py"


@pytest.fixture(scope="module")
def page() -> ModuleType:
    spec = importlib.util.spec_from_file_location("make_simulator_check", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize(
    ("scene", "board", "highlight"),
    [("A_one_ball_diffuse", 0.01, 0.1), ("C_grid_4x4_paper", 0.01, 1.0), ("D_grid_5x5_defects", 1.0, 1.0)],
)
def test_scenes_of_the_renderer(
    data_folder: Path, page: ModuleType, scene: str, board: float, highlight: float
) -> None:
    results, rebuilt, truth, _ = page.check(data_folder / "scenes" / scene)
    differences = results["cook-torrance"]
    assert differences["lit board"].max() <= board
    assert np.percentile(differences["shadowed board"], 99.9) <= board
    assert differences["ball diffuse"].max() <= 1.0
    assert differences["ball in shadow"].max() == 0.0
    assert differences["ball highlight"].max() <= highlight
    assert results["smith"]["ball highlight"].max() <= differences["ball highlight"].max(), "it is the masking term"
    np.testing.assert_array_equal(truth.ball_ids, rebuilt.truth["id"])
    assert bgars.angular_error_deg(truth.normals, rebuilt.truth["normals"]).max() < 0.02
    assert (truth.lit != rebuilt.truth["lit"]).mean() < 2e-5
    planes = rebuilt.facts["coplanarity"]
    if planes is not None:
        assert truth.seating_coplanarity_um == pytest.approx(planes["seating_max_dev_mm"] * 1e3, rel=1e-3, abs=1e-3)
        assert truth.regression_coplanarity_um == pytest.approx(planes["lsq_range_mm"] * 1e3, rel=1e-3, abs=1e-3)


@pytest.mark.parametrize("scene", ["F_grid_6x6_near", "H_bridge", "D2_grid_5x5_defects_bow"])
def test_truth_under_near_lights_of_bridges_and_of_bowed_boards(
    data_folder: Path, page: ModuleType, scene: str
) -> None:
    rebuilt, truth = page.truth_of(data_folder / "scenes" / scene)
    np.testing.assert_array_equal(truth.ball_ids, rebuilt.truth["id"])
    np.testing.assert_allclose(truth.height_um, rebuilt.truth["z"] * 1e3, atol=0.1)  # the rim
    assert (truth.lit != rebuilt.truth["lit"]).mean() < 2e-5
    # The renderer measures along z, not at right angles to the plane.
    for ours, name in ((truth.seating, "seating_max_dev_mm"), (truth.regression, "lsq_range_mm")):
        along_z = ours.coplanarity_um * np.sqrt(1 + ours.a**2 + ours.b**2)
        assert along_z == pytest.approx(rebuilt.facts["coplanarity"][name] * 1e3, abs=2e-3)


def test_noise_through_a_gamma_is_the_renderer_s(data_folder: Path, page: ModuleType) -> None:
    for row in page.noise_rows(data_folder / "scenes" / page.NOISY_SCENE):
        kind, _, mean, deviation, our_mean, our_deviation = [cell.strip() for cell in row.split("|")][2:8]
        if kind in {"lit board", "ball diffuse"}:
            assert abs(float(mean) - float(our_mean)) < 0.02
            assert float(deviation) == pytest.approx(float(our_deviation), rel=0.01)
