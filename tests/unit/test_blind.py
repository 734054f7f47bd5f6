"""The blind method: never much worse than the best classical one, better on shiny surfaces; it says what it chose."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import bgars
import numpy as np
import pytest
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Callable

    from bgars.normals.methods import Method

ALLOWED_DEG = 0.2
"""What the guard may cost against the best of the methods it chooses among."""

Vectors = NDArray[np.float64]


def sphere(size: int = 64) -> tuple[Vectors, NDArray[np.bool_]]:
    """Normals (size, size, 3) of a half sphere seen from above, and where n_z > 0.15."""
    axis = (np.arange(size) + 0.5) / size * 2 - 1
    x, y = np.meshgrid(axis, -axis)
    z = np.sqrt(np.clip(1 - x * x - y * y, 0, None))
    return np.stack([x, y, z], axis=-1), z > 0.15


def waves(size: int = 64) -> tuple[Vectors, NDArray[np.bool_]]:
    """Normals (size, size, 3) of crossed waves of up to 45 degrees: nothing like a ball."""
    x, y = np.meshgrid(np.linspace(0, 9, size), np.linspace(0, 7, size))
    slopes = np.stack([0.8 * np.cos(x), 0.8 * np.sin(y + 0.3 * x), np.ones_like(x)], axis=-1)
    return slopes / np.linalg.norm(slopes, axis=-1, keepdims=True), np.ones(x.shape, np.bool_)


def lobe(half: Vectors, roughness: float) -> Vectors:
    """A Gaussian of the facet slope: none of the estimator's own shapes has its masking."""
    tangent = 1 / np.clip(half, 0.01, 1) ** 2 - 1
    return np.exp(-tangent / roughness**2)


def photograph(
    normals: Vectors,
    directions: Vectors,
    *,
    strength: float | Vectors,
    roughness: float,
    albedo: float | Vectors = 1.0,
    noise: float = 1.0,
) -> NDArray[np.uint8]:
    """Render (L, H, W) images: diffuse part, one lobe, attached shadows, noise of so many grey levels, 8 bits."""
    rng = np.random.default_rng(8)
    images = []
    for direction in directions:
        half = direction + np.array([0.0, 0.0, 1.0])
        half /= np.linalg.norm(half)
        toward = np.clip(normals @ direction, 0, None)
        shine = np.where(toward > 0, strength * lobe(normals @ half, roughness), 0.0)
        images.append(albedo * toward + shine)
    stack = np.stack(images)
    levels = stack * 230 / np.percentile(stack, 99.5) + rng.normal(0, noise, stack.shape)
    return np.clip(np.rint(levels), 0, 255).astype(np.uint8)


def mean_error_deg(field: bgars.NormalField, truth: Vectors, mask: NDArray[np.bool_]) -> float:
    normals = np.where(field.mask[..., None], field.normals, np.float32([0, 0, 1]))
    cosines = np.clip((normals * truth).sum(axis=-1)[mask], -1, 1)
    return float(np.degrees(np.arccos(cosines)).mean())


def errors_deg(
    images: NDArray[np.uint8], directions: Vectors, truth: Vectors, mask: NDArray[np.bool_]
) -> dict[str, float]:
    methods: tuple[Method, ...] = ("lambertian", "robust-filter", "blind")
    return {
        method: mean_error_deg(bgars.estimate_normals(images, directions, method=method, mask=mask), truth, mask)
        for method in methods
    }


MATERIALS = {
    "broad": {"strength": 0.5, "roughness": 0.35},
    "narrow": {"strength": 2.0, "roughness": 0.12},
    "weak": {"strength": 0.1, "roughness": 0.25},
}


@pytest.mark.parametrize("shape", [sphere, waves])
@pytest.mark.parametrize("material", MATERIALS)
def test_on_shiny_surfaces_it_is_not_worse_than_the_best_other_method(
    shape: Callable[[], tuple[Vectors, NDArray[np.bool_]]], material: str
) -> None:
    truth, mask = shape()
    directions = bgars.LightRig.ring(8, elevation_deg=50.0).directions
    images = photograph(truth, directions, **MATERIALS[material])
    errors = errors_deg(images, directions, truth, mask)
    assert errors["blind"] <= min(errors["lambertian"], errors["robust-filter"]) + ALLOWED_DEG, errors


def test_a_broad_lobe_is_recovered() -> None:
    truth, mask = waves()
    directions = bgars.LightRig.ring(8, elevation_deg=50.0).directions
    images = photograph(truth, directions, strength=0.5, roughness=0.35)
    errors = errors_deg(images, directions, truth, mask)
    assert errors["blind"] < 0.8 * min(errors["lambertian"], errors["robust-filter"]), errors


def test_two_materials_and_a_texture_in_one_picture() -> None:
    truth, mask = waves()
    directions = bgars.LightRig.ring(8, elevation_deg=50.0).directions
    texture = np.random.default_rng(3).uniform(0.6, 1.0, mask.shape)
    shiny = np.where(np.arange(mask.shape[1]) < mask.shape[1] // 2, 0.6, 0.0) * np.ones(mask.shape)
    images = photograph(truth, directions, strength=shiny, roughness=0.3, albedo=texture)
    errors = errors_deg(images, directions, truth, mask)
    assert errors["blind"] <= min(errors["lambertian"], errors["robust-filter"]) + ALLOWED_DEG, errors


@pytest.mark.parametrize("noise", [0.5, 2.0, 6.0])
def test_a_lambertian_surface_with_noise_is_not_worse_than_least_squares(noise: float) -> None:
    truth, _ = waves()
    mask = np.ones(truth.shape[:2], np.bool_)
    directions = bgars.LightRig.ring(8, elevation_deg=60.0).directions
    images = photograph(truth, directions, strength=0.0, roughness=0.3, noise=noise)
    errors = errors_deg(images, directions, truth, mask)
    assert errors["blind"] <= errors["lambertian"] + ALLOWED_DEG, errors


def test_the_choice_is_told() -> None:
    truth, mask = sphere(48)
    directions = bgars.LightRig.ring(8, elevation_deg=50.0).directions
    images = photograph(truth, directions, strength=0.5, roughness=0.35)
    field = bgars.estimate_normals(images, directions, method="blind", mask=mask)
    assert field.method_reason.startswith("reflectance fitted blind: mean cost of a left-out light")
    other = bgars.estimate_normals(images, directions, method="robust-filter", mask=mask)
    assert other.method_reason == "robust-filter, as asked"


def test_four_lights_get_the_robust_filter() -> None:
    truth, mask = sphere(48)
    directions = bgars.LightRig.ring(4, elevation_deg=50.0).directions
    images = photograph(truth, directions, strength=0.5, roughness=0.35)
    blind = bgars.estimate_normals(images, directions, method="blind", mask=mask)
    robust = bgars.estimate_normals(images, directions, method="robust-filter", mask=mask)
    np.testing.assert_array_equal(blind.normals, robust.normals)
    assert "fewer than 5 lights" in blind.method_reason


def test_the_same_bits_for_any_number_of_threads() -> None:
    truth, mask = waves(64)
    directions = bgars.LightRig.ring(8, elevation_deg=50.0).directions
    images = photograph(truth, directions, strength=0.5, roughness=0.35)
    one, three = (
        bgars.estimate_normals(images, directions, method="blind", mask=mask, threads=threads) for threads in (1, 3)
    )
    for name in ("normals", "albedo", "confidence", "lights_kept"):
        assert getattr(one, name).tobytes() == getattr(three, name).tobytes(), name


def test_fields_keep_their_promises() -> None:
    truth, mask = sphere(64)
    directions = bgars.LightRig.ring(8, elevation_deg=50.0).directions
    images = photograph(truth, directions, strength=0.5, roughness=0.35)
    field = bgars.estimate_normals(images, directions, method="blind", mask=mask, keep_sets=True)
    assert field.mask[mask].all()
    assert not field.mask[~mask].any()
    assert np.isnan(field.normals[~mask]).all()
    assert not field.is_measured[~mask].any()
    np.testing.assert_allclose(np.linalg.norm(field.normals[mask], axis=-1), 1.0, atol=1e-6)
    assert (field.normals[mask][:, 2] > 0).all()
    assert ((field.confidence[mask] > 0) & (field.confidence[mask] <= 1)).all()
    assert field.kept_sets is not None
    np.testing.assert_array_equal(field.kept_sets.sum(axis=-1), field.lights_kept)


def test_a_tiny_mask_works() -> None:
    truth, _ = sphere(16)
    mask = np.zeros(truth.shape[:2], np.bool_)
    mask[7, 8] = True
    directions = bgars.LightRig.ring(6, elevation_deg=50.0).directions
    images = photograph(truth, directions, strength=0.5, roughness=0.35)
    field = bgars.estimate_normals(images, directions, method="blind", mask=mask)
    assert field.mask.sum() == 1


def test_the_unit_of_16_bit_images_does_not_matter() -> None:
    truth, mask = sphere(48)
    directions = bgars.LightRig.ring(8, elevation_deg=50.0).directions
    images = photograph(truth, directions, strength=0.5, roughness=0.35)
    wide = images.astype(np.uint16) * np.uint16(257)
    narrow_field, wide_field = (
        bgars.estimate_normals(stack, directions, method="blind", mask=mask) for stack in (images, wide)
    )
    cosines = (narrow_field.normals * wide_field.normals).sum(axis=-1)[mask]
    assert np.degrees(np.arccos(np.clip(cosines, -1, 1))).mean() < 0.05


def test_an_exception_of_progress_stops_the_work() -> None:
    truth, mask = waves(400)
    directions = bgars.LightRig.ring(8, elevation_deg=50.0).directions
    images = photograph(truth, directions, strength=0.5, roughness=0.35)
    seen: list[float] = []

    def stop(done: float) -> None:
        seen.append(done)
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        bgars.estimate_normals(images, directions, method="blind", mask=mask, progress=stop)
    assert all(0 <= done < 1 for done in seen)


def test_memory_of_an_earlier_result_is_used_again_by_a_method_that_fills_nothing_in() -> None:
    truth, mask = sphere(32)
    directions = bgars.LightRig.ring(8, elevation_deg=50.0).directions
    images = photograph(truth, directions, strength=0.5, roughness=0.35)
    images[2:, 14:17, 14:17] = 0  # two lights fix no normal
    expected = bgars.estimate_normals(images, directions, method="blind", mask=mask)
    assert (expected.is_measured != expected.mask).any()
    least_squares = bgars.estimate_normals(images, directions, method="lambertian")
    blind = bgars.estimate_normals(images, directions, method="blind", mask=mask, out=least_squares)
    assert blind.normals is least_squares.normals
    np.testing.assert_array_equal(blind.is_measured, expected.is_measured)
    back = bgars.estimate_normals(images, directions, method="lambertian", out=blind)
    np.testing.assert_array_equal(back.is_measured, back.mask)


def test_memory_of_an_earlier_result_is_used_again() -> None:
    truth, mask = sphere(32)
    directions = bgars.LightRig.ring(8, elevation_deg=50.0).directions
    images = photograph(truth, directions, strength=0.5, roughness=0.35)
    first = bgars.estimate_normals(images, directions, method="blind", mask=mask)
    expected = replace(first, normals=first.normals.copy())
    again = bgars.estimate_normals(images, directions, method="blind", mask=mask, out=first)
    assert np.shares_memory(again.normals, first.normals)
    np.testing.assert_array_equal(again.normals, expected.normals)
