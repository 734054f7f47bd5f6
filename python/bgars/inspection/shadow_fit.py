"""The fit of balls, lights and board to all shadows at once, from coarse to fine."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bgars.inspection.board import Board
from bgars.inspection.bundle import Priors, Solution, angles_rad
from bgars.inspection.checks import (
    MIN_WITNESSES,
    Complaint,
    explain_dark_steps,
    refuse_misfits,
)
from bgars.inspection.common_terms import ROUNDNESS
from bgars.inspection.image_shifts import check_shifts, displaced_images
from bgars.inspection.in_view import lights_in_view, unjudged_lights
from bgars.inspection.own_shape import free_shapes
from bgars.inspection.population import FREE
from bgars.inspection.priors import common_mixtures, first_priors
from bgars.inspection.settle import Settled, settle
from bgars.inspection.shadow_passes import REDESCEND, ShadowPasses
from bgars.inspection.start import first_heights, radius_at

if TYPE_CHECKING:
    from collections.abc import Callable

    from bgars.inspection.problem import Problem
    from bgars.inspection.results import Usability
    from bgars.inspection.shadow_edges import Edges
    from bgars.inspection.spread import EdgeSpread
    from bgars.records.normal_field import NormalField

__all__ = ["Fit", "fit_shadows"]

Array = NDArray[np.float64]
LINEAR_ROUNDNESS = 0.01
"""Change of q up to which heights follow it linearly, to a ten-thousandth."""


@dataclass(frozen=True)
class Fit:
    """Everything the shadows gave, in pixels.

    `index` (n,) balls whose shadows were looked at (no bridges); `solution` only of those that `usability` calls
    usable; `own_shapes` (m,) balls that are no
    spheroids.
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
    own_shapes: NDArray[np.intp] | None = None


def fit_shadows(
    problem: Problem,
    field: NormalField | None,
    *,
    refine_lights: bool,
    threads: int,
    progress: Callable[[float], object],
) -> Fit | None:
    """Fit shadows in passes, from coarse to fine; None where there is nothing to fit."""
    index = np.flatnonzero(~problem.bridged)
    if not len(index):
        return None
    table = problem.table.copy()
    heights, steps = first_heights(
        problem.radiance,
        table,
        problem.vectors,
        problem.near,
        Board(),
        problem.irradiance.mean(axis=0),
        problem.neighbours(),
        threads,
    )
    table[:, 2], table[:, 3] = heights, radius_at(heights, table[:, 3])
    in_view, files = lights_in_view(problem, table), problem.radiance.capture.files
    complaints = explain_dark_steps(problem, table, steps, in_view)
    progress(0.1)
    priors = first_priors(problem, table, field, refine_lights)
    fixed_rig = not refine_lights or problem.u_rig_deg is not None
    passes = ShadowPasses(problem, table, priors, index, fixed_rig=fixed_rig, threads=threads)
    while not passes.go():
        progress(0.1 + 0.8 * passes.share)
    progress(0.9)
    edges, usability, spread = passes.edges, passes.usability, passes.spread
    if passes.solution is None:
        enough = in_view if len(table) >= MIN_WITNESSES else np.zeros_like(in_view)
        warnings = _warnings(problem, complaints, edges, None, enough)
        return Fit(problem, index, usability, None, edges, spread, warnings)
    mixtures = common_mixtures(problem, passes.priors, refine_lights)
    solution, own_shapes = _free_shapes(passes, passes.solution)
    settled = settle(solution, passes.priors, mixtures)
    moved = abs(float(settled.solution.common[ROUNDNESS] - passes.solution.common[ROUNDNESS]))
    if ROUNDNESS in mixtures and moved > LINEAR_ROUNDNESS:
        u_common = passes.priors.u_common.copy()
        u_common[ROUNDNESS] = mixtures[ROUNDNESS].wide
        passes.from_elsewhere(settled.solution.state, u_common)
        edges, usability = passes.edges, passes.usability
        if passes.solution is not None:
            solution, own_shapes = _free_shapes(passes, passes.solution)
            settled = settle(solution, passes.priors, mixtures)
    # First heights may be wrong, and what lies in the image with them.
    in_view &= lights_in_view(problem, passes.state.balls)
    warnings = _warnings(problem, complaints, passes.used, passes.solution, in_view)
    doubts: tuple[str, ...] = ()
    if passes.shifts is not None and passes.outlines is not None:
        warnings += check_shifts(passes.shifts, files)
        doubts = displaced_images(passes.outlines, files)
    return Fit(
        problem, index, usability, settled.solution, edges, spread, warnings, doubts, passes.priors, settled, own_shapes
    )


def _free_shapes(passes: ShadowPasses, solution: Solution) -> tuple[Solution, NDArray[np.intp]]:
    """Balls that are unlike the others get shapes of their own, and priors to match; returns which balls these are."""
    chosen, u_q = passes.index[passes.usability.usable], passes.priors.u_q.copy()
    solution, odd = free_shapes(solution, passes.used, passes.priors.of_balls(chosen), passes.problem.near, REDESCEND)
    u_q[chosen[odd]] = FREE
    passes.priors = passes.priors._replace(u_q=u_q)
    return solution, chosen[odd]


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
