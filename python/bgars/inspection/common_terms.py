r"""What all balls and lights share, and the priors with long tails of the terms that shadows alone cannot settle.

Shadows fix ``q cot(e)`` of every light well and neither of both: with all balls flattened by a share and all lights
lowered to match, every shadow stays where it is. Which it was, the priors say. Each is a mixture of two normal
distributions: a narrow one, a set-up as it should be, and a wide one, a set-up that is not. The likelihood of the
common terms is normal (the bundle's), so the posterior is a mixture of normals, too, with weights in closed form
(Bishop, "Pattern Recognition and Machine Learning", 2006, eqs. 2.113 to 2.117). Where both explanations remain, its
spread holds both: it is the least whose one and two standard deviations hold 68 % and 95 % of the mixture
(JCGM 101:2008, 7.7). The root of the mixture's variance would be ruled by its tail, however improbable: too large by a
factor of two where one set-up in a hundred is not as it should be.
"""

from __future__ import annotations

import math
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bgars.inspection.normal_distribution import normal_distribution

__all__ = [
    "AZIMUTH",
    "COMMON_TERMS",
    "EDGE",
    "EDGE_TERMS",
    "ELEVATION",
    "OUTLINE",
    "OUTLINE_X",
    "OUTLINE_Y",
    "PERSPECTIVE",
    "ROUNDNESS",
    "Mixture",
    "posterior",
]

Array = NDArray[np.float64]

ELEVATION, AZIMUTH, ROUNDNESS, PERSPECTIVE, EDGE, EDGE_1, EDGE_2, EDGE_3, OUTLINE, OUTLINE_X, OUTLINE_Y = range(11)
"""Elevation and azimuth of all lights together (rad), q - 1 of all balls together, 1 / camera distance (1 / px); how
far out edges of shadows are measured: all, and by cos a, cos 2a, cos 3a, a the angle from the tip (px); how far out all
outlines are, and how far aside along x and y (px)."""
COMMON_TERMS = 11
EDGE_TERMS = (EDGE, EDGE_1, EDGE_2, EDGE_3)


class Mixture(NamedTuple):
    """A prior around 0: standard deviations of a set-up as it should be and of one that is not, share of the latter."""

    narrow: float
    wide: float
    share: float

    @property
    def spread(self) -> float:
        """Least u so that u and 2 u hold 68 % and 95 % of the whole."""
        shares, u = np.array([1.0 - self.share, self.share]), np.array([self.narrow, self.wide])
        return _covering(shares, np.zeros(2), u)


COVERED = {1.0: math.erf(math.sqrt(0.5)), 2.0: math.erf(math.sqrt(2.0))}
"""Probability of one and of two standard deviations of a normal distribution."""
HALVINGS = 50


def posterior(mean: Array, covariance: Array, u_prior: Array, mixtures: list[Mixture]) -> tuple[Array, Array, Array]:
    """Mean (C,), spread (C, C) and probability (C,) of the wide part, of C common terms under their mixtures.

    One and two standard deviations of the spread, along each of its axes, hold at least 68 % and 95 % of the mixture.

    Parameters
    ----------
    mean, covariance : (C,), (C, C) float64
        Posterior under independent normal priors around 0.
    u_prior : (C,) float64
        Standard deviations of these priors.
    mixtures : list of Mixture
        Priors to put in their place.

    Examples
    --------
    >>> wide = Mixture(0.1, 10.0, 0.1)
    >>> mean, _, doubt = posterior(np.array([3.0]), np.array([[0.01]]), np.array([100.0]), [wide])
    >>> bool(mean[0] > 2.9), bool(doubt[0] > 0.99)
    (True, True)
    """
    precision = np.linalg.inv(covariance)
    likelihood = precision - np.diag(u_prior**-2.0)
    information = precision @ mean
    logs, means, covariances, picks = [], [], [], []
    for pick in product((False, True), repeat=len(mixtures)):
        parts = list(zip(mixtures, pick, strict=True))
        u = np.array([mixture.wide if is_wide else mixture.narrow for mixture, is_wide in parts])
        share = float(np.prod([mixture.share if is_wide else 1.0 - mixture.share for mixture, is_wide in parts]))
        if share <= 0.0:
            continue
        here = np.linalg.inv(likelihood + np.diag(u**-2.0))
        middle = here @ information
        logs.append(
            float(np.log(share) - np.log(u).sum() + 0.5 * np.linalg.slogdet(here)[1] + 0.5 * information @ middle)
        )
        means.append(middle)
        covariances.append(here)
        picks.append(pick)
    weight = np.exp(np.array(logs) - max(logs))
    weight /= weight.sum()
    each = np.array(means)
    total = weight @ each
    wide = weight @ np.array(picks, dtype=np.float64)
    return total, _spread(weight, each - total, np.array(covariances)), wide


def _spread(weight: Array, off: Array, covariances: Array) -> Array:
    """(C, C) covariance that covers a mixture of K normals: weights (K,), means (K, C) from the whole's mean.

    Along the axes in which the whole differs most from its most probable part, one by one.
    """
    root = np.linalg.cholesky(covariances[int(np.argmax(weight))])
    inverse = np.linalg.inv(root)
    off, covariances = off @ inverse.T, inverse @ covariances @ inverse.T
    whole = np.einsum("k,ki,kj->ij", weight, off, off) + np.einsum("k,kij->ij", weight, covariances)
    axes = np.linalg.eigh(whole)[1]
    means, variances = off @ axes, np.einsum("ia,kij,ja->ka", axes, covariances, axes)
    u = np.array([_covering(weight, *part) for part in zip(means.T, np.sqrt(variances).T, strict=True)])
    back = root @ axes
    spread: Array = (back * u**2) @ back.T
    return spread


def _covering(weight: Array, means: Array, deviations: Array) -> float:
    """Least u so that a mixture of normals lies within u and 2 u of 0 as often as a normal distribution does."""
    largest = 0.0
    for factor, covered in COVERED.items():
        low, high = 0.0, float(np.abs(means).max() + 4.0 * deviations.max())
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            below, above = (middle - means) / deviations, (-middle - means) / deviations
            inside = weight @ (normal_distribution(below) - normal_distribution(above))
            low, high = (low, middle) if inside > covered else (middle, high)
        largest = max(largest, high / factor)
    return largest
