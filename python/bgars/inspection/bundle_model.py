"""The rows of the bundle: distances of measured points to predicted edges, and outlines, with their derivatives."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bgars import _bgars
from bgars.inspection.board import Board
from bgars.inspection.common_terms import COMMON_TERMS, EDGE_TERMS, OUTLINE, OUTLINE_X, OUTLINE_Y, PERSPECTIVE
from bgars.inspection.shadow_map import Casters

if TYPE_CHECKING:
    from bgars.inspection.shadow_edges import Edges

__all__ = ["EdgeModel", "State", "linearise_edges", "outline_rows", "tangents", "turned"]

Array = NDArray[np.float64]
LEAST_FOOT = 0.1
"""Of the radius: a cap whose foot is smaller is none."""


class State(NamedTuple):
    """Values of all unknowns.

    Balls (N, 5) as x, y, z, radius, q; lights (L, 3); shifts of images (L, 2); board (5,); common terms
    (COMMON_TERMS,).
    """

    balls: Array
    vectors: Array
    shifts_px: Array
    board: Array
    common: Array

    def take(self, index: NDArray[np.intp]) -> State:
        """Some of the balls."""
        return self._replace(balls=self.balls[index])


class EdgeModel(NamedTuple):
    """Every measured point, (N, L, S).

    Distance to its edge; its place, the angle from the tip (rad); `rows` (..., T + 2) derivatives by ball, light, board
    and edges of all, then both of these.
    """

    residual: Array
    angle_rad: Array
    rows: Array


def tangents(vectors: Array) -> Array:
    """(L, 2, 3) changes per radian: first along the azimuth, then up."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    unit = vectors / length
    side = np.column_stack([-unit[:, 1], unit[:, 0], np.zeros(len(unit))])
    level = np.linalg.norm(side, axis=1, keepdims=True)
    side = np.where(level > 1e-6, side / np.maximum(level, 1e-6), [1.0, 0.0, 0.0])  # noqa: PLR2004 - the zenith
    up = np.column_stack(
        [-unit[:, 2] * side[:, 1], unit[:, 2] * side[:, 0], unit[:, 0] * side[:, 1] - unit[:, 1] * side[:, 0]]
    )
    changes: Array = np.stack([side, up], axis=1) * length[:, None]
    return changes


def turned(vectors: Array, turns: Array) -> Array:
    """Lights after small turns (L, 2); their length stays."""
    moved = vectors + np.einsum("lk,lkc->lc", turns, tangents(vectors))
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True) / np.linalg.norm(moved, axis=1, keepdims=True)
    scaled: Array = moved * lengths
    return scaled


def linearise_edges(edges: Edges, state: State, near: bool) -> EdgeModel:
    """Distances of measured points to predicted edges, and their derivatives.

    Method and order of the derivatives: `rust/bgars-core/src/shadows/equations.rs`.
    """
    rows = _bgars.edge_rows(
        np.ascontiguousarray(edges.x),
        np.ascontiguousarray(edges.y),
        Casters.of(state.balls, state.vectors, near, Board(state.board)),
        turns=tangents(state.vectors).reshape(-1, 6),
        shifts_px=np.ascontiguousarray(state.shifts_px),
        waves_px=state.common[list(EDGE_TERMS)].tolist(),
    )
    return EdgeModel(rows[..., -2].copy(), rows[..., -1], rows)


def outline_rows(state: State, outlines: Array) -> tuple[Array, Array, Array]:
    """(N, 3) predicted less given outlines (x, y, radius); derivatives (N, 3, 5) by ball and (N, 3, COMMON_TERMS).

    A camera at distance 1 / k sees what is z high at (1 + k z) times its place. The outline of a ball whose centre lies
    below the board is its foot, of radius ``sqrt(R^2 - (z / q)^2)``.
    """
    x, y, z, radius, q = state.balls.T
    k = state.common[PERSPECTIVE]
    depth = np.minimum(z, 0.0) / q
    foot = np.sqrt(np.maximum(radius**2 - depth**2, np.square(LEAST_FOOT * radius)))
    size = 1.0 + k * np.maximum(z, 0.0)
    aside = state.common[[OUTLINE_X, OUTLINE_Y, OUTLINE]]
    seen = np.column_stack([x * size, y * size, foot * size]) + aside
    by_ball = np.zeros((len(x), 3, 5))
    by_ball[:, 0, 0] = by_ball[:, 1, 1] = size
    above = np.where(z > 0, k, 0.0)
    by_ball[:, 0, 2], by_ball[:, 1, 2] = x * above, y * above
    by_ball[:, 2, 2] = foot * above - depth / (q * foot)
    by_ball[:, 2, 3] = radius / foot
    by_ball[:, 2, 4] = depth**2 / (q * foot)
    by_common = np.zeros((len(x), 3, COMMON_TERMS))
    high = np.maximum(z, 0.0)
    by_common[:, 0, PERSPECTIVE], by_common[:, 1, PERSPECTIVE] = x * high, y * high
    by_common[:, 2, PERSPECTIVE] = foot * high
    for row, term in enumerate((OUTLINE_X, OUTLINE_Y, OUTLINE)):
        by_common[:, row, term] = 1.0
    return seen - outlines, by_ball, by_common
