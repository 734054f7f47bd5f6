"""The fit of balls, lights and board to all shadows at once, from coarse to fine."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bgars.inspection.board import Board
from bgars.inspection.bundle import Priors, Solution, angles_rad, solve_bundle
from bgars.inspection.bundle_model import State
from bgars.inspection.checks import (
    MIN_WITNESSES,
    Complaint,
    check_shifts,
    displaced_images,
    explain_dark_steps,
    image_shifts,
    refuse_misfits,
)
from bgars.inspection.common_terms import PERSPECTIVE
from bgars.inspection.in_view import lights_in_view, unjudged_lights
from bgars.inspection.outline import Outlines, outline_centres
from bgars.inspection.plateaus import edge_bias_px
from bgars.inspection.priors import (
    COARSE_SPREAD_PX,
    common_mixtures,
    first_priors,
    refined_priors,
    with_edges,
    with_shifts,
)
from bgars.inspection.results import Usability, judge_balls
from bgars.inspection.settle import Settled, settle
from bgars.inspection.shadow_edges import REACH_PX, REACH_SIGMAS, Edges, EdgeSettings, measure_edges
from bgars.inspection.shadow_map import Casters, ShadowMap
from bgars.inspection.spread import EdgeSpread, fit_spread
from bgars.inspection.start import first_heights, radius_at

if TYPE_CHECKING:
    from collections.abc import Callable

    from bgars.inspection.checks import ImageShifts
    from bgars.inspection.problem import Problem
    from bgars.records import NormalField

__all__ = ["Fit", "fit_shadows"]

Array = NDArray[np.float64]

COARSE = (0.24, 0.08)
"""Distances, in radii, that edges are first looked for in."""
COARSE_EXTRA_PX = 1.5
COARSE_STEPS = 6.0
FINE_PASSES = 4
"""Most passes with sharp edges; two where the first leaves little to do."""
SMALL_CHANGE_PX = 0.5
LAST_PASSES, DRIFT_PX = 3, 0.02
"""Heights of all balls and elevations of all lights settle slowly together, where the rig leaves them free."""
FIRST_SPREAD_PX = 0.5
SPREADS_PX = (0.3, 0.5, 0.8, 1.3, 2.0)
SPREAD_BALLS = 5
SMALL_SPREAD_CHANGE = 0.15
TYPICAL_WAY = 2.0
"""Way of the light from a ball to the edge of its shadow, in radii."""
EMPIRICAL_ROUNDS = 5
SETTLED = 0.1
SHORT_ROUNDS, LONG_ROUNDS = 8, 20
REDESCEND_FIRST, REDESCEND = 8.0, 3.5
OUTLINE_SAFETY = 1.5
SHIFT_BALLS = 24
OUTLINE_FLOOR_PX = 0.01


@dataclass(frozen=True)
class Fit:
    """Everything the shadows gave, in pixels.

    `index` (n,) balls whose shadows were looked at (no bridges); `solution` only of those that `usability` calls
    usable.
    """

    problem: Problem
    index: NDArray[np.intp]
    usability: Usability
    solution: Solution | None
    edges: Edges
    spread: EdgeSpread
    warnings: tuple[str, ...]
    doubts: tuple[str, ...] = ()
    priors: Priors | None = None
    settled: Settled | None = None


def fit_shadows(
    problem: Problem,
    field: NormalField | None,
    *,
    refine_lights: bool,
    threads: int,
    progress: Callable[[float], object],
) -> Fit | None:
    """Fit shadows in passes, from coarse to fine; None where there is nothing to fit."""
    if not len(problem.table):
        return None
    table, vectors, board = problem.table.copy(), problem.vectors.copy(), Board()
    heights, steps = first_heights(
        problem.radiance,
        table,
        vectors,
        problem.near,
        board,
        problem.irradiance.mean(axis=0),
        [problem.neighbours(index) for index in range(len(table))],
        threads,
    )
    table[:, 2], table[:, 3] = heights, radius_at(heights, table[:, 3])
    in_view, files = lights_in_view(problem, table), problem.radiance.capture.files
    no_light = np.zeros_like(in_view)
    complaints = explain_dark_steps(problem, table, steps, in_view)
    progress(0.1)
    priors = first_priors(problem, table, field, refine_lights)
    shifts_px, common = np.zeros((len(vectors), 2)), priors.common.copy()
    spread = EdgeSpread(FIRST_SPREAD_PX, 0.0)
    gains = problem.irradiance.copy()
    index = np.flatnonzero(~problem.bridged)
    if not len(index):
        return None
    passes = len(COARSE) + FINE_PASSES
    turn, last, finished, change = 0, False, False, np.inf
    excess_px = 0.0
    wide: ImageShifts | None = None
    outlines: Outlines | None = None
    while not finished:
        last = last or turn >= passes - 1 or (turn > len(COARSE) and change < SMALL_CHANGE_PX)
        radius = float(np.median(table[:, 3]))
        settings = _settings(turn, radius, spread, last)
        shadows = ShadowMap(
            problem.radiance,
            Casters.of(
                _as_seen(np.concatenate([table, problem.stand_ins(table)]), common), vectors, problem.near, board
            ),
            silhouette_margin_px=min(settings.reach_px, 0.1 * radius + 2.0),
            shadow_margin_px=settings.reach_px + 1.0,
            threads=threads,
        )
        if last and wide is None:
            seen = _as_seen(table, common)
            priors = _with_outlines(problem, priors, shadows, seen, spread)
            outlines = _wide_outlines(problem, shadows, seen, vectors, spread)
            wide = image_shifts(outlines)
            priors = with_shifts(priors, wide)
        edges = measure_edges(
            problem.radiance,
            shadows,
            table[index],
            vectors,
            problem.near,
            board,
            gains[index],
            settings,
            threads,
            spread if turn > len(COARSE) else None,
        )
        usability = judge_balls(edges)
        chosen = index[usability.usable]
        used = edges.take(usability.usable)
        bias_px = edge_bias_px(problem.radiance, used, spread.sharp_px) if last else 0.0
        width_px = COARSE_SPREAD_PX if settings.coarse else _typical_spread_px(spread, radius)
        priors = with_edges(priors, width_px, radius, excess_px, bias_px, free_rig=turn > len(COARSE))
        start = State(table[chosen], vectors, shifts_px, board.coefficients, common)
        fixed_rig = not refine_lights or problem.u_rig_deg is not None
        solution, priors = _solve(used, start, problem.near, priors, chosen, turn, last, fixed_rig)
        if solution is None:
            warnings = _warnings(problem, complaints, edges, None, in_view if len(table) >= MIN_WITNESSES else no_light)
            return Fit(problem, index, usability, None, edges, spread, warnings)
        change = float(np.abs(solution.balls - table[chosen]).max())
        drift = abs(float((solution.balls - table[chosen])[:, 2].mean()))
        finished = last and (drift < DRIFT_PX or turn >= passes + LAST_PASSES - 2)
        table[chosen], vectors, board = solution.balls, solution.vectors, solution.board
        shifts_px, common, excess_px = solution.shifts_px, solution.common, solution.excess_px
        gains[index] = edges.lit_levels(gains[index])
        before = spread
        if turn >= len(COARSE):
            spread = fit_spread(used)
        elif turn == len(COARSE) - 1:
            spread = _first_spread(problem, shadows, table[chosen], vectors, board, gains[chosen], settings, threads)
        if abs(spread.sharp_px - before.sharp_px) > SMALL_SPREAD_CHANGE * before.sharp_px and turn >= len(COARSE):
            change = np.inf
        turn += 1
        progress(0.1 + 0.8 * (1.0 if finished else min(turn / passes, 0.95)))
    assert wide is not None
    assert outlines is not None
    assert solution is not None
    settled = settle(solution, priors, common_mixtures(problem, priors, refine_lights))
    # First heights may be wrong, and what lies in the image with them.
    warnings = _warnings(problem, complaints, used, solution, in_view & lights_in_view(problem, table))
    warnings += check_shifts(wide, files)
    doubts = displaced_images(outlines, files)
    return Fit(problem, index, usability, settled.solution, edges, spread, warnings, doubts, priors, settled)


def _as_seen(table: Array, common: Array) -> Array:
    """Balls where a near camera sees them; their shadows stay on the board, within the margins of the maps."""
    seen = table.copy()
    seen[:, :2] *= 1.0 + common[PERSPECTIVE] * np.maximum(table[:, 2:3], 0.0)
    return seen


def _warnings(
    problem: Problem,
    complaints: tuple[Complaint, ...],
    edges: Edges,
    solution: Solution | None,
    in_view: NDArray[np.bool_],
) -> tuple[str, ...]:
    """What is left of a first look's complaints after the fit; lights out of view are judged by the fit alone."""
    weight = None if solution is None else solution.weight
    vectors = problem.vectors if solution is None else solution.vectors
    moved_deg = np.degrees(angles_rad(vectors, problem.vectors))
    complaints = tuple(complaint for complaint in complaints if in_view[complaint.light])
    left = refuse_misfits(complaints, edges, weight, moved_deg)
    return left + unjudged_lights(in_view, edges, weight, problem.radiance.capture.files)


def _wide_outlines(problem: Problem, shadows: ShadowMap, table: Array, vectors: Array, spread: EdgeSpread) -> Outlines:
    """Outlines of some balls in the middle, looked for farther off, to tell whether an image is shifted."""
    few = np.argsort(np.hypot(table[:, 0], table[:, 1]))[:SHIFT_BALLS]
    azimuths = np.arctan2(vectors[:, 1], vectors[:, 0])
    return outline_centres(problem.radiance, shadows, table[few], azimuths, spread.sharp_px, coarse=True)


def _first_spread(
    problem: Problem,
    shadows: ShadowMap,
    table: Array,
    vectors: Array,
    board: Board,
    gains: Array,
    settings: EdgeSettings,
    threads: int,
) -> EdgeSpread:
    """The spread, of a few, that leaves the least noise on a few balls."""
    few = slice(0, None, max(1, len(table) // SPREAD_BALLS))
    noise = []
    for spread_px in SPREADS_PX:
        tried = EdgeSettings(spread_px, 0.0, 0.0, settings.reach_px)
        edges = measure_edges(
            problem.radiance, shadows, table[few], vectors, problem.near, board, gains[few], tried, threads
        )
        noise.append(float(np.median(edges.noise_levels)))
    return EdgeSpread(SPREADS_PX[int(np.argmin(noise))], 0.0)


def _settings(turn: int, radius: float, spread: EdgeSpread, last: bool) -> EdgeSettings:
    """Coarse first, then as sharp as the edges are."""
    if turn < len(COARSE):
        reach = COARSE[turn] * radius + COARSE_EXTRA_PX
        return EdgeSettings(1.0, 0.0, 0.0, reach, max(1, int(reach / COARSE_STEPS)), coarse=True)
    widest = max(spread.lamp_azimuth_rad, spread.lamp_elevation_rad)
    reach_px = REACH_SIGMAS * float(np.hypot(spread.sharp_px, TYPICAL_WAY * widest * radius)) + REACH_PX
    return EdgeSettings(spread.sharp_px, spread.lamp_azimuth_rad, spread.lamp_elevation_rad, reach_px, thorough=last)


def _typical_spread_px(spread: EdgeSpread, radius: float) -> float:
    """Spread of an edge between tip and side of a shadow."""
    return float(np.hypot(spread.sharp_px, TYPICAL_WAY * spread.lamp_rad * radius))


def _with_outlines(problem: Problem, priors: Priors, shadows: ShadowMap, table: Array, spread: EdgeSpread) -> Priors:
    """Centres of the priors: the finder's and the outlines', weighted."""
    azimuths = np.arctan2(problem.vectors[:, 1], problem.vectors[:, 0])
    outlines = outline_centres(problem.radiance, shadows, table, azimuths, spread.sharp_px)
    centres, u_outline = outlines.centres, outlines.u_centre
    known = np.isfinite(u_outline) & ~problem.bridged
    # What outlines scatter beyond their own word shows against the shadows' centres, but for a common shift.
    u_outline = np.where(known, u_outline, 1.0)
    off = (centres - table[:, :2])[known]
    scatter = 1.4826 * np.median(np.abs(off - np.median(off, axis=0)) / u_outline[known, None]) if known.any() else 1.0
    u_outline = OUTLINE_SAFETY * max(float(scatter), 1.0) * u_outline
    common = _apart(problem.table[:, :2] - centres, problem.u_centre, u_outline, known) ** 2
    by_outline = np.where(known, 1.0 / (OUTLINE_FLOOR_PX**2 + u_outline**2 + common), 0.0)
    by_finder = 1.0 / (problem.u_centre**2 + common)
    given, u_given = priors.outlines.copy(), priors.u_outlines.copy()
    weight = by_outline + by_finder
    for axis in (0, 1):
        outline = np.where(known, centres[:, axis], 0.0)
        given[:, axis] = (by_outline * outline + by_finder * problem.table[:, axis]) / weight
        u_given[:, axis] = 1.0 / np.sqrt(weight)
    return priors._replace(outlines=given, u_outlines=u_given)


def _apart(off: Array, u_finder: Array, u_outline: Array, known: NDArray[np.bool_]) -> float:
    """What finder and outlines are apart by on all balls alike, beyond what they state, as a deviation of each ball's.

    One of them is wrong then on all balls together, and many balls make that no smaller.
    """
    if not known.any():
        return 0.0
    stated = 2.0 * float(np.median(np.hypot(u_finder, u_outline)[known]))
    apart = float(np.hypot(*np.median(off[known], axis=0)))
    return float(np.sqrt(known.sum() * max(apart**2 - stated**2, 0.0)))


def _solve(
    edges: Edges,
    start: State,
    near: bool,
    priors: Priors,
    chosen: NDArray[np.intp],
    turn: int,
    last: bool,
    fixed_rig: bool,
) -> tuple[Solution | None, Priors]:
    """Bundle; once edges are sharp, the scatter of lights, q and outlines is taken from the result (empirical Bayes).

    None where there is nothing to fit, or so little that the fit ran away.
    """
    if not len(chosen):
        return None, priors
    sharp = turn >= len(COARSE)
    redescend = (REDESCEND if turn > len(COARSE) else REDESCEND_FIRST) if sharp else None

    def bundle(at: State, rounds: int) -> Solution:
        return solve_bundle(edges, at, near, priors.of_balls(chosen), redescend=redescend, rounds=rounds)

    solution = bundle(start, LONG_ROUNDS if last else SHORT_ROUNDS)
    for _ in range(EMPIRICAL_ROUNDS if last else 1):
        before = priors
        priors = refined_priors(priors, solution, chosen, fixed_rig)
        if not last:
            break
        solution = bundle(solution.state, SHORT_ROUNDS)
        if np.allclose(before.u_light_rad, priors.u_light_rad, rtol=SETTLED) and np.allclose(
            before.u_q, priors.u_q, rtol=SETTLED
        ):
            break
    return (solution if np.isfinite(solution.balls).all() else None), priors
