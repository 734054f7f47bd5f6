"""Small substitutes for scipy, whose import takes as long as a small part, and for slow functions: the same values."""

from __future__ import annotations

import numpy as np
import scipy
from bgars.balls.outward import _fast_length, _largest_around
from bgars.checks.reordered import _paired
from bgars.inspection.normal_distribution import normal_distribution
from bgars.inspection.spread import _nonnegative
from bgars.records.light_median import light_median
from bgars.surface.anchoring import _blurred


def test_the_normal_distribution_is_that_of_scipy() -> None:
    values = np.concatenate([np.linspace(-37.0, 9.0, 20_001), [np.inf, -np.inf, np.nan]]).reshape(4, -1)
    np.testing.assert_allclose(normal_distribution(values), scipy.special.ndtr(values), rtol=1e-12)
    assert normal_distribution(np.zeros((0, 3))).shape == (0, 3)


def test_rows_near_their_partners_are_paired_as_scipy_pairs_them() -> None:
    random = np.random.default_rng(2)
    for count in (6, 8, 24, 64):
        turn = 2.0 * np.pi * np.arange(count) / count
        table = np.column_stack([np.cos(turn), np.sin(turn), np.ones(count)])
        seen = table[random.permutation(count)] + random.normal(0.0, 0.5 / count, (count, 3))
        costs = np.square(seen[:, None] - table[None]).sum(axis=2)
        assert _paired(seen, table).tolist() == scipy.optimize.linear_sum_assignment(costs)[1].tolist()
        assert sorted(_paired(random.normal(size=(count, 3)), table)) == list(range(count))


def test_nonnegative_least_squares_are_those_of_scipy() -> None:
    random = np.random.default_rng(3)
    held = 0
    for _ in range(100):
        columns = random.random((50, 3))
        values = columns @ random.normal(size=3) + 0.1 * random.normal(size=50)
        found = _nonnegative(columns, values)
        np.testing.assert_allclose(found, scipy.optimize.nnls(columns, values)[0], atol=1e-10)
        held += int((found == 0.0).any())
    assert held > 20, "some are held at zero"


def test_the_largest_value_around_is_that_of_scipy() -> None:
    values = np.random.default_rng(4).random((37, 52)).astype(np.float32)
    for reach in (0, 1, 2, 5, 17):
        expected = scipy.ndimage.maximum_filter(values, 2 * reach + 1)
        np.testing.assert_array_equal(_largest_around(values, reach), expected)


def test_lengths_of_transforms_are_the_fast_ones() -> None:
    for least in (1, 7, 431, 997, 2049, 5003):
        assert _fast_length(least) == scipy.fft.next_fast_len(least, real=True)


def test_the_blur_is_that_of_scipy() -> None:
    values = np.random.default_rng(5).random((61, 84))
    for sigma_px in (0.8, 5.0, 40.0):
        expected = scipy.ndimage.gaussian_filter(values, sigma_px, mode="constant")
        np.testing.assert_allclose(_blurred(values, sigma_px), expected, atol=1e-13)


def test_the_median_over_lights_is_that_of_numpy() -> None:
    random = np.random.default_rng(6)
    for lights in (1, 2, 3, 8, 25):
        for kind in (np.float32, np.float64):
            values = random.random((lights, 9, 11)).astype(kind)
            values[-1, 3, 4] = np.nan
            found = light_median(values)
            assert found.dtype == kind
            np.testing.assert_array_equal(found, np.median(values, axis=0))
