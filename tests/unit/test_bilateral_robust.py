"""Bilateral integration of hard input: it ends, within its limits, and says how it went."""

from __future__ import annotations

import bgars
import numpy as np
import pytest
from bilateral_scenes import terrace, unit

SIZE = 150
SOLVERS = ["converged", "compatible"]


def solve(normals: np.ndarray, solver: str, **options: object) -> bgars.HeightMap:
    found: bgars.HeightMap = bgars.integrate_normals(  # type: ignore[call-overload]
        normals.astype(np.float32), method="bilateral", solver=solver, **options
    )
    fit = found.bilateral
    assert fit is not None
    assert np.isfinite(found.height_px[found.mask]).all()
    assert np.isnan(found.height_px[~found.mask]).all()
    assert len(fit.energies) <= 150
    assert np.isfinite(fit.energies).all()
    return found


def random_normals(count: int, seed: int) -> np.ndarray:
    """Directions all over the half sphere toward the camera."""
    vectors = np.random.default_rng(seed).normal(size=(count, 3))
    vectors[:, 2] = abs(vectors[:, 2]) + 1e-3
    return unit(vectors)


@pytest.mark.parametrize("solver", SOLVERS)
def test_one_normal_in_twenty_at_random(solver: str) -> None:
    """The surface away from the outliers survives better than by least squares."""
    height, normals = terrace(SIZE, step_px=0.0)
    wrong = np.random.default_rng(2).random((SIZE, SIZE)) < 0.05
    normals[wrong] = random_normals(int(wrong.sum()), 5)

    def error_px(found: bgars.HeightMap) -> float:
        difference = (found.height_px - height)[~wrong]
        return float(np.median(abs(difference - np.median(difference))))

    plain = bgars.integrate_normals(normals.astype(np.float32))
    assert error_px(solve(normals, solver)) < 0.7 * error_px(plain)


@pytest.mark.parametrize("solver", SOLVERS)
def test_noise_of_a_tenth(solver: str) -> None:
    height, normals = terrace(SIZE, step_px=0.0)
    noisy = unit(normals + np.random.default_rng(4).normal(0, 0.1, normals.shape))
    found = solve(noisy, solver)
    difference = found.height_px - height
    assert np.std(difference) < 1.5


@pytest.mark.parametrize("solver", SOLVERS)
def test_nan_holes_are_holes(solver: str) -> None:
    height, normals = terrace(SIZE, step_px=0.0)
    holes = np.random.default_rng(6).random((SIZE, SIZE)) < 0.2
    normals[holes] = np.nan
    found = solve(normals, solver)
    main = found.labels == np.argmax([part.pixels for part in found.components])
    assert (found.mask == ~holes).all()
    assert np.std((found.height_px - height)[main]) < 0.5


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("shape", ["row", "column", "stairs", "spiral"])
def test_lanes_of_one_pixel(shape: str, solver: str) -> None:
    _, normals = terrace(61)
    mask = np.zeros((61, 61), bool)
    if shape == "row":
        mask[30] = True
    elif shape == "column":
        mask[:, 30] = True
    elif shape == "stairs":
        steps = np.arange(60)
        mask[steps, steps] = mask[steps, steps + 1] = True
    else:
        mask[::2] = True
        mask[1::4, -1] = mask[3::4, 0] = True
    found = solve(normals, solver, mask=mask)
    assert len(found.components) == 1


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_million_islands(solver: str) -> None:
    """Pixels without a neighbour: a component each, of height 0."""
    mask = np.zeros((2000, 2000), bool)
    mask[::2, ::2] = True
    normals = np.zeros((2000, 2000, 3))
    normals[..., 0], normals[..., 2] = 0.6, 0.8
    found = solve(normals, solver, mask=mask)
    assert len(found.components) == 1_000_000
    assert (found.height_px[mask] == 0).all()


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_hundred_thousand_dominoes(solver: str) -> None:
    """Two pixels each, upright in one half and lying in the other."""
    mask = np.zeros((900, 900), bool)
    mask[::3, ::3] = mask[::3, 1::3] = True
    normals = np.zeros((900, 900, 3))
    normals[..., 0], normals[..., 2] = -0.6, 0.8
    found = solve(normals, solver, mask=mask)
    assert len(found.components) == 90_000
    steps = found.height_px[::3, 1::3] - found.height_px[::3, ::3]
    assert np.abs(steps - 0.75).max() < 1e-3


@pytest.mark.parametrize("solver", SOLVERS)
def test_normals_seen_edge_on(solver: str) -> None:
    """n_z of almost nothing along a line asks for a cliff of a thousand pixels."""
    _, normals = terrace(60, step_px=0.0)
    normals[:, 30] = unit(np.array([-1.0, 0.0, 1e-3]))
    found = solve(normals, solver)
    assert np.ptp(found.height_px) < 1e4


def test_one_pixel() -> None:
    found = solve(np.array([[[0.0, 0.0, 1.0]]]), "converged")
    assert found.height_px.tolist() == [[0.0]]
