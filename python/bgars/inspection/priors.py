"""What is known before the fit: circles of the finder, the rig, a nearly flat board, and what all of them share."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bgars.inspection.board import SHAPE_TERMS, board_from_normals, outside_balls
from bgars.inspection.bundle import Priors, Solution
from bgars.inspection.bundle_model import outline_rows, tangents
from bgars.inspection.common_terms import (
    AZIMUTH,
    COMMON_TERMS,
    EDGE,
    EDGE_TERMS,
    ELEVATION,
    OUTLINE,
    OUTLINE_X,
    OUTLINE_Y,
    PERSPECTIVE,
    ROUNDNESS,
    Mixture,
)
from bgars.inspection.image_shifts import SHIFT_SIGMAS
from bgars.inspection.population import q_spread

if TYPE_CHECKING:
    from bgars.inspection.image_shifts import ImageShifts
    from bgars.inspection.problem import Problem
    from bgars.records.normal_field import NormalField

__all__ = ["COARSE_SPREAD_PX", "common_mixtures", "first_priors", "refined_priors", "with_edges", "with_shifts"]

Array = NDArray[np.float64]

RIG_DEG = 0.3
"""Lights may be this far from where the rig says (standard deviation of each axis), before their scatter says more."""
CERTAIN_RIG_DEG = 1e-4
"""Lights that the fit must leave where the rig says."""
RIG_LIMITS_DEG = (0.003, 2.0)
"""Bounds of the scatter of lights around what all are turned by."""
FIRST_Q_SPREAD = 0.02
"""Scatter of q from ball to ball before anything was measured."""
TILT = 0.003
"""Prior standard deviation of the tilt of the board against the image plane."""
BOW_SLOPE = 0.02
"""Prior standard deviation of the slope by bow at the edge of the image."""
STEEPEST_BOARD = 0.05
"""Slope by tilt or bow: where the normals of the board show a steeper one, too few of them are good."""
TOGETHER_DEG = Mixture(0.05, 1.5, 0.1)
"""Elevation of all lights together: a ring that was squared to the board; one that was not, in one set-up of ten."""
ROUND = Mixture(0.001, 0.05, 0.1)
"""q - 1 of all balls together: surface tension keeps reflowed spheres of 0.3 to 0.7 mm round to a part in a thousand
above their equator (Bond number 0.003 to 0.02); coined or sagged lots are not, one in ten."""
CAMERA_MM = Mixture(1.0 / 3000.0, 1.0 / 40.0, 0.2)
"""Inverse distance of the camera: telecentric lenses are so to a fraction of a degree, others stand at 20 to 300 mm."""
EDGE_SHARE, BEND_SHARE, EXCESS_SHARE = 0.01, 0.25, 0.15
"""Edges too far out or in, shares of their spread, of its square times their curvature, and of what points scatter
beyond their own: what penumbra, reflected light and a board that light enters leave of the model. Drawn and rendered
edges of 0.5 px agree with it to 0.004 px; what a wide lamp shifts an edge by is known to half of its own size, for how
its light is shared out over it is not known (parts as fine as 5 x 5 instead of 5 x 3 move tops by 0.1 to 1 px); where
points scatter, some of it is alike on all balls."""
LEAST_EDGE_PX = 0.006
"""Sharper edges are known no better than those of 0.6 px: pixels are not alike over their area."""
EDGE_WAVES = (1.0, 1.0, 0.3, 0.3)
"""Shares of spread and scatter by all edges together, and by cos a, cos 2a, cos 3a along them; bends have their own."""
COARSE_SPREAD_PX = 2.0
"""What coarse edges are as good as."""
WIDE_EDGE_PX, WIDE_EDGE_SHARE = 0.3, 0.05
"""All edges of a camera whose response is not linear as declared."""
RAISED_DEG = 0.5
"""Elevation of all lights together while the fit finds its way; in the end its mixture counts."""
SWING_DEG = 1.5
"""Azimuth of all lights together: turns the part's picture of the rig, and moves no height."""
SHIFT_PX = 0.015
"""Images of a rig that stands still; a shift that is seen is taken from them, and known no better."""
ASIDE_PX = 0.015
"""All outlines together aside: lights of a ring cancel what shading does to a rim, but for their differences."""
OUTLIER_SIGMAS = 3.0
"""A light or an outline that lies farther off gets a standard deviation that puts it there."""
KNOWN_BY_SHADOWS = 1e-3
"""Share of what is known of an outline that shadows are taken to say at least, against rounding."""
LEAST_OUTLINE_PX = 0.02
"""Least scatter of the radii of outlines from ball to ball."""
MAD_TO_SIGMA = 1.4826
MAD_NOISE = 1.65
"""Relative noise of a variance by the median of absolute deviations, over that by the mean square (efficiency 37 %)."""
MEDIAN_OF_CHI_SQUARE = 0.693
"""Median of the mean of two squared standard normal variables."""


def first_priors(problem: Problem, table: Array, field: NormalField | None, refine_lights: bool) -> Priors:
    """Priors before anything was measured."""
    radiance = problem.radiance
    half = max(radiance.height, radiance.width) / 2.0
    u_board = np.array([TILT, TILT, BOW_SLOPE / half, BOW_SLOPE / half, BOW_SLOPE / half])
    board = np.zeros(SHAPE_TERMS)
    if field is not None:
        fitted = board_from_normals(field, outside_balls(radiance.height, radiance.width, table))
        if fitted is not None:
            # Where few normals are good, the quadratic is anything: a board that steep is none.
            steepest = np.abs(fitted) * [1.0, 1.0, 2.0 * half, half, 2.0 * half]
            # Its tilt is that of wrong lights, too; its bow is the board's.
            board[2:] = fitted[2:] if steepest.max() < STEEPEST_BOARD else 0.0
    lights = len(problem.vectors)
    rig_deg = np.full(lights, RIG_DEG) if problem.u_rig_deg is None else problem.u_rig_deg
    u_common = np.zeros(COMMON_TERMS)
    u_common[[ELEVATION, AZIMUTH]] = np.radians(SWING_DEG)
    if problem.u_rig_deg is not None:
        u_common[[ELEVATION, AZIMUTH]] = np.radians(float(np.median(problem.u_rig_deg)))
    if not refine_lights:
        rig_deg = np.full(lights, CERTAIN_RIG_DEG)
        u_common[[ELEVATION, AZIMUTH]] = np.radians(CERTAIN_RIG_DEG)
    common = np.zeros(COMMON_TERMS)
    common[ROUNDNESS] = problem.q - 1.0
    u_common[ROUNDNESS] = problem.u_q or ROUND.narrow
    common[PERSPECTIVE], u_common[PERSPECTIVE] = _perspective(problem)
    u_common[list(EDGE_TERMS)] = COARSE_SPREAD_PX * EDGE_SHARE * np.array(EDGE_WAVES)
    u_common[OUTLINE] = float(np.median(problem.u_radius))
    u_common[[OUTLINE_X, OUTLINE_Y]] = ASIDE_PX
    return Priors(
        problem.table[:, [0, 1, 3]].copy(),
        np.column_stack([problem.u_centre, problem.u_centre, problem.u_radius]),
        np.full(len(table), FIRST_Q_SPREAD),
        problem.vectors.copy(),
        np.radians(rig_deg),
        np.zeros((lights, 2)),
        np.full((lights, 2), SHIFT_PX),
        board,
        u_board,
        common,
        u_common,
    )


def with_edges(
    priors: Priors, spread_px: float, bends_px: Array, excess_px: float, bias_px: float, free_rig: bool
) -> Priors:
    """Edges as good as their spread, bends (:func:`bgars.inspection.edge_profile.edge_bends_px`) and scatter let them.

    `bias_px` by rounded grey levels on top, of all together.
    `free_rig`: lights may be raised together as far as they may be off; not before edges are sharp.
    """
    size_px = max(math.hypot(EDGE_SHARE * spread_px, EXCESS_SHARE * excess_px), LEAST_EDGE_PX)
    u_common = priors.u_common.copy()
    if u_common[ELEVATION] >= np.radians(RIG_DEG):
        u_common[ELEVATION] = np.radians(RAISED_DEG if free_rig else RIG_DEG)
    u_common[list(EDGE_TERMS)] = np.hypot(size_px * np.array(EDGE_WAVES), BEND_SHARE * bends_px)
    u_common[EDGE] = np.hypot(u_common[EDGE], bias_px)
    return priors._replace(u_common=u_common)


def _perspective(problem: Problem) -> tuple[float, float]:
    """Inverse distance of the camera, 1 / px, and its standard deviation for the fit."""
    per_px = 1e-3 * problem.pitch_um
    distance_mm = problem.camera_distance_mm
    if distance_mm is None:
        return 0.0, CAMERA_MM.wide * per_px
    return (0.0 if math.isinf(distance_mm) else per_px / distance_mm), CAMERA_MM.narrow * per_px


def common_mixtures(problem: Problem, priors: Priors, refine_lights: bool) -> dict[int, Mixture]:
    """Long-tailed priors of the common terms that shadows alone cannot settle; none for what was declared."""
    mixtures = {EDGE: Mixture(float(priors.u_common[EDGE]), WIDE_EDGE_PX, WIDE_EDGE_SHARE)}
    if refine_lights and problem.u_rig_deg is None:
        mixtures[ELEVATION] = TOGETHER_DEG._replace(
            narrow=np.radians(TOGETHER_DEG.narrow), wide=np.radians(TOGETHER_DEG.wide)
        )
    if problem.u_q is None:
        mixtures[ROUNDNESS] = ROUND
    if problem.camera_distance_mm is None:
        per_px = 1e-3 * problem.pitch_um
        mixtures[PERSPECTIVE] = CAMERA_MM._replace(narrow=CAMERA_MM.narrow * per_px, wide=CAMERA_MM.wide * per_px)
    return mixtures


def refined_priors(
    priors: Priors, solution: Solution, chosen: NDArray[np.intp], u_radius: Array, declared_rig: bool
) -> Priors:
    """Scatter of lights, of q and of outlines as the result shows it (empirical Bayes).

    `u_radius` (N,) is what the finder states of the outlines' radii, px.
    """
    u_q = priors.u_q.copy()
    u_q[chosen] = q_spread(solution, priors.u_q[chosen])
    u_outlines = priors.u_outlines.copy()
    u_outlines[chosen, 2] = _scatter_of_outlines(priors.of_balls(chosen), solution, u_radius[chosen])
    priors = priors._replace(u_q=u_q, u_outlines=u_outlines)
    return priors if declared_rig else priors._replace(u_light_rad=_scatter_of_lights(priors, solution))


def _scatter_of_outlines(priors: Priors, solution: Solution, u_stated: Array) -> Array:
    """(N,) standard deviation of the radius of each outline by itself; one that is far off has its own.

    Outlines drew the solution to themselves; they are compared with what shadows alone say, by a Kalman update
    backwards. What is alike on all balls is the outlines' common error. Few balls, or shadows that know little of
    radii, say little of the scatter: that estimate and the finder's word are weighted.
    """
    rows, by_ball, _ = outline_rows(solution.state, priors.outlines)
    row = by_ball[:, 2]
    relief = np.einsum("ni,ni->n", np.square(row), solution.relief)
    after = np.einsum("ni,nij,nj->n", row, solution.alone, row) - relief
    information = np.maximum(1.0 / after - priors.u_outlines[:, 2] ** -2.0, KNOWN_BY_SHADOWS / after)
    off = -rows[:, 2] / (after * information)
    off = off - np.median(off)
    by_shadows = 1.0 / information + relief
    usual, stated = float(np.median(by_shadows)), float(np.median(u_stated)) ** 2
    seen = (MAD_TO_SIGMA * float(np.median(np.abs(off)))) ** 2
    freedom = max(len(off) - 1, 1e-6)
    u_seen = MAD_NOISE * max(seen, usual) * np.sqrt(2.0 / freedom)
    weight = stated**2 / (stated**2 + u_seen**2)
    own_px = np.sqrt(max(weight * (seen - usual) + (1.0 - weight) * stated, LEAST_OUTLINE_PX**2))
    apart_px = np.sqrt(np.maximum(np.square(off / OUTLIER_SIGMAS) - by_shadows, 0.0))
    own: Array = np.maximum(own_px, apart_px)
    return own


def _scatter_of_lights(priors: Priors, solution: Solution) -> Array:
    """(L,) standard deviation of each light around what all are turned by; a light that is far off has its own."""
    length = np.linalg.norm(solution.vectors, axis=1)
    ways = tangents(solution.vectors)
    turn = np.einsum("lc,lkc->lk", solution.vectors - priors.vectors, ways) / np.square(length)[:, None]
    off = turn - solution.common[[AZIMUTH, ELEVATION]]
    # What all are turned by is their own mean (Bessel's correction).
    size = np.square(off).sum(axis=1) / 2.0 * len(off) / max(len(off) - 1, 1)
    usual = float(np.median(size)) / MEDIAN_OF_CHI_SQUARE
    for _ in range(3):
        ordinary = size < OUTLIER_SIGMAS**2 * usual
        usual = float(size[ordinary].mean()) if ordinary.any() else usual
    scatter = np.clip(np.sqrt(usual), *np.radians(RIG_LIMITS_DEG))
    own: Array = np.maximum(scatter, np.sqrt(size) / OUTLIER_SIGMAS)
    return own


def with_shifts(priors: Priors, shifts: ImageShifts) -> Priors:
    """Shifts of images that are seen beyond doubt, instead of none."""
    seen = np.hypot(*shifts.move_px.T) > SHIFT_SIGMAS * shifts.u_px
    move = np.where(seen[:, None], shifts.move_px, 0.0)
    u = np.where(seen, np.maximum(shifts.u_px, SHIFT_PX), SHIFT_PX)
    return priors._replace(shifts_px=move, u_shifts_px=np.repeat(u[:, None], 2, axis=1))
