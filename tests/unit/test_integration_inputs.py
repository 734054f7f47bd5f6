"""What `integrate_normals` refuses by name, and what it makes of weights and of memory."""

from __future__ import annotations

import inspect
from typing import TYPE_CHECKING, Any

import bgars
import numpy as np
import pytest
from bgars.surface.integration_inputs import DEFAULTS

if TYPE_CHECKING:
    from collections.abc import Callable

    from bgars.surface.integrate import IntegrationMethod

PLANE = np.tile(np.float32([-0.6, 0, 0.8]), (12, 12, 1))


def rough_normals(shape: tuple[int, int], seed: int, slope: float = 0.3, least_z: float = 0.3) -> np.ndarray:
    random = np.random.default_rng(seed)
    normals = random.normal(size=(*shape, 3)) * [slope, slope, 1]
    normals[..., 2] = abs(normals[..., 2]) + least_z
    return (normals / np.linalg.norm(normals, axis=-1, keepdims=True)).astype(np.float32)


def with_normal(normal: list[float]) -> np.ndarray:
    normals = PLANE.copy()
    normals[5, 7] = normal
    return normals


@pytest.mark.parametrize("method", ["least-squares", "bilateral"])
@pytest.mark.parametrize(
    ("normal", "message"),
    [
        ([np.nan, 0, 0.8], r"row 5, column 7 .* finite, got \(NaN, 0, 0.8\)"),
        ([0, np.inf, 0.8], r"finite, got \(0, inf, 0.8\)"),
        ([0.6, 0, -0.8], "toward the camera, n_z >= 0"),
        ([0, 0, 8], "of length 1"),
        ([0.1, 0, 0.2], "of length 1"),
        ([-6e19, 0, 8e19], "of length 1"),
    ],
)
def test_a_normal_that_is_none_is_named(method: IntegrationMethod, normal: list[float], message: str) -> None:
    with pytest.raises(bgars.InputError, match=message):
        bgars.integrate_normals(with_normal(normal), mask=np.ones((12, 12), dtype=bool), method=method)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"k": 3.0}, "k: method 'least-squares' has no such argument"),
        ({"tol": -1}, "tol: method"),
        ({"solver": "compatible"}, "solver: method"),
        ({"method": "bilateral", "relative_tolerance": 1e-3}, "relative_tolerance: method 'bilateral'"),
        ({"method": "bilateral", "difference": "forward"}, "difference: method"),
        ({"k": None}, "k: must be a number, got None"),
        ({"relative_tolerance": "1"}, "relative_tolerance: must be a number"),
        ({"pixel_pitch_um": "10"}, "pixel_pitch_um: must be a number"),
        ({"pixel_pitch_um": np.nan}, "pixel_pitch_um: must be finite and above 0, got nan"),
        ({"max_iters": 0}, "max_iters: must be at least 1, got 0"),
        ({"max_iters": -1}, "max_iters: must be at least 1, got -1"),
        ({"max_iters": 2.5}, "max_iters: must be a whole number"),
        ({"max_iters": 10**30}, "max_iters: must be at most"),
        ({"weights": [["a"] * 12] * 12}, "weights: must be an array of numbers"),
        ({"weights": np.zeros((12, 12))}, "weights: must be above 0 in at least one pixel of the mask, got 0"),
        ({"anchors": PLANE}, "anchors: must be bgars.Anchors, got ndarray"),
        ({"anchors": bgars.Anchors([[1.0] * 12] * 12)}, "anchors.height_um: must be an array, got list"),  # type: ignore[arg-type]
        ({"anchors": bgars.Anchors(np.full((12, 12), np.inf))}, "anchors.height_um: must be finite, or NaN"),
        (
            {"anchors": bgars.Anchors(np.ones((12, 12)), regions=np.full((12, 12), 2**32))},
            "anchors.regions: must be from",
        ),
        ({"anchors": bgars.Anchors(np.ones((12, 12)), reach_px=None)}, "anchors.reach_px: must be a mapping"),  # type: ignore[arg-type]
    ],
)
def test_bad_arguments_are_named(options: dict[str, Any], message: str) -> None:
    with pytest.raises(bgars.InputError, match=message):
        bgars.integrate_normals(PLANE, **options)


def test_defaults_of_one_method_are_those_of_the_call() -> None:
    parameters = inspect.signature(bgars.integrate_normals).parameters
    assert {name: parameters[name].default for name in DEFAULTS} == DEFAULTS


def test_a_matrix_of_words_is_no_camera() -> None:
    with pytest.raises(bgars.InputError, match=r"camera: must be a \(3, 3\) matrix of numbers"):
        bgars.Pinhole([["f", 0, 1], [0, "f", 1], [0, 0, 1]])  # type: ignore[list-item]


def integrals() -> list[Callable[[np.ndarray], np.ndarray]]:
    return [
        lambda weights: bgars.integrate_normals(rough_normals((40, 40), 0), weights=weights).height_px,
        lambda weights: (
            bgars.integrate_normals(rough_normals((40, 40), 0), weights=weights, method="bilateral").height_px
        ),
    ]


@pytest.mark.parametrize("integral", integrals(), ids=["least-squares", "bilateral"])
@pytest.mark.parametrize("size", [1e-40, 1e-12, 1e-6, 1e6, 1e20, 3e38])
def test_only_the_ratios_of_weights_count(integral: Callable[[np.ndarray], np.ndarray], size: float) -> None:
    weights = np.random.default_rng(3).choice([0.25, 0.5, 1.0], size=(40, 40))
    np.testing.assert_allclose(integral(weights * size), integral(weights), atol=2e-5)


def test_pixels_of_weight_zero_are_no_part_of_the_surface() -> None:
    weights = np.ones((12, 12))
    weights[4, 11] = 0.0
    height = bgars.integrate_normals(PLANE, weights=weights)
    assert not height.mask[4, 11]
    assert np.isnan(height.height_px[4, 11])
    np.testing.assert_allclose(np.diff(height.height_px[4, :11]), 0.75, atol=1e-5)
    weights[:, 5] = 0.0
    halves = bgars.integrate_normals(PLANE, weights=weights)
    assert len(halves.components) == 2
    np.testing.assert_allclose(np.nanmean(halves.height_px[:, :5]), 0.0, atol=1e-6)


def test_a_call_does_not_depend_on_one_that_overflowed() -> None:
    normals, side = rough_normals((300, 300), 1), 300
    row, col = np.indices((side, side))
    corner = (row < 100) & (col > 150)
    alone = bgars.integrate_normals(normals, mask=corner)
    huge = bgars.Pinhole([[1e30, 0, 150], [0, 1e30, 150], [0, 0, 1]])
    bgars.integrate_normals(normals, weights=1e20 * (1 + 0.1 * np.random.default_rng(5).random((side, side))))
    bgars.integrate_normals(normals, method="bilateral", camera=huge, max_iters=1)
    bgars.integrate_normals(normals, mask=np.hypot(row - 150, col - 150) < 120)
    again = bgars.integrate_normals(normals, mask=corner)
    np.testing.assert_array_equal(again.height_px, alone.height_px)


@pytest.mark.parametrize("shape", [(1, 3), (1, 5), (2, 2), (5, 5)])
def test_the_compatible_solver_goes_as_far_as_it_says_on_small_masks(shape: tuple[int, int]) -> None:
    for seed in range(20):
        normals = rough_normals(shape, seed)
        height = bgars.integrate_normals(normals, method="bilateral", solver="compatible", max_iters=3)
        assert height.residual <= 1e-3, seed


def test_a_bilateral_system_too_hard_to_solve_is_told_not_raised() -> None:
    """Nearly every system of such a mask is too hard; the small masks are followed until the energy rests."""
    unsolved = 0
    for seed in range(25):
        random = np.random.default_rng(seed)
        shape = tuple(random.integers(20, 110, 2))
        normals, mask = rough_normals(shape, seed, 0.5, 0.02), random.random(shape) < 0.55
        max_iters = 150 if mask.size < 3000 else 6
        height = bgars.integrate_normals(normals, mask=mask, method="bilateral", k=10, max_iters=max_iters)
        assert np.isfinite(height.height_px[mask]).all()
        assert height.bilateral is not None
        unsolved += height.residual > 1e-6
    assert unsolved > 20


def test_arrays_that_lie_anyhow_are_copied() -> None:
    memory = np.zeros(PLANE.nbytes + 1, dtype=np.uint8)
    unaligned = memory[1:].view(np.float32).reshape(PLANE.shape)
    unaligned[...] = PLANE
    assert not unaligned.flags.aligned
    np.testing.assert_array_equal(
        bgars.integrate_normals(unaligned).height_px, bgars.integrate_normals(PLANE).height_px
    )


def test_anchors_of_any_weight_are_finite() -> None:
    heights = np.full((12, 12), 3.0)
    for size in (1e-300, 1e308):
        anchors = bgars.Anchors(heights, weights=np.full((12, 12), size))
        height = bgars.integrate_normals(PLANE, anchors=anchors, pixel_pitch_um=2.0)
        np.testing.assert_allclose(height.height_px.mean(), 1.5, atol=1e-5)
