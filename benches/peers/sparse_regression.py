"""Published estimators that take highlights and shadows as sparse errors, written from their equations.

S. Ikehata, D. Wipf, Y. Matsushita, K. Aizawa, "Robust photometric stereo using sparse regression", CVPR 2012:
observations ``i = L g + e`` with ``g = rho n`` and few large ``e``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import linprog

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

ROUNDS = 100
MIN_CHANGE = 1e-4
"""The hyperparameters have settled when none moves by more than this share of full scale."""
PRIOR_VARIANCE = 1e6
NOISE_VARIANCE = 1e-6
"""Of `g`, and of what is neither diffuse nor an outlier; for values of full scale 1."""
AT_ONCE = 4096


def least_absolute(values: Floats, directions: Floats) -> Floats:
    """(N, 3) `g` of least ``sum |i - L g|`` (their convex problem without dense noise), a linear program a pixel.

    `values` (N, L), `directions` (L, 3) unit vectors.
    """
    lights = len(directions)
    identity = np.eye(lights)
    costs = np.concatenate([np.zeros(3), np.ones(2 * lights)])
    equations = np.hstack([directions, identity, -identity])
    bounds = [(None, None)] * 3 + [(0.0, None)] * (2 * lights)
    found = [linprog(costs, A_eq=equations, b_eq=row, bounds=bounds, method="highs").x[:3] for row in values]
    return np.array(found)


def sparse_bayesian(values: Floats, directions: Floats) -> Floats:
    """(N, 3) `g` by sparse Bayesian learning: errors of unknown variance a light, found by EM.

    All pixels of a batch at once; `values` (N, L) of full scale 1, `directions` (L, 3) unit vectors.
    """
    batches = [_batch(values[first : first + AT_ONCE], directions) for first in range(0, len(values), AT_ONCE)]
    return np.concatenate(batches)


def _batch(values: Floats, directions: Floats) -> Floats:
    explained = PRIOR_VARIANCE * directions @ directions.T + NOISE_VARIANCE * np.eye(len(directions))
    variances = np.ones_like(values)
    for _ in range(ROUNDS):
        inverse = np.linalg.inv(explained + variances[:, :, None] * np.eye(len(directions)))
        errors = variances * np.einsum("nij,nj->ni", inverse, values)
        spread = variances - variances**2 * np.einsum("nii->ni", inverse)
        before, variances = variances, errors**2 + spread
        if np.abs(variances - before).max() < MIN_CHANGE:
            break
    weights = 1.0 / (variances + NOISE_VARIANCE)
    gram = np.einsum("ni,ij,ik->njk", weights, directions, directions) + np.eye(3) / PRIOR_VARIANCE
    solved: Floats = np.linalg.solve(gram, np.einsum("ni,ij,ni->nj", weights, directions, values)[..., None])[..., 0]
    return solved
