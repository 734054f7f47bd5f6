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


def on_a_grid(mean: Array, information: Array) -> tuple[Array, Array, Array]:
    """Places (P, 2) around their mean, probabilities (P,), and the mean of two terms under the mixtures."""
    side = np.linspace(-6.0, 6.0, 1201)
    places = np.stack(np.meshgrid(side, side, indexing="ij"), axis=-1).reshape(-1, 2)
    off = places - mean
    weight = np.exp(-0.5 * np.einsum("pi,ij,pj->p", off, information, off))
    weight *= density(places[:, 0], FIRST) * density(places[:, 1], SECOND)
    weight /= weight.sum()
    middle = weight @ places
    return places - middle, weight, middle


@pytest.mark.parametrize(
    ("mean", "correlation"), [((0.0, 0.0), 0.0), ((2.0, 0.3), 0.5), ((1.5, -1.5), -0.95), ((0.3, 2.5), 0.9)]
)
def test_the_posterior_is_that_of_a_grid(mean: tuple[float, float], correlation: float) -> None:
    """One and two standard deviations hold what they hold of a normal distribution, and one of both no more."""
    likely = np.array([[0.3**2, correlation * 0.3 * 0.4], [correlation * 0.3 * 0.4, 0.4**2]])
    information = np.linalg.inv(likely)
    u_prior = np.array([0.7, 2.0])
    covariance = np.linalg.inv(information + np.diag(u_prior**-2.0))
    found, spread, wide = posterior(covariance @ information @ np.array(mean), covariance, u_prior, [FIRST, SECOND])
    off, weight, expected = on_a_grid(np.array(mean), information)
    np.testing.assert_allclose(found, expected, atol=2e-3)
    assert ((wide >= 0.0) & (wide <= 1.0)).all()
    variances = np.einsum("p,pi,pj->ij", weight, off, off)
    for axis in (*np.eye(2), *np.linalg.eigh(variances)[1].T):
        away, u = np.abs(off @ axis), float(np.sqrt(axis @ spread @ axis))
        within = np.array([weight[away <= u].sum(), weight[away <= 2.0 * u].sum()])
        beyond = within - [0.6827, 0.9545]
        # Exact along the axes of the spread, not along others.
        assert (beyond > [-0.03, -0.012]).all()
        assert beyond.min() < 0.03


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
