"""All balls, all lights and the board from measured points of shadow edges: robust Gauss-Newton with Schur complement.

Unknowns: of each ball x, y, z, radius, q; of each light two small turns and the shift of its image; five coefficients
of the board, and what all balls and lights share (:mod:`bgars.inspection.common_terms`). Balls meet only through
lights, board and common terms, so the normal matrix is an arrow: blocks of 5 x 5, a border (Triggs et al., "Bundle
adjustment - a modern synthesis", 2000, section 6.1).

Priors are normal: each light stands where the rig says, turned by what all lights are turned by; the board is nearly
flat; each ball is as round as all balls are; outlines are where the camera sees balls, aside by height over distance
where it is near, and as large as the part of a ball above the board (a cap's outline is its foot).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bgars.inspection.board import SHAPE_TERMS, Board
from bgars.inspection.bundle_model import State, linearise_edges, turned
from bgars.inspection.bundle_normal import LIGHT_TERMS, NormalEquations, Priors, normal_equations
from bgars.inspection.misfit import relief_px, scatter_factors
from bgars.inspection.shadow_model import BALL_TERMS

if TYPE_CHECKING:
    from bgars.inspection.shadow_edges import Edges

__all__ = [
    "LIGHT_TERMS",
    "Priors",
    "Solution",
    "angles_rad",
    "honest_weights",
    "relief_variances",
    "robust_weights",
    "solve_bundle",
]

Array = NDArray[np.float64]

MAX_ROUNDS = 30
STEP_TOLERANCE_PX = 1e-4
Q_TOLERANCE = 1e-5
CAUCHY = 2.5
"""Scale of the Cauchy loss, in standard deviations: 95 % efficient on normal noise at 2.385 (Holland and Welsch
1977)."""
MIN_Q, MAX_Q = 0.2, 2.0
"""Bounds of vertical over horizontal radius within which the fit stays."""
LARGEST_STEP, LARGEST_TURN_RAD, LARGEST_Q_STEP = 0.3, 0.1, 0.15
"""Of one round: in radii, and for lights and q. Farther the linear model does not reach."""


@dataclass(frozen=True)
class Solution:
    """Balls (N, 5), lights (L, 3), board, common terms, and their uncertainty.

    The covariance of ball i is ``alone[i] + lever[i] border lever[i]^T``: `alone` (N, 5, 5) with everything shared
    known, `lever` (N, 5, B) how the ball follows the B shared unknowns, `border` (B, B) their covariance; first four of
    each light (:data:`LIGHT_TERMS`), then board, then common terms. `residual_px` (N, L, S) distance of each point to
    its edge, NaN where none; `weight` (N, L, S); `excess_px` scatter of the points beyond their own; `factor` (N,) by
    how much more than points scatter whole shadows of a ball do (variances); `relief` (N, 5) what relief of the board
    adds to the variances, part of `alone`; `iterations`.
    """

    balls: Array
    vectors: Array
    board: Board
    shifts_px: Array
    common: Array
    alone: Array
    lever: Array
    border: Array
    residual_px: Array
    weight: Array
    excess_px: float
    factor: Array
    relief: Array
    iterations: int

    @property
    def state(self) -> State:
        """Values of all unknowns."""
        return State(self.balls, self.vectors, self.shifts_px, self.board.coefficients, self.common)

    @property
    def covariance(self) -> Array:
        """(N, 5, 5) of each ball, everything included."""
        return self.alone + self.lever @ self.border @ self.lever.transpose(0, 2, 1)

    @property
    def u_light_rad(self) -> Array:
        """(L,) standard uncertainties of both axes together; NaN where a fit that ran away has no variance."""
        lights = len(self.vectors)
        variance = np.diag(self.border)[: LIGHT_TERMS * lights].reshape(lights, LIGHT_TERMS)[:, :2].sum(axis=1)
        return np.sqrt(np.where(variance >= 0, variance, np.nan))

    @property
    def u_common_light_rad(self) -> float:
        """Part of these, on either axis, that all lights share: the mean covariance of turns of two lights."""
        lights = len(self.vectors)
        blocks = self.border[: LIGHT_TERMS * lights, : LIGHT_TERMS * lights]
        shared = 0.0
        for axis in range(2):
            turns = blocks[axis::LIGHT_TERMS, axis::LIGHT_TERMS]
            shared += float(turns.sum() - np.trace(turns)) / max(lights * (lights - 1), 1)
        return float(np.sqrt(max(0.5 * shared, 0.0)))

    @property
    def board_covariance(self) -> Array:
        """(5, 5) of the coefficients of `board`."""
        part = slice(LIGHT_TERMS * len(self.vectors), LIGHT_TERMS * len(self.vectors) + SHAPE_TERMS)
        return self.border[part, part]


def angles_rad(first: Array, second: Array) -> Array:
    """(L,) angles between directions (or positions seen from the origin)."""
    cross = np.linalg.norm(np.cross(first, second), axis=1)
    angles: Array = np.arctan2(cross, (first * second).sum(axis=1))
    return angles


def solve_bundle(
    edges: Edges,
    start: State,
    near: bool,
    priors: Priors,
    *,
    redescend: float | None,
    rounds: int = MAX_ROUNDS,
) -> Solution:
    """Fit balls, lights, board and common terms to measured edge points.

    Parameters
    ----------
    edges : Edges
        Measured points.
    start : State
    near : bool
        Whether lights are positions.
    priors : Priors
    redescend : float or None
        Points this many standard deviations off count a quarter, those far off nothing (Geman & McClure 1985): relief
        of the board puts whole stretches of edge elsewhere. None for Cauchy weights, which find the way from farther
        off.
    rounds : int
        Most steps.
    """
    state = start
    known = np.isfinite(edges.u_px)
    excess, iterations = 0.0, 0
    variance = np.ones(known.shape)
    weight = np.zeros(known.shape)
    for iteration in range(1, rounds + 1):
        iterations = iteration
        model = linearise_edges(edges, state, near)
        excess = _excess(model.residual[known], edges.u_px[known])
        variance = np.where(known, edges.u_px**2 + excess**2, 1.0)
        weight = robust_weights(model.residual, variance, known, redescend)
        normal = normal_equations(model, weight, state, priors)
        table_step, border_step = _step(normal)
        state = _moved(state, table_step, border_step)
        if (
            np.abs(table_step[:, :4]).max(initial=0.0) < STEP_TOLERANCE_PX
            and np.abs(table_step[:, 4]).max(initial=0.0) < Q_TOLERANCE
        ):
            break
    model = linearise_edges(edges, state, near)
    honest = honest_weights(model.residual, variance, known, redescend)
    factor = scatter_factors(model, honest)
    normal = normal_equations(model, honest / factor[:, None, None], state, priors)
    inverse = np.linalg.inv(normal.balls)
    lever = -inverse @ normal.cross
    reduced = normal.corner + _of_all_balls(normal.cross, lever)
    relief = relief_variances(model.residual, edges.u_px, state.vectors)
    return Solution(
        state.balls,
        state.vectors,
        Board(state.board),
        state.shifts_px,
        state.common,
        inverse + relief[:, :, None] * np.eye(BALL_TERMS),
        lever,
        _inverse(reduced),
        np.where(known, model.residual, np.nan),
        np.where(known, weight * variance, 0.0),
        excess,
        factor,
        relief,
        iterations,
    )


def relief_variances(residual: Array, u_px: Array, vectors: Array) -> Array:
    """(N, 5) variances by relief of the board: heights follow it by the tangent of the lights, places by their mean.

    Heights twice: by what differs beside one ball, which residuals show, and by what all shadows of the ball have in
    common, a layer of mask under all of them, which they do not show and which is as large on the average of the part.
    """
    square = np.square(relief_px(np.where(np.isfinite(u_px), residual, np.nan)))
    rise = float(np.median(vectors[:, 2] / np.maximum(np.hypot(vectors[:, 0], vectors[:, 1]), 1e-6)))
    aside = square / (2.0 * len(vectors))
    return np.column_stack([aside, aside, 2.0 * rise**2 * square, aside, np.zeros_like(square)])


def _step(normal: NormalEquations) -> tuple[Array, Array]:
    """Steps of the balls (N, 5), within limits, and of the border (B,)."""
    inverse = np.linalg.inv(normal.balls)
    lever = inverse @ normal.cross
    reduced = normal.corner - _of_all_balls(normal.cross, lever)
    right = normal.right_border - _of_all_balls(lever, normal.right[..., None])[:, 0]
    border = _inverse(reduced) @ right
    return np.einsum("nij,nj->ni", inverse, normal.right - normal.cross @ border), border


def _of_all_balls(left: Array, right: Array) -> Array:
    """(B, C) sum over balls of ``left[i]^T right[i]``.

    Ball by ball: one product of all is small enough for one thread and large enough for BLAS to wake up all of them.
    """
    total: Array = (left.transpose(0, 2, 1) @ right).sum(axis=0)
    return total


def _inverse(matrix: Array) -> Array:
    """Inverse of a symmetric matrix whose unknowns have different units."""
    size = np.sqrt(np.maximum(np.diag(matrix), 1e-30))
    inverse: Array = np.linalg.inv(matrix / np.outer(size, size)) / np.outer(size, size)
    return inverse


def _moved(state: State, table_step: Array, border_step: Array) -> State:
    """The state after one round."""
    lights = len(state.vectors)
    limit = LARGEST_STEP * state.balls[:, 3:4]
    balls = state.balls.copy()
    balls[:, :4] += np.clip(table_step[:, :4], -limit, limit)
    balls[:, 4] = np.clip(balls[:, 4] + np.clip(table_step[:, 4], -LARGEST_Q_STEP, LARGEST_Q_STEP), MIN_Q, MAX_Q)
    of_lights = border_step[: LIGHT_TERMS * lights].reshape(lights, LIGHT_TERMS)
    shared = border_step[LIGHT_TERMS * lights :]
    return State(
        balls,
        turned(state.vectors, np.clip(of_lights[:, :2], -LARGEST_TURN_RAD, LARGEST_TURN_RAD)),
        state.shifts_px + of_lights[:, 2:],
        state.board + shared[:SHAPE_TERMS],
        state.common + shared[SHAPE_TERMS:],
    )


def robust_weights(residual: Array, variance: Array, known: NDArray[np.bool_], redescend: float | None) -> Array:
    """(N, L, S) robust weights over variances."""
    square = residual**2 / variance
    loss = 1.0 + square / CAUCHY**2 if redescend is None else (1.0 + square / redescend**2) ** 2
    return np.where(known, 1.0 / (variance * loss), 0.0)


def honest_weights(residual: Array, variance: Array, known: NDArray[np.bool_], redescend: float | None) -> Array:
    """Weights that give the covariance of the robust estimate: E[psi^2] / E[psi']^2 of Huber (1981), section 7.6.

    Points that were rejected count as little as they did in the fit.
    """
    square = np.where(known, residual**2 / variance, 0.0)
    if redescend is None:
        loss = 1.0 + square / CAUCHY**2
        weight, change = 1.0 / loss, (1.0 - square / CAUCHY**2) / loss**2
    else:
        loss = 1.0 + square / redescend**2
        weight, change = loss**-2.0, (1.0 - 3.0 * square / redescend**2) / loss**3
    if not known.any():
        return np.zeros(residual.shape)
    mean_weight = float(weight[known].mean())
    efficiency = max(float(change[known].mean()), 0.1) ** 2 / max(float((weight**2 * square)[known].mean()), 1e-9)
    honest: Array = np.where(known, weight / (mean_weight * variance), 0.0) * min(efficiency, 1.0)
    return honest


def _excess(residual: Array, u_px: Array) -> float:
    """Scatter of the points beyond their own uncertainty, px: pixel grid, relief, light from neighbours."""
    if residual.size == 0:
        return 0.0
    spread = 1.4826 * float(np.median(np.abs(residual)))
    return float(np.sqrt(max(spread**2 - float(np.median(u_px)) ** 2, 0.0)))
