"""The compiled estimator against numpy, over random stacks, dtypes, masks and light counts."""

from __future__ import annotations

from dataclasses import replace

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
    shape = (6, 22)  # two blocks of the fast kernel, and four pixels for the careful one
    images = (rng.random((lights, *shape)) * full).astype(dtype)
    images[0, 0, 0] = full  # float stacks: the largest value is full scale
    mask = rng.random(shape) > 0.3
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
    for scale in (1e-25, 1e-19, 1e-8, 1e-6, 1e6, 1e8, 1e17, 1e20):
        scaled = images * np.float32(scale)
        found = bgars.estimate_normals(scaled, rig.directions, method=method, saturation=2.0 * scale)
        np.testing.assert_array_equal(found.mask, expected.mask)
        np.testing.assert_allclose(found.normals, expected.normals, atol=2e-5)
        assert np.isfinite(found.confidence).all()
        np.testing.assert_allclose(found.confidence, expected.confidence, atol=5e-3)
    images[:, 3, 3] *= np.float32(1e-25)  # one such pixel among others
    one = bgars.estimate_normals(images, rig.directions, method="lambertian", saturation=2.0)
    lengths = np.linalg.norm(one.normals[one.mask], axis=1)
    np.testing.assert_allclose(lengths, 1.0, atol=1e-6)


def of_residual(field: bgars.NormalField) -> NDArray[np.float64]:
    """Confidence of the residual as the kernels sum it, before what hides in the normal is added."""
    hidden_misfit = 64.0 / 9.0
    of_normal = field.confidence.astype(np.float64)
    return of_normal * hidden_misfit / (of_normal * hidden_misfit + 1.0 - of_normal)


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


def careful_estimate(
    capture: bgars.Capture, method: bgars.normals.Method, *, keep_sets: bool = False
) -> bgars.NormalField:
    """Estimate a row of pixels in parts shorter than a block of the fast kernel: all are left to the careful one."""
    parts = []
    for first in range(0, capture.mask.shape[1], 40):
        cols = slice(first, first + 40)
        dark = None if capture.dark is None else np.ascontiguousarray(capture.dark[:, cols])
        images = np.ascontiguousarray(capture.images[:, :, cols])
        part = replace(capture, images=images, mask=capture.mask[:, cols], dark=dark)
        parts.append(bgars.estimate_normals(part, method=method, keep_sets=keep_sets))
    arrays = {
        name: np.concatenate([getattr(part, name) for part in parts], axis=1)
        for name in ("normals", "albedo", "mask", "confidence", "is_measured", "lights_kept", "kept_sets")
        if getattr(parts[0], name) is not None
    }
    return replace(parts[0], **arrays)


def random_row(dtype: type, rig: bgars.LightRig, least: float, pixels: int = 640) -> bgars.Capture:
    """Values between so much of full scale and all of it."""
    full = 1.0 if dtype is np.float32 else float(np.iinfo(dtype).max)
    images = (np.random.default_rng(7).uniform(least, 1.0, (len(rig), 1, pixels)) * full).astype(dtype)
    mask = np.ones((1, pixels), np.bool_)
    return bgars.Capture(images, rig, mask, saturation=2.0 * full, full_scale=full)


@pytest.mark.parametrize("shift", [0.0, 0.1])  # a ring, whose principal axes are the camera's, and lights whose are not
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
@pytest.mark.parametrize("lights", [5, 8, 9, 15, 40])  # above eight they are summed up by eights, fours and ones
def test_where_all_lights_are_kept_all_is_as_the_careful_kernel_says(lights: int, dtype: type, shift: float) -> None:
    directions = bgars.LightRig.ring(lights, elevation_deg=50.0).directions + np.array([shift, shift / 2, 0.0])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    capture = random_row(dtype, bgars.LightRig.from_directions(directions), least=0.2)
    fast = bgars.estimate_normals(capture, method="lambertian")
    careful = careful_estimate(capture, "lambertian")
    for name in ("normals", "albedo"):
        np.testing.assert_allclose(getattr(fast, name), getattr(careful, name), rtol=0, atol=1e-6, err_msg=name)
    np.testing.assert_allclose(of_residual(fast), of_residual(careful), rtol=0, atol=1e-4)


@pytest.mark.parametrize("lights", [5, 8, 9])
@pytest.mark.parametrize("kind", ["dark frame", "black level", "intensities", "response", "mask"])
@pytest.mark.parametrize("method", ["lambertian", "specular-filter", "robust-filter"])
def test_both_kernels_read_a_capture_alike(method: bgars.normals.Method, kind: str, lights: int) -> None:
    rng = np.random.default_rng(11)
    gains = rng.uniform(0.5, 2.0, lights) if kind == "intensities" else None
    capture = random_row(np.uint8, bgars.LightRig.ring(lights, elevation_deg=50.0, intensities=gains), least=0.1)
    pixels = capture.mask.shape[1]
    if kind == "dark frame":
        capture = replace(capture, dark=rng.integers(0, 20, (1, pixels), dtype=np.uint8))
    elif kind == "black level":
        capture = replace(capture, black_level=13.0)
    elif kind == "response":
        capture = replace(capture, response=(np.arange(256) ** 1.3 / 255**0.3).astype(np.float32))
    elif kind == "mask":
        mask = rng.random((1, pixels)) < 0.7
        mask[:, 128:192] = False  # a block of the fast kernel without a pixel
        mask[:, 192:256] = True
        capture = replace(capture, mask=mask)
    fast = bgars.estimate_normals(capture, method=method, keep_sets=True)
    careful = careful_estimate(capture, method, keep_sets=True)
    for name in ("mask", "is_measured", "lights_kept", "kept_sets"):
        np.testing.assert_array_equal(getattr(fast, name), getattr(careful, name), err_msg=name)
    assert fast.mask.sum() > 300
    np.testing.assert_allclose(fast.normals, careful.normals, rtol=0, atol=1e-5)
    np.testing.assert_allclose(fast.albedo, careful.albedo, rtol=1e-4)


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
    assert field.is_measured.all()


@pytest.mark.parametrize("masked", [False, True])
@pytest.mark.parametrize(
    ("method", "size"),
    [
        *((method, (4, 60)) for method in (*bgars.normals.METHODS, "blind")),
        # So many values are not searched first, but while the kernel works.
        *((method, (300, 300)) for method in ("lambertian", "specular-filter", "robust-filter")),
    ],
)
def test_full_scale_of_plain_floats_is_their_largest_value(
    method: bgars.normals.Method, size: tuple[int, int], masked: bool
) -> None:
    rng = np.random.default_rng(3)
    rig = bgars.LightRig.ring(8, elevation_deg=50.0)
    images = rng.uniform(0.1, 0.7, (8, *size)).astype(np.float32)
    mask = rng.random(size) < (0.8 if masked else 2.0)
    images[2, 1, 7] = 1.7
    mask[1, 7] = False  # outside the mask it counts all the same
    found = bgars.estimate_normals(images, rig.directions, method=method, mask=mask if masked else None)
    given_mask = mask if masked else np.ones(size, np.bool_)
    told = bgars.Capture(images, rig, given_mask, full_scale=float(images.max()))
    expected = bgars.estimate_normals(told, method=method)
    for name in ("normals", "albedo", "mask", "confidence", "is_measured", "lights_kept"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name), err_msg=name)
    assert found.method_reason == expected.method_reason
