"""The normal equations of the bundle: edge points and priors, in the blocks of an arrow."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bgars import _bgars
from bgars.inspection.board import SHAPE_TERMS
from bgars.inspection.bundle_model import EdgeModel, State, outline_rows, tangents
from bgars.inspection.common_terms import AZIMUTH, COMMON_TERMS, EDGE_TERMS, ELEVATION, ROUNDNESS
from bgars.inspection.shadow_model import BALL_TERMS

__all__ = ["LIGHT_TERMS", "NormalEquations", "Priors", "normal_equations"]

Array = NDArray[np.float64]
LIGHT_TERMS = 4
"""Turn along the azimuth, turn up, shift of the image along x and y."""
SHARED_TERMS = SHAPE_TERMS + COMMON_TERMS


class Priors(NamedTuple):
    """Where unknowns are expected: values and standard deviations.

    `outlines` (N, 3) x, y, radius as the camera sees them, and `u_outlines` of each alone; `u_q` (N,) of each ball's
    q around that of all; `vectors` (L, 3) the rig's, `u_light_rad` (L,) of each light around what all are turned by;
    `shifts_px` (L, 2) and `u_shifts_px` of the images; `board` (5,) and `u_board`; `common` (COMMON_TERMS,) and
    `u_common`.
    """

    outlines: Array
    u_outlines: Array
    u_q: Array
    vectors: Array
    u_light_rad: Array
    shifts_px: Array
    u_shifts_px: Array
    board: Array
    u_board: Array
    common: Array
    u_common: Array

    def of_balls(self, index: NDArray[np.intp]) -> Priors:
        """Priors of some of the balls."""
        return self._replace(outlines=self.outlines[index], u_outlines=self.u_outlines[index], u_q=self.u_q[index])


class NormalEquations(NamedTuple):
    """Blocks of the normal equations and their right sides: balls (N, 5, 5), cross (N, 5, B), corner (B, B)."""

    balls: Array
    cross: Array
    corner: Array
    right: Array
    right_border: Array


def normal_equations(
    model: EdgeModel, weight: Array, state: State, priors: Priors, by_shape: Array | None = None
) -> NormalEquations:
    """Normal equations of edge points and priors.

    `by_shape` (N, L, S, K) are derivatives by K more terms of each ball, which have no prior here.
    """
    count, lights = model.residual.shape[:2]
    first_shared = LIGHT_TERMS * lights
    border = first_shared + SHARED_TERMS
    # Of every shadow, (N, L, T + 1, T + 1).
    products = _bgars.edge_products(model.rows, weight) if by_shape is None else _products(model, weight, by_shape)
    terms = BALL_TERMS + (0 if by_shape is None else by_shape.shape[-1])
    ball, lamp = slice(terms), slice(terms, terms + LIGHT_TERMS)
    shared = slice(terms + LIGHT_TERMS, -1)
    # Of what is shared, edges know the board and how far out all of them are measured.
    at = first_shared + np.concatenate([np.arange(SHAPE_TERMS), SHAPE_TERMS + np.array(EDGE_TERMS)])
    of_balls, of_lights = products.sum(axis=1), products.sum(axis=0)
    cross = np.zeros((count, terms, border))
    cross[..., :first_shared] = products[:, :, ball, lamp].swapaxes(1, 2).reshape(count, terms, first_shared)
    cross[..., at] = of_balls[:, ball, shared]
    corner, right_border = np.zeros((border, border)), np.zeros(border)
    for light in range(lights):
        part = slice(LIGHT_TERMS * light, LIGHT_TERMS * (light + 1))
        corner[part, part] = of_lights[light, lamp, lamp]
        corner[part, at] = of_lights[light, lamp, shared]
        corner[at, part] = of_lights[light, shared, lamp]
        right_border[part] = -of_lights[light, lamp, -1]
    corner[np.ix_(at, at)] = of_lights[:, shared, shared].sum(axis=0)
    right_border[at] = -of_lights[:, shared, -1].sum(axis=0)
    normal = NormalEquations(of_balls[:, ball, ball], cross, corner, -of_balls[:, ball, -1], right_border)
    _add_ball_priors(normal, state, priors)
    _add_light_priors(normal, state, priors)
    return normal


def _products(model: EdgeModel, weight: Array, by_shape: Array) -> Array:
    """Weighted products of derivatives and distance, summed over the points of every shadow."""
    rows = [model.rows[..., :BALL_TERMS], by_shape, model.rows[..., BALL_TERMS:-2], model.residual[..., None]]
    seen = np.where(weight[..., None] > 0, np.concatenate(rows, axis=-1), 0.0)
    products: Array = (seen * weight[..., None]).swapaxes(-1, -2) @ seen
    return products


def _add_ball_priors(normal: NormalEquations, state: State, priors: Priors) -> None:
    """Outlines, heights somewhere near the radius, and q around that of all balls."""
    first = normal.corner.shape[0] - COMMON_TERMS
    residual, by_ball, by_common = outline_rows(state, priors.outlines)
    weight = priors.u_outlines**-2.0
    normal.balls[:, :BALL_TERMS, :BALL_TERMS] += np.einsum("nki,nk,nkj->nij", by_ball, weight, by_ball)
    normal.right[:, :BALL_TERMS] -= np.einsum("nki,nk,nk->ni", by_ball, weight, residual)
    normal.cross[:, :BALL_TERMS, first:] += np.einsum("nki,nk,nkj->nij", by_ball, weight, by_common)
    normal.corner[first:, first:] += np.einsum("nki,nk,nkj->ij", by_common, weight, by_common)
    normal.right_border[first:] -= np.einsum("nki,nk,nk->i", by_common, weight, residual)
    pull = 1.0 / priors.outlines[:, 2] ** 2
    normal.balls[:, 2, 2] += pull
    normal.right[:, 2] -= pull * state.balls[:, 2]
    pull = priors.u_q**-2.0
    off = state.balls[:, 4] - 1.0 - state.common[ROUNDNESS]
    normal.balls[:, 4, 4] += pull
    normal.right[:, 4] -= pull * off
    normal.cross[:, 4, first + ROUNDNESS] -= pull
    normal.corner[first + ROUNDNESS, first + ROUNDNESS] += pull.sum()
    normal.right_border[first + ROUNDNESS] += (pull * off).sum()
    normal.balls[:, range(BALL_TERMS), range(BALL_TERMS)] += 1e-9


def _add_light_priors(normal: NormalEquations, state: State, priors: Priors) -> None:
    """Each light around what all are turned by, shifts of images, board, common terms."""
    lights = len(state.vectors)
    corner, right = normal.corner, normal.right_border
    first = len(right) - COMMON_TERMS
    ways = tangents(state.vectors)
    length = np.linalg.norm(state.vectors, axis=1)
    turn = np.einsum("lc,lkc->lk", state.vectors - priors.vectors, ways) / np.square(length)[:, None]
    for axis, term in ((0, AZIMUTH), (1, ELEVATION)):
        own = LIGHT_TERMS * np.arange(lights) + axis
        pull = priors.u_light_rad**-2.0
        off = turn[:, axis] - state.common[term]
        corner[own, own] += pull
        corner[own, first + term] -= pull
        corner[first + term, own] -= pull
        corner[first + term, first + term] += pull.sum()
        right[own] -= pull * off
        right[first + term] += (pull * off).sum()
        own = LIGHT_TERMS * np.arange(lights) + 2 + axis
        pull = priors.u_shifts_px[:, axis] ** -2.0
        corner[own, own] += pull
        right[own] += pull * (priors.shifts_px - state.shifts_px)[:, axis]
    shared = np.arange(LIGHT_TERMS * lights, len(right))
    pull = np.concatenate([priors.u_board, priors.u_common]) ** -2.0
    corner[shared, shared] += pull
    right[shared] += pull * np.concatenate([priors.board - state.board, priors.common - state.common])
