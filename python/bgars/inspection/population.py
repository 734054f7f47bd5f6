"""Which balls are round like the others, and how much the round ones scatter."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bgars.inspection.common_terms import ROUNDNESS

if TYPE_CHECKING:
    from bgars.inspection.bundle import Solution

__all__ = ["q_spread"]

Array = NDArray[np.float64]

LIMITS = (0.0003, 0.02)
"""Bounds of the scatter of q among round balls."""
UNKNOWN = 0.003
"""Scatter of q among round balls where too few of them are seen."""
MIN_POPULATION = 5
"""Fewer round balls do not know their scatter."""
OUTLIER = 3.5
"""Standard deviations beyond which a ball is not one of the round ones."""
FREE = 0.2
"""Prior standard deviation of q of a ball that is not round: its own shadows count."""
ODD_SHARE, ODD_SPREAD = 0.01, 0.1
"""Share of balls that are not round, of any part, and the standard deviation of their q: what reflow, a tool or a bad
pad makes of one ball in a hundred."""
WORTH_TELLING = 0.05
"""Probability of that from which on it is in the uncertainty: U covers 95 %, and what is less likely is outside."""
LEAST_INFORMATION = 1e-6
"""Of a ball's shadows about its q, of all there is: a tight prior leaves as much, and rounding far less."""
MEDIAN_CHI_SQUARE = 0.455
ROUNDS = 10


def q_spread(solution: Solution, u_prior: Array) -> Array:
    """(N,) standard deviations of the priors of q around that of all: one for like balls, wide for one that is not.

    Between them lie balls whose shadows do not tell: by how likely each of them is not round.

    Parameters
    ----------
    solution : Solution
    u_prior : (N,) float64
        The priors it was made with: their part is taken out, so that the shadow alone says whether a ball is round.

    Notes
    -----
    Empirical Bayes: the scatter s of the round ones is where ``mean of (q - 1)^2 - u^2`` has it, within bounds.
    """
    information = 1.0 / solution.alone[:, 4, 4]
    by_shadow = np.maximum(information - 1.0 / u_prior**2, LEAST_INFORMATION * information)
    off = (solution.balls[:, 4] - 1.0 - solution.common[ROUNDNESS]) * information / by_shadow
    variance = 1.0 / by_shadow
    excess_square = np.median(np.square(off) - variance * MEDIAN_CHI_SQUARE) / MEDIAN_CHI_SQUARE
    scatter = float(np.clip(np.sqrt(max(float(excess_square), 0.0)), *LIMITS))
    for _ in range(ROUNDS):
        total = variance + scatter**2
        round_ones = np.square(off) < OUTLIER**2 * total
        if round_ones.sum() < MIN_POPULATION:
            scatter = UNKNOWN
            break
        weight = 1.0 / np.square(total[round_ones])
        excess = float((weight * (np.square(off[round_ones]) - variance[round_ones])).sum() / weight.sum())
        scatter = float(np.clip(np.sqrt(max(excess, 0.0)), *LIMITS))
    round_ones = np.square(off) < OUTLIER**2 * (variance + scatter**2)
    odd = _odd_chance(off, variance, scatter)
    between = np.where(odd > WORTH_TELLING, np.sqrt((1.0 - odd) * scatter**2 + odd * ODD_SPREAD**2), scatter)
    return np.where(round_ones, between, FREE)


def _odd_chance(off: Array, variance: Array, scatter: float) -> Array:
    """(N,) probabilities of balls not to be round, by what their shadows say of q (Bayes)."""
    like, odd = variance + scatter**2, variance + ODD_SPREAD**2
    log_ratio = 0.5 * (np.square(off) * (1.0 / like - 1.0 / odd) + np.log(like / odd))
    chance: Array = 1.0 / (1.0 + (1.0 / ODD_SHARE - 1.0) * np.exp(-np.minimum(log_ratio, 700.0)))
    return chance
