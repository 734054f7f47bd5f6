"""The passes of the fit, coarse to fine: predicted shadows, where their edges are, the bundle, how sharp edges are."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bgars.inspection.board import Board
from bgars.inspection.bundle import Priors, Solution, solve_bundle
from bgars.inspection.bundle_model import State
from bgars.inspection.common_terms import PERSPECTIVE
from bgars.inspection.edge_profile import edge_bends_px
from bgars.inspection.image_shifts import ImageShifts, agreed_shifts, image_shifts, with_texture
from bgars.inspection.outline import Outlines, moved_back, outline_centres
from bgars.inspection.plateaus import edge_bias_px
from bgars.inspection.priors import COARSE_SPREAD_PX, refined_priors, with_edges, with_shifts
from bgars.inspection.results import Usability, judge_balls
from bgars.inspection.shadow_edges import REACH_PX, REACH_SIGMAS, Edges, EdgeSettings, measure_edges
from bgars.inspection.shadow_map import Casters, ShadowMap
from bgars.inspection.spread import EdgeSpread, fit_spread
from bgars.inspection.texture import texture_shifts

if TYPE_CHECKING:
    from bgars.inspection.problem import Problem

__all__ = ["ShadowPasses"]

Array = NDArray[np.float64]

COARSE = (0.24, 0.08)
"""Distances, in radii, that edges are first looked for in."""
COARSE_EXTRA_PX = 1.5
COARSE_STEPS = 6.0
FINE_PASSES = 4
"""Most passes with sharp edges; two where the first leaves little to do."""
PASSES = len(COARSE) + FINE_PASSES
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
"""Scale, in standard deviations, of the loss that rejects outliers: at first, and once edges are sharp."""
OUTLINE_SAFETY = 1.5
"""Uncertainties of outlines count this much larger, beside what they scatter more than they say."""
SHIFT_BALLS = 24
OUTLINE_FLOOR_PX = 0.01
"""Least standard uncertainty of a centre by its outline."""


class ShadowPasses:
    """The fit on its way: call :meth:`go` until it says that it has finished.

    Parameters
    ----------
    problem : Problem
    table : (N, 5) float64
        Balls with first heights.
    priors : Priors
    index : (n,) intp
        Balls to fit: no bridges.
    fixed_rig : bool
        Lights' scatter is known, and not taken from the result.
    threads : int

    Attributes
    ----------
    solution : Solution or None
        Of the last pass; None where nothing could be fitted.
    edges, usability, used : Edges, Usability, Edges
        What was measured last, which balls have enough of it, and the edges of those.
    shifts, outlines : ImageShifts, Outlines or None
        From the passes with sharp edges.
    """

    def __init__(
        self,
        problem: Problem,
        table: Array,
        priors: Priors,
        index: NDArray[np.intp],
        *,
        fixed_rig: bool,
        threads: int,
    ) -> None:
        self.problem, self.index, self.fixed_rig, self.threads = problem, index, fixed_rig, threads
        lights = len(problem.vectors)
        self.state = State(table, problem.vectors.copy(), np.zeros((lights, 2)), Board().coefficients, priors.common)
        self.priors = priors
        self.spread = EdgeSpread(FIRST_SPREAD_PX, 0.0)
        self.gains = problem.irradiance.copy()
        self.turn, self.is_last, self.excess_px, self.change_px = 0, False, 0.0, np.inf
        self.solution: Solution | None = None
        self.shifts: ImageShifts | None = None
        self.outlines: Outlines | None = None
        self.edges: Edges
        self.used: Edges
        self.usability: Usability

    @property
    def share(self) -> float:
        """Fraction of the passes that is done, about."""
        return min(self.turn / PASSES, 0.95)

    def go(self) -> bool:
        """One pass; True when there is nothing left to do."""
        settled = self.turn > len(COARSE) and self.change_px < SMALL_CHANGE_PX
        self.is_last = self.is_last or self.turn >= PASSES - 1 or settled
        radius = float(np.median(self.state.balls[:, 3]))
        settings = _settings(self.turn, radius, self.spread, self.is_last)
        shadows = self._shadows(settings, radius)
        if self.is_last and self.shifts is None:
            self._look_at_outlines(shadows)
        edges = self._edges(shadows, settings, self.index)
        usability = judge_balls(edges)
        if not usability.usable.any() and self.turn > len(COARSE):
            # Edges went out of reach where little is in view: what the pass before measured is the best there is.
            return True
        self.edges, self.usability, self.used = edges, usability, edges.take(usability.usable)
        self._know_edges(settings, radius)
        before = self.state.balls
        self.solution = self._solve()
        if self.solution is None:
            return True
        drift_px = self._take(self.solution, before)
        self._sharpen(shadows, settings)
        self.turn += 1
        return self.is_last and (drift_px < DRIFT_PX or self.turn >= PASSES + LAST_PASSES - 1)

    def from_elsewhere(self, state: State, u_common: Array) -> None:
        """One pass more, from far off where the last one was linear, with other priors of the common terms."""
        balls = self.state.balls.copy()
        balls[self.index[self.usability.usable]] = state.balls
        self.state = state._replace(balls=balls)
        self.priors = self.priors._replace(u_common=u_common)
        self.is_last = True
        self.go()

    def _shadows(self, settings: EdgeSettings, radius: float) -> ShadowMap:
        problem, balls = self.problem, self.state.balls
        everything = _as_seen(np.concatenate([balls, problem.stand_ins(balls)]), self.state.common)
        return ShadowMap(
            problem.radiance,
            Casters.of(everything, self.state.vectors, problem.near, Board(self.state.board)),
            silhouette_margin_px=min(settings.reach_px, 0.1 * radius + 2.0),
            shadow_margin_px=settings.reach_px + 1.0,
            threads=self.threads,
        )

    def _edges(self, shadows: ShadowMap, settings: EdgeSettings, balls: NDArray[np.intp]) -> Edges:
        state, problem = self.state, self.problem
        return measure_edges(
            problem.radiance,
            shadows,
            state.balls[balls],
            state.vectors,
            problem.near,
            Board(state.board),
            self.gains[balls],
            settings,
            self.threads,
        )

    def _look_at_outlines(self, shadows: ShadowMap) -> None:
        """Outlines with the lens's sharpness: centres, and shifts of images."""
        problem, seen = self.problem, _as_seen(self.state.balls, self.state.common)
        azimuths = np.arctan2(self.state.vectors[:, 1], self.state.vectors[:, 0])
        radiance, sharp_px = problem.radiance, self.spread.sharp_px
        # Of some balls in the middle, looked for farther off, to tell whether an image is shifted.
        few = np.argsort(np.hypot(seen[:, 0], seen[:, 1]))[:SHIFT_BALLS]
        looks = [(seen, False), (seen[few], True)]
        with ThreadPoolExecutor(self.threads) as pool:
            fine, self.outlines = pool.map(
                lambda look: outline_centres(radiance, shadows, look[0], azimuths, sharp_px, coarse=look[1]), looks
            )
        by_outlines = agreed_shifts(image_shifts(self.outlines), image_shifts(fine))
        self.shifts = with_texture(by_outlines, texture_shifts(radiance, shadows, self.state.vectors, self.threads))
        self.priors = with_shifts(self.priors, self.shifts)
        if self.priors.shifts_px.any():
            fine = moved_back(fine, seen, self.priors.shifts_px)
        self.priors = _with_outlines(problem, self.priors, fine, seen)

    def _know_edges(self, settings: EdgeSettings, radius: float) -> None:
        """How well edges can be known, in the priors."""
        radiance, sharp_px = self.problem.radiance, self.spread.sharp_px
        bias_px = edge_bias_px(radiance, self.used, sharp_px) if self.is_last else 0.0
        spread = EdgeSpread(COARSE_SPREAD_PX, 0.0) if settings.coarse else self.spread
        state, near = self.state, self.problem.near
        usual = np.median(state.balls[self.index], axis=0)
        bends_px = edge_bends_px(usual, state.vectors, near, Board(state.board), spread)
        width_px, free_rig = _typical_spread_px(spread, radius), self.turn > len(COARSE)
        self.priors = with_edges(self.priors, width_px, bends_px, self.excess_px, bias_px, free_rig=free_rig)

    def _solve(self) -> Solution | None:
        """Bundle; once edges are sharp, scatter of lights, q and outlines is taken from the result (empirical Bayes).

        None where there is nothing to fit, or so little that the fit ran away.
        """
        chosen = self.index[self.usability.usable]
        if not len(chosen):
            return None
        is_sharp = self.turn >= len(COARSE)
        redescend = (REDESCEND if self.turn > len(COARSE) else REDESCEND_FIRST) if is_sharp else None

        def bundle(at: State, rounds: int) -> Solution:
            priors = self.priors.of_balls(chosen)
            return solve_bundle(self.used, at, self.problem.near, priors, redescend=redescend, rounds=rounds)

        solution = bundle(self.state.take(chosen), LONG_ROUNDS if self.is_last else SHORT_ROUNDS)
        for _ in range(EMPIRICAL_ROUNDS if self.is_last else 1):
            before = self.priors
            self.priors = refined_priors(before, solution, chosen, self.problem.u_radius, self.fixed_rig)
            if not self.is_last:
                break
            solution = bundle(solution.state, SHORT_ROUNDS)
            if np.allclose(before.u_light_rad, self.priors.u_light_rad, rtol=SETTLED) and np.allclose(
                before.u_q, self.priors.u_q, rtol=SETTLED
            ):
                break
        return solution if np.isfinite(solution.balls).all() else None

    def _take(self, solution: Solution, before: Array) -> float:
        """Go on from a solution; returns by how much all heights drifted together, px."""
        chosen = self.index[self.usability.usable]
        change = solution.balls - before[chosen]
        balls = before.copy()
        balls[chosen] = solution.balls
        self.state = solution.state._replace(balls=balls)
        self.excess_px, self.change_px = solution.excess_px, float(np.abs(change).max())
        self.gains[self.index] = self.edges.lit_levels(self.gains[self.index])
        return abs(float(change[:, 2].mean()))

    def _sharpen(self, shadows: ShadowMap, settings: EdgeSettings) -> None:
        """How sharp edges are, for the next pass."""
        before = self.spread
        if self.turn >= len(COARSE):
            self.spread = fit_spread(self.used)
            if abs(self.spread.sharp_px - before.sharp_px) > SMALL_SPREAD_CHANGE * before.sharp_px:
                self.change_px = np.inf
        elif self.turn == len(COARSE) - 1:
            self.spread = self._first_spread(shadows, settings)

    def _first_spread(self, shadows: ShadowMap, settings: EdgeSettings) -> EdgeSpread:
        """The spread, of a few, that leaves the least noise on a few balls."""
        chosen = self.index[self.usability.usable]
        few = chosen[:: max(1, len(chosen) // SPREAD_BALLS)]
        tried = [EdgeSettings(spread_px, 0.0, 0.0, settings.reach_px) for spread_px in SPREADS_PX]
        noise = [float(np.median(self._edges(shadows, one, few).noise_levels)) for one in tried]
        return EdgeSpread(SPREADS_PX[int(np.argmin(noise))], 0.0)


def _as_seen(table: Array, common: Array) -> Array:
    """Balls where a near camera sees them; their shadows stay on the board, within the margins of the maps."""
    seen = table.copy()
    seen[:, :2] *= 1.0 + common[PERSPECTIVE] * np.maximum(table[:, 2:3], 0.0)
    return seen


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


def _with_outlines(problem: Problem, priors: Priors, outlines: Outlines, table: Array) -> Priors:
    """Centres of the priors: the finder's, which sees all images as they lie, and the outlines', weighted."""
    u_finder = np.hypot(problem.u_centre, np.sqrt(np.square(priors.shifts_px).mean()))
    centres, u_outline = outlines.centres, outlines.u_centre
    known = np.isfinite(u_outline) & ~problem.bridged
    # What outlines scatter beyond their own word shows against the shadows' centres, but for a common shift.
    u_outline = np.where(known, u_outline, 1.0)
    off = (centres - table[:, :2])[known]
    scatter = 1.4826 * np.median(np.abs(off - np.median(off, axis=0)) / u_outline[known, None]) if known.any() else 1.0
    u_outline = OUTLINE_SAFETY * max(float(scatter), 1.0) * u_outline
    common = _apart(problem.table[:, :2] - centres, u_finder, u_outline, known) ** 2
    by_outline = np.where(known, 1.0 / (OUTLINE_FLOOR_PX**2 + u_outline**2 + common), 0.0)
    by_finder = 1.0 / (u_finder**2 + common)
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
