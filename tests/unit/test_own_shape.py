"""Tilted and oval balls among round ones, their shadows exact."""

from __future__ import annotations

from dataclasses import replace

import bgars
import numpy as np
import pytest
from bgars.inspection import measure_balls, own_shape
from bgars.inspection.bundle import Solution, solve_bundle
from bgars.inspection.bundle_model import linearise_edges
from bgars.inspection.bundle_normal import normal_equations
from bgars.inspection.own_shape import free_shapes
from bgars.inspection.results import NO_SPHEROID
from measured_captures import array, photograph
from numpy.typing import NDArray
from test_budget import point_priors, points

Array = NDArray[np.float64]
NOISE_PX = 0.03
ODD = 5
RADIUS = 25.0
SHAPES = {
    "tilted": (1.0, 1.0, 0.9, 20.0),
    "tilted and high": (1.0, 1.0, 1.08, 25.0),
    "oval": (1.04, 0.96, 1.0, 0.0),
}


def ellipsoid(along: float, across: float, q: float, tilt_deg: float) -> Array:
    """Symmetric matrix (3, 3) that takes the unit sphere to it, turned about an axis that is none of the image's."""
    tilt, turn = np.radians(tilt_deg), np.radians(40.0)
    about = np.array([[np.cos(turn), -np.sin(turn), 0.0], [np.sin(turn), np.cos(turn), 0.0], [0.0, 0.0, 1.0]])
    down = np.array([[np.cos(tilt), 0.0, np.sin(tilt)], [0.0, 1.0, 0.0], [-np.sin(tilt), 0.0, np.cos(tilt)]])
    axes = about @ down
    return RADIUS * axes @ np.diag([along, across, q]) @ axes.T


def edge_points(centre: Array, matrix: Array, light: Array, angles: Array) -> Array:
    """Points (M, 2) of the edge of a shadow on the plane z = 0: the contour of the ellipsoid seen along the light."""
    side = np.array([-light[1], light[0], 0.0]) / np.hypot(light[0], light[1])
    up = np.cross(light, side)
    normals = np.cos(angles)[:, None] * np.where(up[2] > 0, 1.0, -1.0) * up + np.sin(angles)[:, None] * side
    surface = centre + normals @ matrix.T @ matrix / np.linalg.norm(normals @ matrix.T, axis=1)[:, None]
    way = surface[:, 2:] / light[2]
    return np.asarray((surface - way * light)[:, :2])


def fitted(shape: str | None, seed: int) -> tuple[Solution, Solution, Array]:
    """Twelve balls, one of a shape: their fit as spheroids, the same with free shapes, and the truth."""
    edges, state, outlines = points(45.0, seed, NOISE_PX)
    truth = state.balls.copy()
    if shape is not None:
        random = np.random.default_rng([seed, 7])
        x, y = edges.x.copy(), edges.y.copy()
        angles = np.radians(np.linspace(-60.0, 60.0, x.shape[2]))
        centre = np.array([truth[ODD, 0], truth[ODD, 1], truth[ODD, 2]])
        for light, vector in enumerate(state.vectors):
            exact = edge_points(centre, ellipsoid(*SHAPES[shape]), vector, angles)
            noisy = exact + NOISE_PX * random.standard_normal(exact.shape)
            x[ODD, light], y[ODD, light] = noisy.T
        edges = replace(edges, x=x, y=y)
        # What a circle makes of an outline that is none.
        outlines[ODD] += [0.5, -0.3, 0.3]
    priors = point_priors(state, outlines, u_outline_px=0.1, u_q=3e-4, u_elevation_deg=0.05, u_roundness=1e-3)
    spheroids = solve_bundle(edges, state, False, priors, redescend=3.5)
    free, odd = free_shapes(spheroids, edges, priors, False, 3.5)
    assert np.flatnonzero(odd).tolist() == ([] if shape is None else [ODD])
    return spheroids, free, truth


def u_of(solution: Solution, ball: int) -> Array:
    return np.asarray(np.sqrt(np.diag(solution.covariance[ball])))


@pytest.mark.parametrize("shape", SHAPES)
def test_a_ball_of_its_own_shape_stands_where_it_stands(shape: str) -> None:
    before, after = [], []
    for seed in range(3):
        spheroids, free, truth = fitted(shape, seed)
        off = np.abs(free.balls - truth)[ODD]
        before.append(np.abs(spheroids.balls - truth)[ODD, :2].max())
        after.append((off[:2] / u_of(free, ODD)[:2]).max())
        assert off[:2].max() < 0.15
        assert free.factor[ODD] < 0.7 * spheroids.factor[ODD]
        assert np.array_equal(np.delete(free.balls, ODD, axis=0), np.delete(spheroids.balls, ODD, axis=0))
    if shape != "oval":  # Its shadows are those of no ball that stands elsewhere.
        assert min(before) > 0.15
    assert np.median(after) < 2.0


@pytest.mark.parametrize("shape", ["tilted", "tilted and high"])
def test_the_top_of_a_tilted_ball(shape: str) -> None:
    matrix = ellipsoid(*SHAPES[shape])
    for seed in range(3):
        _, free, truth = fitted(shape, seed)
        top = free.balls[ODD] @ [0.0, 0.0, 1.0, 0.0, 0.0] + free.balls[ODD, 3] * free.balls[ODD, 4]
        assert top == pytest.approx(truth[ODD, 2] + np.linalg.norm(matrix[2]), abs=0.25)


def test_balls_that_are_alike_stay_as_they_are() -> None:
    for seed in range(6):
        spheroids, free, _ = fitted(None, 50 + seed)
        assert free is spheroids


def test_a_ball_whose_q_is_odd_gets_its_own_shape_for_less() -> None:
    """Its tilt is twice as far off as usual: of round balls one in twenty has that, and no shape of its own."""
    edges, state, outlines = points(45.0, 11, NOISE_PX)
    angles = np.radians(np.linspace(-60.0, 60.0, edges.x.shape[2]))
    matrix = ellipsoid(1.0, 1.0, 0.992, 20.0)
    x, y = edges.x.copy(), edges.y.copy()
    random = np.random.default_rng(11)
    for light, vector in enumerate(state.vectors):
        exact = edge_points(state.balls[ODD, :3], matrix, vector, angles)
        x[ODD, light], y[ODD, light] = (exact + NOISE_PX * random.standard_normal(exact.shape)).T
    edges = replace(edges, x=x, y=y)
    odd = []
    for u_q in (3e-4, 0.1):
        priors = point_priors(state, outlines, u_outline_px=0.1, u_q=3e-4, u_elevation_deg=0.05, u_roundness=1e-3)
        priors.u_q[ODD] = u_q
        spheroids = solve_bundle(edges, state, False, priors, redescend=3.5)
        odd.append(np.flatnonzero(free_shapes(spheroids, edges, priors, False, 3.5)[1]).tolist())
    assert odd == [[], [ODD]]


def test_a_round_ball_with_a_shape_of_its_own_is_measured_and_named(monkeypatch: pytest.MonkeyPatch) -> None:
    capture, truth, found = photograph(array(3, 3, 1), bgars.LightRig.ring(8), pitch_um=20.0)
    plain = measure_balls(capture, found).balls[ODD]
    monkeypatch.setattr(own_shape, "_unlike", lambda solution, *_: np.arange(len(solution.balls)) == ODD)
    measured = measure_balls(capture, found)
    odd, true = measured.balls[ODD], truth.balls[ODD]
    assert [text for text in measured.warnings if "its shape is fitted" in text] == [f"{odd.name}: {NO_SPHEROID}"]
    for name in ("x_um", "y_um", "diameter_um", "top_um"):
        value, u, known = getattr(odd, name), getattr(odd, f"u_{name}"), getattr(true, name)
        assert abs(value - known) < 3.0 * u
        assert u > getattr(plain, f"u_{name}")


def test_normal_equations_without_more_terms_are_those_of_the_kernel() -> None:
    edges, state, outlines = points(45.0, 3, NOISE_PX)
    priors = point_priors(state, outlines, u_outline_px=0.1, u_q=3e-4, u_elevation_deg=0.05, u_roundness=1e-3)
    model = linearise_edges(edges, state, False)
    weight = np.random.default_rng(3).uniform(0.0, 1e3, model.residual.shape)
    weight[0, 0, :4] = 0.0
    model.rows[0, 0, :4] = np.nan
    by_kernel = normal_equations(model, weight, state, priors)
    by_numpy = normal_equations(model, weight, state, priors, np.zeros((*weight.shape, 0)))
    for kernel, numpy in zip(by_kernel, by_numpy, strict=True):
        np.testing.assert_allclose(numpy, kernel, rtol=1e-9, atol=1e-9 * np.abs(kernel).max())
