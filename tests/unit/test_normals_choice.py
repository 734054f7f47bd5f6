"""The default method where balls are not what it takes them for, and the errors it states."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import bgars
import numpy as np
import pytest

if TYPE_CHECKING:
    from bgars.normals.methods import Method
    from numpy.typing import NDArray

ALLOWED_DEG = 0.2
"""What the default may cost against the best of the simple methods."""
SIMPLE: tuple[Method, ...] = ("lambertian", "specular-filter", "robust-filter", "blind")
SOLDER = bgars.Material(i_d=0.5, i_s=1.0, hardness=40)
RING = bgars.LightRig.ring(8)


def flattened(ratio: float, material: bgars.Material = SOLDER) -> tuple[bgars.Capture, bgars.SimulatedTruth]:
    """Nine balls whose height is `ratio` of their radius, standing in the board to their middle."""
    scene = bgars.Scene.ball_array(3, 3, pitch_um=900.0)
    balls = tuple(
        replace(ball, aspect_ratio=ratio, centre_z_um=min(ball.centre_z_um, 0.7 * ratio * ball.radius_um))
        for ball in scene.balls
    )
    camera = bgars.Camera(pixel_pitch_um=14.0, read_noise_levels=0.5)
    return bgars.simulate(replace(scene, balls=balls), RING, material, camera, seed=3)


def caps(share: float) -> tuple[bgars.Capture, bgars.SimulatedTruth]:
    """Nine spheres sunk into the board so far that their outline is `share` of their radius."""
    scene = bgars.Scene.ball_array(3, 3, pitch_um=900.0)
    balls = tuple(replace(ball, centre_z_um=-ball.radius_um * float(np.sqrt(1.0 - share**2))) for ball in scene.balls)
    return bgars.simulate(replace(scene, balls=balls), RING, SOLDER, bgars.Camera(pixel_pitch_um=14.0), seed=3)


def on_balls(truth: bgars.SimulatedTruth) -> NDArray[np.bool_]:
    return truth.mask & (truth.ball_ids > 0) & (truth.normals[..., 2] > 0.3)


def errors_deg(field: bgars.NormalField, truth: bgars.SimulatedTruth, where: NDArray[np.bool_]) -> NDArray[np.float64]:
    return bgars.angular_error_deg(field.normals[where], truth.normals[where])


@pytest.mark.parametrize("ratio", [1.0, 0.95, 0.9, 0.8, 0.7])
def test_balls_flattened_alike_are_no_worse_than_by_a_simple_method(ratio: float) -> None:
    capture, truth = flattened(ratio)
    judged = on_balls(truth)
    field = bgars.estimate_normals(capture)
    best = min(errors_deg(bgars.estimate_normals(capture, method=method), truth, judged).mean() for method in SIMPLE)
    assert errors_deg(field, truth, judged).mean() <= best + ALLOWED_DEG
    fit = field.reflectance
    assert fit is not None
    if ratio == 1.0:
        assert (fit.shape, fit.shape_ratio) == ("sphere", 1.0)
    elif fit.accepted:
        assert fit.shape == "ellipsoid"
        assert fit.shape_ratio == pytest.approx(ratio, abs=0.02)
        assert "times as high as half balls" in field.method_reason


def test_caps_are_no_worse_than_by_a_simple_method() -> None:
    capture, truth = caps(0.85)
    judged = on_balls(truth)
    circles = bgars.find_balls(capture)
    field = bgars.estimate_normals(capture, anchors=circles)
    errors = [errors_deg(bgars.estimate_normals(capture, method=method), truth, judged).mean() for method in SIMPLE]
    assert errors_deg(field, truth, judged).mean() <= min(errors) + ALLOWED_DEG
    fit = field.reflectance
    assert fit is not None
    assert fit.shape == "cap"
    assert fit.shape_ratio == pytest.approx(0.85, abs=0.03)  # of the circle that was found


def waves(count: int, noise_levels: float = 0.3) -> tuple[NDArray[np.uint8], NDArray[np.float64], NDArray[np.float64]]:
    """Photographs of crossed waves of a matt surface that is not Lambert's, light directions, true normals."""
    x, y = np.meshgrid(np.linspace(0, 9, 96), np.linspace(0, 7, 96))
    slopes = np.stack([0.6 * np.cos(x), 0.6 * np.sin(y + 0.3 * x), np.ones_like(x)], axis=-1)
    normals = slopes / np.linalg.norm(slopes, axis=-1, keepdims=True)
    directions = bgars.LightRig.ring(count, elevation_deg=50.0).directions
    toward = np.clip(np.einsum("hwc,lc->lhw", normals, directions), 0, None)
    random = np.random.default_rng(5)
    levels = 200.0 * toward**1.4 + random.normal(0, noise_levels, toward.shape)
    return np.clip(np.rint(levels), 0, 255).astype(np.uint8), directions, normals


def test_a_circle_where_no_ball_is_is_dropped() -> None:
    images, directions, normals = waves(8)
    options = {"images": images, "light_directions": directions}
    field = bgars.estimate_normals(**options, anchors=[[-10.0, 5.0, 24.0]])
    assert "without circles" in field.method_reason or "does not explain the balls" in field.method_reason
    default, *simple = (
        bgars.angular_error_deg(found.normals, normals.astype(np.float32)).mean()
        for found in (field, *(bgars.estimate_normals(**options, method=method) for method in SIMPLE))
    )
    assert default <= min(simple) + ALLOWED_DEG


@pytest.mark.parametrize("method", ["lambertian", "robust-filter"])
def test_a_misfit_is_not_trusted_more_for_more_lights(method: Method) -> None:
    stated = []
    for count in (8, 32):
        images, directions, _ = waves(count)
        field = bgars.estimate_normals(images, directions, method=method)
        stated.append(float(np.median(field.standard_error_deg)))
    assert stated[1] > 0.7 * stated[0]


def test_noise_is_averaged_by_more_lights() -> None:
    stated = []
    for count in (8, 32):
        directions = bgars.LightRig.ring(count, elevation_deg=50.0).directions
        levels = 120.0 * np.full((count, 64, 64), directions[0, 2])
        noisy = levels + np.random.default_rng(6).normal(0, 6.0, levels.shape)
        field = bgars.estimate_normals(np.clip(np.rint(noisy), 0, 255).astype(np.uint8), directions, method="blind")
        stated.append(float(np.median(field.standard_error_deg)))
    assert stated[1] < 0.85 * stated[0]


@pytest.mark.parametrize("factor", [3.0, 6.0, 20.0])
@pytest.mark.parametrize("hardness", [10, 160])
def test_over_exposed_captures_give_normals_or_a_reason(factor: float, hardness: int) -> None:
    scene = bgars.Scene.ball_array(3, 3, pitch_um=900.0)
    camera = bgars.Camera(pixel_pitch_um=14.0)
    capture, truth = bgars.simulate(scene, RING, replace(SOLDER, hardness=hardness), camera)
    bright = np.minimum(capture.images * factor, 255.0).astype(np.uint8)
    circles = [[v / 14.0 for v in (ball.x_um, ball.y_um, ball.diameter_um / 2)] for ball in truth.balls]
    field = bgars.estimate_normals(replace(capture, images=bright), anchors=circles)
    assert np.isfinite(field.normals[field.mask]).all()
    assert field.method_reason
