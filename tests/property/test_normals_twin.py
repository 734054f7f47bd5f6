"""The compiled estimator against numpy, over random stacks, dtypes, masks and light counts."""

from __future__ import annotations

import bgars
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray


def slow_filter(values: NDArray[np.float64], gap: float) -> NDArray[np.bool_]:
    order = np.argsort(values, kind="stable")
    gaps = np.flatnonzero(np.diff(values[order])[2:] > gap)
    kept = np.ones(len(values), bool)
    if gaps.size:
        kept[order[gaps[0] + 3 :]] = False
    return kept


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    lights=st.integers(3, 16),
    dtype=st.sampled_from([np.uint8, np.uint16, np.float32]),
    elevation_deg=st.floats(25, 65),
    method=st.sampled_from(["lambertian", "specular-filter"]),
)
def test_fast_equals_slow(seed: int, lights: int, dtype: type, elevation_deg: float, method: str) -> None:
    rng = np.random.default_rng(seed)
    full = 1.0 if dtype is np.float32 else float(np.iinfo(dtype).max)
    images = (rng.random((lights, 3, 4)) * full).astype(dtype)
    images[0, 0, 0] = full  # float stacks: the largest value is full scale
    mask = rng.random((3, 4)) > 0.3
    mask[0, 0] = True
    directions = bgars.LightRig.ring(lights, elevation_deg=elevation_deg).directions
    field = bgars.estimate_normals(images, directions, mask=mask, method=method, keep_sets=True)  # type: ignore[arg-type]
    assert field.kept_sets is not None
    for row, col in np.argwhere(mask):
        values = images[:, row, col].astype(np.float64)
        kept = np.ones(lights, bool) if method == "lambertian" else slow_filter(values, 50.0 * full / 255.0)
        np.testing.assert_array_equal(field.kept_sets[row, col], kept)
        solution = np.linalg.lstsq(directions[kept], values[kept], rcond=None)[0]
        if not field.mask[row, col]:
            squares = np.linalg.svd(directions[kept], compute_uv=False) ** 2
            assert solution[2] <= 1e-9 * full or 27 * squares.prod() < 1.001e-6 * squares.sum() ** 3
            continue
        normal = solution / np.linalg.norm(solution)
        assert np.degrees(np.linalg.norm(field.normals[row, col] - normal)) < 1e-3
        assert field.albedo[row, col] == pytest.approx(np.linalg.norm(solution) / full, rel=1e-4)
    assert not field.mask[~mask].any()


@pytest.mark.parametrize("method", ["lambertian", "specular-filter", "robust-filter"])
def test_the_unit_of_float_images_does_not_matter(method: bgars.normals.Method) -> None:
    rig = bgars.LightRig.ring(8)
    images = np.random.default_rng(6).uniform(0.3, 1.0, (8, 40, 30)).astype(np.float32)
    images[:, 5, 7] = 0.0
    expected = bgars.estimate_normals(images, rig.directions, method=method, saturation=2.0)
    for scale in (1e-25, 1e-19, 1e-8, 1e8, 1e17, 1e20):
        scaled = images * np.float32(scale)
        found = bgars.estimate_normals(scaled, rig.directions, method=method, saturation=2.0 * scale)
        np.testing.assert_array_equal(found.mask, expected.mask)
        np.testing.assert_allclose(found.normals, expected.normals, atol=2e-5)
        assert np.isfinite(found.confidence).all()
    images[:, 3, 3] *= np.float32(1e-25)  # one such pixel among others
    one = bgars.estimate_normals(images, rig.directions, method="lambertian", saturation=2.0)
    lengths = np.linalg.norm(one.normals[one.mask], axis=1)
    np.testing.assert_allclose(lengths, 1.0, atol=1e-6)


@pytest.mark.parametrize("elevation_deg", [20.0, 35.0, 45.0, 60.0, 75.0])
@pytest.mark.parametrize("lights", [4, 6, 8, 12])
def test_normals_under_rings_are_those_of_f64_to_two_ten_thousandths_of_a_degree(
    lights: int, elevation_deg: float
) -> None:
    rng = np.random.default_rng(lights)
    directions = bgars.LightRig.ring(lights, elevation_deg=elevation_deg).directions
    normals = rng.normal(size=(200, 200, 3))
    normals[..., 2] = np.abs(normals[..., 2]) + 0.2
    shading = np.clip(normals @ directions.T / np.linalg.norm(normals, axis=-1, keepdims=True), 0.0, None)
    values = shading * rng.uniform(20.0, 200.0, (200, 200, 1))
    values += (rng.random(values.shape) < 0.3) * rng.uniform(0.0, 200.0, values.shape)  # highlights
    images = np.clip(values, 0.0, 255.0).astype(np.uint8).transpose(2, 0, 1)
    field = bgars.estimate_normals(images, directions, method="specular-filter", keep_sets=True)
    assert field.kept_sets is not None
    kept = field.kept_sets.astype(np.float64)
    assert (field.lights_kept < lights).any(), "no pixel loses a light"
    gram = np.einsum("hwk,ki,kj->hwij", kept, directions, directions)[field.mask]
    right = np.einsum("hwk,khw,ki->hwi", kept, images.astype(np.float64), directions)[field.mask]
    exact = np.linalg.solve(gram, right[..., None])[..., 0]
    found = field.normals[field.mask].astype(np.float64)
    angles = np.arctan2(np.linalg.norm(np.cross(exact, found), axis=-1), (exact * found).sum(axis=-1))
    assert np.degrees(angles).max() < 2e-4


@pytest.mark.parametrize("rows", [3, 1100])  # the larger image's results are written past the caches
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_counts_are_those_of_the_sets_where_blocks_that_keep_all_lie_among_others(rows: int, dtype: type) -> None:
    rng = np.random.default_rng(7)
    full = 1.0 if dtype is np.float32 else float(np.iinfo(dtype).max)
    images = np.full((8, rows, 1000), 0.2)
    with_highlights = np.repeat(rng.random((rows, 20)) < 0.5, 50, axis=1)
    images[3, with_highlights & (rng.random((rows, 1000)) < 0.3)] = 1.0
    stack = (images * full).astype(dtype)
    field = bgars.estimate_normals(stack, bgars.LightRig.ring(8).directions, method="specular-filter", keep_sets=True)
    assert field.kept_sets is not None
    assert set(np.unique(field.lights_kept)) == {7, 8}
    np.testing.assert_array_equal(field.lights_kept, np.where(images[3] == 1.0, 7, 8))
    np.testing.assert_array_equal(field.kept_sets.sum(axis=-1), field.lights_kept)
    assert field.mask.all()
    assert field.measured.all()
