"""The fit under priors with long tails: what shadows alone leave open is settled, or stays open in the covariance."""

from __future__ import annotations

import math
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

__all__ = ["Settled", "alike_by_pixels", "settle"]

Array = NDArray[np.float64]
ALIASED = 0.5
"""Part of the misplacement by pixels that a whole stretch of edge, which crosses several of them, has."""
LEAST_EXCESS_PX = 1e-3
"""Scatter of stretches beyond their noise that is none."""


@dataclass(frozen=True)
class Settled:
    """The solution, the priors with long tails, and the probability that a common term is in the tail, by term."""

    solution: Solution
    mixtures: dict[int, Mixture]
    odd: dict[int, float]


def alike_by_pixels(solution: Solution, spread_px: float) -> float:
    """How often the same is seen where the pixels, not noise, misplace edges: factor on variances of common terms.

    Pixels misplace an edge of Gaussian spread s along their rows by ``exp(-2 pi^2 s^2) / pi`` times the sine of its
    place in the pixel (first term of Poisson's summation formula). In a grid of a whole number of pixels that is the
    same at every ball, and N balls say no more than one; elsewhere it is scatter.
    """
    aliased_px = ALIASED * math.exp(-2.0 * (math.pi * spread_px) ** 2) / math.pi
    share = min(1.0, (aliased_px / max(float(solution.excess_px), LEAST_EXCESS_PX)) ** 2)
    phases = np.exp(2.0j * np.pi * solution.balls[:, :2])
    same = len(phases) * float(np.square(np.abs(phases.mean(axis=0))).max())
    return 1.0 + share * max(same - 1.0, 0.0)


def settle(solution: Solution, priors: Priors, mixtures: dict[int, Mixture], alike: float = 1.0) -> Settled:
    """Put mixtures in the place of the normal priors of some common terms; everything else follows linearly.

    The border's conditional mean and covariance given these terms stay, as in an update of a Kalman filter (1960).
    `alike`: what the variances that the shadows gave these terms are too small by.
    """
    if not mixtures:
        return Settled(solution, {}, {})
    terms = sorted(mixtures)
    lights = len(solution.vectors)
    at = LIGHT_TERMS * lights + SHAPE_TERMS + np.array(terms)
    here = solution.border[np.ix_(at, at)]
    off = (solution.common - priors.common)[terms]
    known, prior = np.linalg.inv(here), np.diag(priors.u_common[terms] ** -2.0)
    seen: Array = np.asarray(np.linalg.inv((known - prior) / alike + prior), np.float64)
    weaker: Array = seen @ (known @ off) / alike
    mean, covariance, odd = posterior(weaker, seen, priors.u_common[terms], [mixtures[term] for term in terms])
    gain = solution.border[:, at] @ known
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
