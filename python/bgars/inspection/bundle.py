"""All balls, all lights and the board from measured points of shadow edges: robust Gauss-Newton with Schur complement.

Unknowns: of each ball x, y, z, radius, q; of each light two small turns; five coefficients of the board. Balls meet
only
through lights and board, so the normal matrix is an arrow: blocks of 5 x 5, a border of 2 L + 5 (Triggs et al., "Bundle
adjustment - a modern synthesis", 2000, section 6.1).

Gaussian priors: the lights stand as the rig says, the board is nearly flat, balls are where their silhouettes are, q
is 1.
Heights, elevations and q trade against each other (with all q raised and all lights lowered the shadows stay the same),
and a population of solder balls is round on the whole; which balls are not, the caller decides (`population`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bgars.inspection.board import SHAPE_TERMS, Board
from bgars.inspection.shadow_model import (
    BALL_TERMS,
    Balls,
    Lights,
    ball_derivatives,
    board_derivatives,
    light_derivatives,
    rays,
)

if TYPE_CHECKING:
    from bgars.inspection.shadow_edges import Edges

__all__ = ["Priors", "Solution", "angles_rad", "solve_bundle"]

Array = NDArray[np.float64]

MAX_ROUNDS = 30
STEP_TOLERANCE_PX = 1e-4
Q_TOLERANCE = 1e-5
CAUCHY = 2.5
MIN_Q, MAX_Q = 0.2, 2.0


class Priors(NamedTuple):
    """Where unknowns are expected: values and standard deviations.

    `balls` (N, 5) values and `u_balls` (N, 5) deviations (inf = free);
    `vectors` (L, 3) the rig's, `u_light_rad`; `board` (5,) and `u_board` (5,).
    """

    balls: Array
    u_balls: Array
    vectors: Array
    u_light_rad: float
    board: Array
    u_board: Array


@dataclass(frozen=True)
class Solution:
    """Balls (N, 5), lights (L, 3), board and what is known of their uncertainty.

    `covariance` (N, 5, 5) of each ball, lights and board included; `u_light_rad` (L,); `residual_px` (N, L, S) distance
    of each point to its edge, NaN where none; `weight` (N, L, S); `iterations`; `board_covariance` (5, 5) of the
    coefficients of `board`; `common_covariance` (5, 5), a part of `covariance`: by how much lights and board put all
    balls off together.
    """

    balls: Array
    vectors: Array
    board: Board
    covariance: Array
    u_light_rad: Array
    residual_px: Array
    weight: Array
    excess_px: float
    iterations: int
    board_covariance: Array
    common_covariance: Array
    edge_response: Array
    flank_response: Array


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


def angles_rad(first: Array, second: Array) -> Array:
    """(L,) angles between directions (or positions seen from the origin)."""
    cross = np.linalg.norm(np.cross(first, second), axis=1)
    angles: Array = np.arctan2(cross, (first * second).sum(axis=1))
    return angles


def solve_bundle(
    edges: Edges,
    start: Array,
    vectors: Array,
    near: bool,
    board: Board,
    priors: Priors,
    *,
    redescend: float | None,
    rounds: int = MAX_ROUNDS,
) -> Solution:
    """Fit balls, lights and board to measured edge points.

    Parameters
    ----------
    edges : Edges
        Measured points.
    start : (N, 5) float64
    vectors : (L, 3) float64
    near : bool
    board : Board
    priors : Priors
    redescend : float or None
        Points this many standard deviations off count a quarter, those far off nothing (Geman & McClure 1985): relief
        of
        the board puts whole stretches of edge elsewhere. None for Cauchy weights, which find the way from farther off.
    rounds : int
        Most steps.
    """
    table, vectors, coefficients = start.copy(), vectors.copy(), board.coefficients.copy()
    lights = edges.x.shape[1]
    excess = 0.0
    iterations = 0
    for iteration in range(1, rounds + 1):
        iterations = iteration
        board = Board(coefficients)
        residual, derivatives = _linearise(edges, table, vectors, near, board)
        known = np.isfinite(edges.u_px)
        excess = _excess(residual[known], edges.u_px[known])
        variance = np.where(known, edges.u_px**2 + excess**2, 1.0)
        if redescend is None:
            loss = 1.0 + residual**2 / (CAUCHY**2 * variance)
        else:
            loss = (1.0 + residual**2 / (redescend**2 * variance)) ** 2
        weight = np.where(known, 1.0 / (variance * loss), 0.0)
        normal, cross, corner, right, right_border = _normal(
            derivatives, residual, weight, table, vectors, coefficients, priors
        )
        inverse = np.linalg.inv(normal)
        lever = inverse @ cross
        reduced = corner - np.tensordot(cross, lever, axes=((0, 1), (0, 1)))
        step_border = np.linalg.solve(reduced, right_border - np.tensordot(lever, right, axes=((0, 1), (0, 1))))
        step = np.einsum("nij,nj->ni", inverse, right - cross @ step_border)
        limit = 0.3 * table[:, 3]
        step[:, :4] = np.clip(step[:, :4], -limit[:, None], limit[:, None])
        step[:, 4] = np.clip(step[:, 4], -0.15, 0.15)
        table = table + step
        table[:, 4] = np.clip(table[:, 4], MIN_Q, MAX_Q)
        vectors = turned(vectors, np.clip(step_border[: 2 * lights].reshape(lights, 2), -0.1, 0.1))
        coefficients = coefficients + step_border[2 * lights :]
        if (
            np.abs(step[:, :4]).max(initial=0.0) < STEP_TOLERANCE_PX
            and np.abs(step[:, 4]).max(initial=0.0) < Q_TOLERANCE
        ):
            break
    board = Board(coefficients)
    residual, derivatives = _linearise(edges, table, vectors, near, board)
    honest = _honest_weights(residual, variance, known, redescend)
    at = (honest, table, vectors, coefficients, priors)
    normal, cross, corner, *_ = _normal(derivatives, residual, *at)
    inverse = np.linalg.inv(normal)
    lever = inverse @ cross
    border_covariance = np.linalg.inv(corner - np.tensordot(cross, lever, axes=((0, 1), (0, 1))))
    *_, by_priors, border_by_priors = _normal(derivatives, np.zeros_like(residual), *at)

    def response(shift_px: Array) -> Array:
        """(N, 5) change of the balls when measured points lie so much farther out: linear, priors as they are."""
        *_, right, right_border = _normal(derivatives, shift_px, *at)
        right, right_border = right - by_priors, right_border - border_by_priors
        turn = border_covariance @ (right_border - np.tensordot(lever, right, axes=((0, 1), (0, 1))))
        changed: Array = np.einsum("nij,nj->ni", inverse, right - cross @ turn)
        return changed

    covariance = inverse + lever @ border_covariance @ lever.transpose(0, 2, 1)
    mean_lever = lever.mean(axis=0)
    board_covariance: Array = border_covariance[2 * lights :, 2 * lights :].astype(np.float64)
    u_light = _u_lights(border_covariance.astype(np.float64), lights)
    return Solution(
        table,
        vectors,
        board,
        covariance,
        u_light,
        np.where(known, residual, np.nan),
        np.where(known, weight * variance, 0.0),
        excess,
        iterations,
        board_covariance,
        mean_lever @ border_covariance @ mean_lever.T,
        response(np.ones_like(residual)),
        response(_flanks(edges, table, vectors, near, board)),
    )


def _u_lights(border_covariance: Array, lights: int) -> Array:
    """(L,) standard uncertainties of both axes together; NaN where a fit that ran away has no variance."""
    variance = np.diag(border_covariance)[: 2 * lights].reshape(lights, 2).sum(axis=1)
    u_light: Array = np.sqrt(np.where(variance >= 0, variance, np.nan))
    return u_light


def _flanks(edges: Edges, table: Array, vectors: Array, near: bool, board: Board) -> Array:
    """(N, L, S) 1 where the edge of a shadow runs at 45 degrees to its light, 0 at tips and sides."""
    beam = rays(
        edges.x, edges.y, Balls.from_table(table).spread(2), Lights.from_table(vectors, near).spread(1, 1), board
    )
    level = np.maximum(np.hypot(beam.toward_x, beam.toward_y), 1e-9)
    cosine = (beam.toward_x * beam.gradient_x + beam.toward_y * beam.gradient_y) / (
        level * np.maximum(beam.slope, 1e-3)
    )
    tips = np.square(cosine)
    flanks: Array = 4.0 * tips * (1.0 - tips)
    return flanks


def _honest_weights(residual: Array, variance: Array, known: NDArray[np.bool_], redescend: float | None) -> Array:
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


def _linearise(edges: Edges, table: Array, vectors: Array, near: bool, board: Board) -> tuple[Array, Array]:
    """Distance (N, L, S) of every point to its predicted edge; derivatives (N, L, S, 12) by ball, light and board."""
    balls = Balls.from_table(table).spread(2)
    lamps = Lights.from_table(vectors, near).spread(1, 1)
    beam = rays(edges.x, edges.y, balls, lamps, board)
    slope = np.maximum(beam.slope, 1e-3)
    ways = tangents(vectors)
    by_light = light_derivatives(beam, balls, (ways[None, :, None, 0], ways[None, :, None, 1]))
    by_ball = ball_derivatives(beam, balls, board)
    by_board = board_derivatives(edges.x, edges.y, beam, balls)
    derivatives = np.concatenate([by_ball, by_light, by_board], axis=-1) / slope[..., None]
    return (beam.distance - balls.radius) / slope, derivatives


def _normal(
    derivatives: Array,
    residual: Array,
    weight: Array,
    table: Array,
    vectors: Array,
    coefficients: Array,
    priors: Priors,
) -> tuple[Array, Array, Array, Array, Array]:
    """Blocks of the normal equations: (N, 5, 5), (N, 5, B), (B, B), and their right sides; priors in."""
    count, lights = residual.shape[:2]
    border = 2 * lights + SHAPE_TERMS
    weighted = (derivatives * weight[..., None]).swapaxes(-1, -2)
    shadows = weighted @ derivatives  # of every shadow, (N, L, 12, 12)
    sides = -(weighted @ residual[..., None])[..., 0]
    ball, lamp, shape = slice(BALL_TERMS), slice(BALL_TERMS, BALL_TERMS + 2), slice(BALL_TERMS + 2, None)
    of_balls, of_lights = shadows[:, :, ball].sum(axis=1), shadows.sum(axis=0)
    normal, right = of_balls[:, :, ball], sides[:, :, ball].sum(axis=1)
    by_light = shadows[:, :, ball, lamp].swapaxes(1, 2).reshape(count, BALL_TERMS, 2 * lights)
    cross = np.concatenate([by_light, of_balls[:, :, shape]], axis=2)
    corner = np.zeros((border, border))
    for light in range(lights):
        part = slice(2 * light, 2 * light + 2)
        corner[part, part] = of_lights[light, lamp, lamp]
        corner[part, 2 * lights :] = of_lights[light, lamp, shape]
        corner[2 * lights :, part] = of_lights[light, shape, lamp]
    corner[2 * lights :, 2 * lights :] = of_lights[:, shape, shape].sum(axis=0)
    border_sides = sides.sum(axis=0)
    right_border = np.concatenate([border_sides[:, lamp].reshape(-1), border_sides[:, shape].sum(axis=0)])

    off = priors.balls - table
    pull = 1.0 / priors.u_balls**2
    normal[:, range(5), range(5)] += pull + 1e-9
    right += pull * off
    ways = tangents(vectors)
    length = np.linalg.norm(vectors, axis=1)
    away = np.einsum("lc,lkc->lk", priors.vectors - vectors, ways) / np.square(length)[:, None]
    corner[range(border), range(border)] += np.concatenate(
        [np.full(2 * lights, priors.u_light_rad**-2.0), priors.u_board**-2.0]
    )
    right_border[: 2 * lights] += away.reshape(-1) / priors.u_light_rad**2
    right_border[2 * lights :] += (priors.board - coefficients) / priors.u_board**2
    return normal, cross, corner, right, right_border
