"""Mixture priors of common terms against a slow twin: the posterior summed over a fine grid."""

from __future__ import annotations

import numpy as np
import pytest
from bgars.inspection.common_terms import Mixture, posterior
from numpy.typing import NDArray

Array = NDArray[np.float64]
FIRST, SECOND = Mixture(0.1, 1.0, 0.1), Mixture(0.2, 1.5, 0.2)


def density(x: Array, mixture: Mixture) -> Array:
    def normal(u: float) -> Array:
        return np.exp(-0.5 * np.square(x / u)) / u

    return (1.0 - mixture.share) * normal(mixture.narrow) + mixture.share * normal(mixture.wide)


def on_a_grid(mean: Array, information: Array) -> tuple[Array, Array]:
    """Mean and covariance of two terms with a normal likelihood and the mixtures."""
    side = np.linspace(-6.0, 6.0, 1201)
    x, y = np.meshgrid(side, side, indexing="ij")
    off = np.stack([x - mean[0], y - mean[1]], axis=-1)
    weight = np.exp(-0.5 * np.einsum("xyi,ij,xyj->xy", off, information, off))
    weight *= density(x, FIRST) * density(y, SECOND)
    weight /= weight.sum()
    middle = np.array([(weight * x).sum(), (weight * y).sum()])
    dx, dy = x - middle[0], y - middle[1]
    mixed = (weight * dx * dy).sum()
    return middle, np.array([[(weight * dx * dx).sum(), mixed], [mixed, (weight * dy * dy).sum()]])


@pytest.mark.parametrize(
    ("mean", "correlation"), [((0.0, 0.0), 0.0), ((2.0, 0.3), 0.5), ((1.5, -1.5), -0.95), ((0.3, 2.5), 0.9)]
)
def test_the_posterior_is_that_of_a_grid(mean: tuple[float, float], correlation: float) -> None:
    spread = np.array([[0.3**2, correlation * 0.3 * 0.4], [correlation * 0.3 * 0.4, 0.4**2]])
    information = np.linalg.inv(spread)
    u_prior = np.array([0.7, 2.0])
    covariance = np.linalg.inv(information + np.diag(u_prior**-2.0))
    found, found_covariance, wide = posterior(
        covariance @ information @ np.array(mean), covariance, u_prior, [FIRST, SECOND]
    )
    expected, expected_covariance = on_a_grid(np.array(mean), information)
    np.testing.assert_allclose(found, expected, atol=2e-3)
    np.testing.assert_allclose(found_covariance, expected_covariance, atol=2e-3)
    assert ((wide >= 0.0) & (wide <= 1.0)).all()


def test_two_explanations_stay_where_nothing_tells_them_apart() -> None:
    """A sum is known to be 2, either part may be it: the mean is between, and the spread holds both."""
    information = np.full((2, 2), 1.0e4)
    u_prior = np.array([1.0, 1.0])
    covariance = np.linalg.inv(information + np.eye(2))
    same = Mixture(0.05, 1.5, 0.1)
    mean, spread, wide = posterior(covariance @ (information @ np.array([1.0, 1.0])), covariance, u_prior, [same, same])
    assert mean == pytest.approx([1.0, 1.0], abs=0.05)
    assert np.sqrt(np.diag(spread)) == pytest.approx([1.0, 1.0], abs=0.25)
    assert wide == pytest.approx([0.5, 0.5], abs=0.15)
