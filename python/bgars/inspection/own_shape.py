"""Balls that are no upright spheroids: tilted and oval ones, whose shape is freed where their shadows ask for it.

To first order an ellipsoid is a sphere plus ``R n^T E n`` along its normal n, with E symmetric. Two of its six numbers
are the radius and q; two are tilts, ``2 n_x n_z`` and ``2 n_y n_z``, two are ovalities, ``n_x^2 - n_y^2`` and
``2 n_x n_y``. A tilted ball throws nearly the shadows of an upright one that stands aside, so that it has small
residuals and a wrong place. With everything else held, the score test of Rao (1948) has the four numbers that a ball
would have, and their covariance, without a fit; a ball whose numbers are far from those of the others gets its own,
and one whose q is odd does so sooner: what is not round in one way is seldom so in that way alone.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bgars.inspection.bundle import honest_weights, relief_variances, robust_weights
from bgars.inspection.bundle_model import EdgeModel, State, linearise_edges
from bgars.inspection.bundle_normal import Priors, normal_equations
from bgars.inspection.misfit import scatter_factors
from bgars.inspection.population import FREE, LIMITS, MEDIAN_CHI_SQUARE, MIN_POPULATION
from bgars.inspection.shadow_model import BALL_TERMS

if TYPE_CHECKING:
    from bgars.inspection.bundle import Solution
    from bgars.inspection.bundle_normal import NormalEquations
    from bgars.inspection.shadow_edges import Edges

__all__ = ["free_shapes"]

Array = NDArray[np.float64]

OWN_TERMS = 4
"""Two tilts and two ovalities."""
Z, RADIUS, Q = 2, 3, 4
"""Places of a ball's terms."""
UNLIKE = 20.0
"""Squared distance from the usual shape, in standard deviations, of a ball with one of its own: of balls that are like
the others one in 2,000 lies farther off (chi-square of four)."""
UNLIKE_OF_ODD = 7.8
"""The same of a ball whose q is odd, or may be: of upright ones one in ten lies farther off."""
NO_ELLIPSOID = 0.25
"""Share of what a ball deviates from a spheroid by which it deviates from an ellipsoid, too, in place and sizes."""
ROUNDS = 8
LARGEST_STEP = 0.1
"""Of a round, in radii, and of q."""


class _Fitted(NamedTuple):
    """Balls with shapes of their own (n, OWN_TERMS), the priors they were fitted by, the shapes' deviations (n, 1)."""

    state: State
    shape_px: Array
    priors: Priors
    u_shape_px: Array


def free_shapes(
    solution: Solution, edges: Edges, priors: Priors, near: bool, redescend: float
) -> tuple[Solution, NDArray[np.bool_]]:
    """Fit balls that are unlike the others again, each with tilt and ovality of its own; what is shared stays.

    These are balls whose tilt and ovality are far from those of the others; less far where q may be (`priors.u_q`).

    Parameters
    ----------
    solution : Solution
    edges : Edges
        What it was fitted to.
    priors : Priors
        Of the same balls.
    near : bool
        Whether lights are positions.
    redescend : float
        As in :func:`bgars.inspection.bundle.solve_bundle`.

    Returns
    -------
    Solution
    (N,) bool
        Which balls these are; their q is as free as their shape.
    """
    known = np.isfinite(edges.u_px)
    variance = np.where(known, edges.u_px**2 + solution.excess_px**2, 1.0)
    odd = _unlike(solution, edges, priors, near, np.where(known, solution.weight / variance, 0.0))
    if not odd.any():
        return solution, odd
    own = _fitted(solution.state, edges, priors, odd, variance, near, redescend)
    if not np.isfinite(own.state.balls).all():
        return solution, np.zeros_like(odd)
    balls, shape = solution.balls.copy(), np.zeros((len(odd), OWN_TERMS))
    balls[odd], shape[odd] = own.state.balls, own.shape_px
    solution = replace(solution, balls=balls)
    model, by_shape = _with_shape(linearise_edges(edges, solution.state, near), balls[:, Q], shape)
    honest = honest_weights(model.residual, variance, known, redescend)
    factor = scatter_factors(model, honest)
    weight = (honest / factor[:, None, None])[odd]
    normal = _normal(EdgeModel(*(part[odd] for part in model)), weight, own, by_shape[odd])
    inverse = np.linalg.inv(normal.balls)
    relief = relief_variances(model.residual, edges.u_px, solution.vectors)[odd]
    left_out = np.square(NO_ELLIPSOID) * np.square(own.shape_px).sum(axis=1)
    own_variance = relief + left_out[:, None] * (np.arange(BALL_TERMS) != Q)
    alone = inverse[:, :BALL_TERMS, :BALL_TERMS] + own_variance[:, :, None] * np.eye(BALL_TERMS)
    robust = robust_weights(model.residual, variance, known, redescend) * variance
    changed = replace(
        solution,
        alone=_put(solution.alone, odd, alone),
        lever=_put(solution.lever, odd, -(inverse @ normal.cross)[:, :BALL_TERMS]),
        residual_px=_put(solution.residual_px, odd, np.where(known, model.residual, np.nan)[odd]),
        weight=_put(solution.weight, odd, robust[odd]),
        factor=_put(solution.factor, odd, factor[odd]),
        relief=_put(solution.relief, odd, relief),
    )
    return changed, odd


def _put(everyone: Array, odd: NDArray[np.bool_], part: Array) -> Array:
    """Some rows replaced."""
    changed = everyone.copy()
    changed[odd] = part
    return changed


def _unlike(solution: Solution, edges: Edges, priors: Priors, near: bool, weight: Array) -> NDArray[np.bool_]:
    """(N,) balls whose tilt and ovality, by the score test, are far from those of the others."""
    count = len(solution.balls)
    if count < MIN_POPULATION:
        return np.zeros(count, dtype=np.bool_)
    none = np.zeros((count, OWN_TERMS))
    model, by_shape = _with_shape(linearise_edges(edges, solution.state, near), solution.balls[:, Q], none)
    usual = max(float(np.median(solution.factor)), 1.0)
    at_rest = _Fitted(solution.state, none, priors, FREE * priors.outlines[:, 2:])
    normal = _normal(model, weight / usual, at_rest, by_shape)
    own, cross = normal.balls[:, :BALL_TERMS, :BALL_TERMS], normal.balls[:, :BALL_TERMS, BALL_TERMS:]
    taken = cross.swapaxes(1, 2) @ np.linalg.inv(own)
    covariance = np.linalg.inv(normal.balls[:, BALL_TERMS:, BALL_TERMS:] - taken @ cross)
    score = normal.right[:, BALL_TERMS:, None] - taken @ normal.right[:, :BALL_TERMS, None]
    shape = (covariance @ score)[..., 0]
    off = shape - np.median(shape, axis=0)
    single = np.einsum("nii->ni", covariance)
    excess = float(np.median(np.square(off) - MEDIAN_CHI_SQUARE * single)) / MEDIAN_CHI_SQUARE
    total = covariance + max(excess, 0.0) * np.eye(OWN_TERMS)
    distance = np.einsum("ni,ni->n", off, np.linalg.solve(total, off[..., None])[..., 0])
    unlike: NDArray[np.bool_] = distance > np.where(priors.u_q > LIMITS[1], UNLIKE_OF_ODD, UNLIKE)
    return unlike


def _fitted(
    state: State,
    edges: Edges,
    priors: Priors,
    odd: NDArray[np.bool_],
    variance: Array,
    near: bool,
    redescend: float,
) -> _Fitted:
    """Gauss-Newton of the odd balls alone."""
    index = np.flatnonzero(odd)
    state, edges, variance, priors = state.take(index), edges.take(odd), variance[odd], priors.of_balls(index)
    priors = priors._replace(u_q=np.full(len(index), FREE))
    radius, u_outlines = priors.outlines[:, 2:], priors.u_outlines
    limit = LARGEST_STEP * np.where(np.arange(BALL_TERMS + OWN_TERMS) == Q, 1.0, radius)
    own = _Fitted(state, np.zeros((len(index), OWN_TERMS)), priors, FREE * radius)
    for turn in range(ROUNDS):
        # A circle that was fitted to what is none is off by about as much.
        aside = np.linalg.norm(own.shape_px, axis=1)[:, None]
        own = own._replace(priors=priors._replace(u_outlines=np.hypot(u_outlines, aside)))
        model, by_shape = _with_shape(linearise_edges(edges, own.state, near), own.state.balls[:, Q], own.shape_px)
        # At first with weights that find the way from farther off.
        scale = redescend if turn >= ROUNDS // 2 else None
        weight = robust_weights(model.residual, variance, np.isfinite(edges.u_px), scale)
        normal = _normal(model, weight, own, by_shape)
        step = np.clip(np.linalg.solve(normal.balls, normal.right[..., None])[..., 0], -limit, limit)
        moved = own.state._replace(balls=own.state.balls + step[:, :BALL_TERMS])
        own = own._replace(state=moved, shape_px=own.shape_px + step[:, BALL_TERMS:])
    return own


def _with_shape(model: EdgeModel, q: Array, shape: Array) -> tuple[EdgeModel, Array]:
    """Distances to the edges of shaped balls; derivatives (N, L, S, OWN_TERMS) by tilts and ovalities, px.

    The derivatives by place and radius show the normal of the ball where it throws the edge.
    """
    outward = np.where(model.rows[..., RADIUS] < 0, model.rows[..., RADIUS], -1.0)
    x, y = model.rows[..., 0] / outward, model.rows[..., 1] / outward
    z = q[:, None, None] * model.rows[..., Z] / outward
    by_shape = outward[..., None] * np.stack([2.0 * x * z, 2.0 * y * z, x * x - y * y, 2.0 * x * y], axis=-1)
    moved = model.residual + np.einsum("nlsk,nk->nls", by_shape, shape)
    return model._replace(residual=moved), by_shape


def _normal(model: EdgeModel, weight: Array, own: _Fitted, by_shape: Array) -> NormalEquations:
    """Normal equations of balls and their shapes, with the shapes' prior."""
    normal = normal_equations(model, weight, own.state, own.priors, by_shape)
    at = range(BALL_TERMS, BALL_TERMS + OWN_TERMS)
    normal.balls[:, at, at] += own.u_shape_px**-2.0
    normal.right[:, BALL_TERMS:] -= own.shape_px / own.u_shape_px**2
    return normal
