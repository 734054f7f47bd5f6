"""The fit under priors with long tails: what shadows alone leave open is settled, or stays open in the covariance."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bgars.inspection.board import SHAPE_TERMS, Board
from bgars.inspection.bundle import LIGHT_TERMS
from bgars.inspection.bundle_model import turned
from bgars.inspection.common_terms import posterior

if TYPE_CHECKING:
    from bgars.inspection.bundle import Priors, Solution
    from bgars.inspection.common_terms import Mixture

__all__ = ["Settled", "settle"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Settled:
    """The solution, the priors with long tails, and the probability that a common term is in the tail, by term."""

    solution: Solution
    mixtures: dict[int, Mixture]
    odd: dict[int, float]


def settle(solution: Solution, priors: Priors, mixtures: dict[int, Mixture]) -> Settled:
    """Put mixtures in the place of the normal priors of some common terms; everything else follows linearly.

    The border's conditional mean and covariance given these terms stay, as in an update of a Kalman filter (1960).
    """
    if not mixtures:
        return Settled(solution, {}, {})
    terms = sorted(mixtures)
    lights = len(solution.vectors)
    at = LIGHT_TERMS * lights + SHAPE_TERMS + np.array(terms)
    here = solution.border[np.ix_(at, at)]
    off = (solution.common - priors.common)[terms]
    mean, covariance, odd = posterior(off, here, priors.u_common[terms], [mixtures[term] for term in terms])
    gain = solution.border[:, at] @ np.linalg.inv(here)
    change = gain @ (mean - off)
    border = solution.border + gain @ (covariance - here) @ gain.T
    of_lights, shared = change[: LIGHT_TERMS * lights].reshape(lights, LIGHT_TERMS), change[LIGHT_TERMS * lights :]
    settled = replace(
        solution,
        balls=solution.balls + solution.lever @ change,
        vectors=turned(solution.vectors, of_lights[:, :2]),
        shifts_px=solution.shifts_px + of_lights[:, 2:],
        board=Board(solution.board.coefficients + shared[:SHAPE_TERMS]),
        common=solution.common + shared[SHAPE_TERMS:],
        border=border,
    )
    return Settled(settled, mixtures, dict(zip(terms, odd.tolist(), strict=True)))
