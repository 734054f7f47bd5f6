"""The kernels of the ball finder against plain numpy."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import TYPE_CHECKING

import bgars
import numpy as np
import pytest
from bgars import _bgars

if TYPE_CHECKING:
    from numpy.typing import NDArray

SHAPES, ANGLES, STEPS_PER_PX, THINNEST_PX = 4, 16, 64, 0.08
SECTORS, BLUR_PX, RIDGE = 24, 0.3, 1e-6


@pytest.mark.parametrize("blur_px", [0.0, 0.3, 1.0])
def test_rim_profiles_are_differences_of_repeated_integrals(blur_px: float) -> None:
    table = _bgars.rim_profiles(blur_px, 3.0, threads=2)
    depth_px = np.arange(-3 * STEPS_PER_PX, 3 * STEPS_PER_PX + 1) / STEPS_PER_PX
    soft = math.sqrt(6.0) * blur_px
    for values, angle in zip(table, np.linspace(0.0, math.pi / 4, ANGLES), strict=True):
        widths = [max(width, THINNEST_PX) for width in (math.cos(angle), math.sin(angle), soft, soft)]
        np.testing.assert_allclose(values, _profiles(depth_px, widths), rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("every", [1, 3])
def test_rim_bands_hold_the_pixels_near_each_rim_by_sector(every: int) -> None:
    circles = np.array([[20.3, 30.6, 9.2], [-2.0, 5.0, 6.0]])
    depths = np.array([[2.0, 1.5], [3.0, 2.5]])
    rows, cols, weights = _bgars.rim_bands(circles, depths, every=every, sectors=24, threads=2)
    for ball, ((row, col, radius), (inward, outward)) in enumerate(zip(circles, depths, strict=True)):
        span = np.arange(-15, 16)
        r, c = (side.ravel() for side in np.meshgrid(span, span, indexing="ij"))
        y, x = row - (np.rint(row) + r), np.rint(col) + c - col
        depth = radius - np.hypot(x, y)
        place = (np.rint(row) + r).astype(int) * 3242174889 + (np.rint(col) + c).astype(int) * 2447445414
        near = np.flatnonzero((depth < inward) & (depth > -outward) & (place % 2**32 * every < 2**32))
        sector = np.floor((np.arctan2(y, x)[near] / (2 * math.pi) % 1.0) * 24).astype(int) % 24
        for index in range(24):
            used = weights[ball, index] > 0
            np.testing.assert_array_equal(rows[ball, index][used], r[near][sector == index])
            np.testing.assert_array_equal(cols[ball, index][used], c[near][sector == index])


@pytest.mark.parametrize("threads", [1, 2])
def test_ring_edges_are_the_ranked_change_over_three_directions(threads: int) -> None:
    rng = np.random.default_rng(5)
    images = rng.random((5, 40, 50), dtype=np.float32)
    centres = rng.uniform(0.0, 40.0, (7, 2))
    radii = np.sort(rng.uniform(1.0, 25.0, (7, 9)), axis=1)
    angle = (np.arange(12) + 0.5) * (2 * math.pi / 12)
    r = np.rint(centres[:, 0, None, None] - np.sin(angle)[:, None] * radii[:, None, :]).astype(int)
    c = np.rint(centres[:, 1, None, None] + np.cos(angle)[:, None] * radii[:, None, :]).astype(int)
    inside = (r >= 0) & (r < 40) & (c >= 0) & (c < 50)
    value = images[:, np.where(inside, r, 0), np.where(inside, c, 0)]
    mean = (value + np.roll(value, 1, axis=2) + np.roll(value, -1, axis=2)) / 3.0
    edge = np.zeros_like(mean)
    edge[..., 1:-1] = np.abs(mean[..., 2:] - mean[..., :-2]) * (inside[:, :, 2:] & inside[:, :, :-2])
    found = _bgars.ring_edges(images, centres, radii, directions=12, rank=2, threads=threads)
    np.testing.assert_allclose(found, np.sort(edge, axis=0)[-2], atol=1e-6)


@pytest.mark.parametrize(("lights", "threads"), [(3, 1), (11, 2)])
def test_eliminate_rims_is_least_squares_in_each_sector(lights: int, threads: int) -> None:
    rng = np.random.default_rng(8)
    circles = np.array([[0.3, -0.2, 17.4], [-0.4, 0.1, 9.8]])
    depths = np.tile([4.0, 3.0], (2, 1))
    row, col, weight = _bgars.rim_bands(circles, depths, every=1, sectors=SECTORS, threads=1)
    weight *= rng.uniform(0.2, 1.0, weight.shape).astype(np.float32)
    levels = (rng.random((lights, *row.shape)) * weight).astype(np.float32)
    pixels = SimpleNamespace(row=row, col=col, weight=weight, levels=levels)
    table = _bgars.rim_profiles(BLUR_PX, 6.0, threads=1)
    moved = circles + np.array([0.05, 0.1, -0.2])
    rest, coefficients = _bgars.eliminate_rims(pixels, moved, table, blur_px=BLUR_PX, threads=threads)
    for ball, circle in enumerate(moved):
        for sector in range(SECTORS):
            here = weight[ball, sector] > 0
            x, y = col[ball, sector][here] - circle[1], circle[0] - row[ball, sector][here]
            basis, slopes = _rim_columns(x, y, circle[2], sector, table)
            w = weight[ball, sector][here].astype(np.float64)[:, None]
            others = np.concatenate([slopes * w, levels[:, ball, sector][:, here].T], axis=1)
            # The ridge as further observations of 0.
            ridge = math.sqrt(RIDGE * float(((basis * w) ** 2).sum()) + 1e-9)
            design = np.concatenate([basis * w, ridge * np.eye(7)])
            right = np.concatenate([others, np.zeros((7, 5 + lights))])
            solved = np.linalg.lstsq(design, right, rcond=None)[0]
            left = right - design @ solved
            # With an eighth-circle's direction halfway between two of the table rounding may choose either.
            np.testing.assert_allclose(rest[ball, sector], left.T @ left, rtol=1e-5, atol=1e-5)
            np.testing.assert_allclose(coefficients[ball, sector], solved[:, 5:], rtol=1e-3, atol=1e-3)


def test_eliminate_rims_wants_pixels_and_circles_of_one_band() -> None:
    pixels = SimpleNamespace(**{name: np.zeros((2, SECTORS, 4), np.float32) for name in ("row", "col", "weight")})
    pixels.levels = np.zeros((3, 2, SECTORS, 4), np.float32)
    table = _bgars.rim_profiles(BLUR_PX, 2.0, threads=1)
    with pytest.raises(bgars.InputError, match="must be of one band"):
        _bgars.eliminate_rims(pixels, np.zeros((1, 3)), table, blur_px=BLUR_PX, threads=1)


def _rim_columns(
    x: NDArray[np.float64], y: NDArray[np.float64], radius_px: float, sector: int, table: NDArray[np.float32]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Basis (P, 7) and its derivatives by the radius (P, 5) at pixels relative to a circle's centre."""
    distance = np.hypot(x, y)
    depth = radius_px - distance - (1.0 / 24.0 + 0.5 * BLUR_PX**2) / np.maximum(distance, 0.5)
    fold = np.arctan2(np.minimum(abs(x), abs(y)), np.maximum(abs(x), abs(y))) * ((ANGLES - 1) / (math.pi / 4))
    at_px = (np.arange(table.shape[1]) - table.shape[1] // 2) / STEPS_PER_PX
    shapes = np.zeros((len(x), 2 * SHAPES))
    for angle in range(ANGLES):
        here = np.rint(fold) == angle
        for shape in range(2 * SHAPES):
            shapes[here, shape] = np.interp(depth[here], at_px, table[angle, :, shape])
    middle = (sector + 0.5) * (2 * math.pi / SECTORS)
    along = (y * math.cos(middle) - x * math.sin(middle)) / (radius_px * math.pi / SECTORS)
    values, slopes = shapes[:, :SHAPES], shapes[:, SHAPES:]
    basis = np.column_stack([np.ones(len(x)), values, along, along * values[:, 0]])
    return basis, np.column_stack([slopes, along * slopes[:, 0]])


def _profiles(depth_px: NDArray[np.float64], widths_px: list[float]) -> NDArray[np.float64]:
    """(T, 2 SHAPES): averages over four boxes of the step, root and ramps, then their derivatives."""
    profiles = np.zeros((2 * SHAPES, len(depth_px)))
    volume = math.prod(widths_px)
    for corner in range(16):
        signs = [1 if corner >> bit & 1 else -1 for bit in range(4)]
        shift = sum(sign * width / 2 for sign, width in zip(signs, widths_px, strict=True))
        weight = math.prod(signs) / volume
        inside = np.maximum(depth_px + shift, 0.0)
        outside = np.maximum(-depth_px - shift, 0.0)
        root = np.sqrt(inside)
        cube, outer = inside * inside * inside, outside * outside
        fourth, outer = cube * inside, outer * outer
        profiles[0] += weight / 24 * fourth
        profiles[1] += weight * 16 / 945 * (fourth * root)
        profiles[2] += weight / 120 * (fourth * inside)
        profiles[3] += weight / 120 * (outer * outside)
        profiles[4] += weight / 6 * cube
        profiles[5] += weight * 8 / 105 * (cube * root)
        profiles[6] += weight / 24 * fourth
        profiles[7] -= weight / 24 * outer
    return profiles.T
