"""From fitted shadows to records: readings in micrometres, each with its whole u, and reasons where there is none."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bgars.files.light_names import light_name
from bgars.inspection.budget import reading_budget
from bgars.inspection.bundle import angles_rad
from bgars.inspection.shape_or_lights import silhouettes_or_shadows, what_is_odd
from bgars.records.measured_balls import BallMeasurement, MeasuredBall

if TYPE_CHECKING:
    from bgars.inspection.budget import Budget
    from bgars.inspection.bundle import Solution
    from bgars.inspection.flat_top import FlatTops
    from bgars.inspection.problem import Problem
    from bgars.inspection.shadow_edges import Edges
    from bgars.inspection.shadow_fit import Fit
    from bgars.records.found_balls import FoundBall, FoundBalls

__all__ = ["Usability", "judge_balls", "measurement"]

Array = NDArray[np.float64]

MIN_STRETCHES = 4
"""Measured stretches of edge that make a shadow usable."""
MIN_LIGHTS = 2
"""Lights whose shadows must be usable: one knows no elevation from height."""
MIN_CONTRAST_LEVELS = 1.5
"""Contrast of lit and shadowed board, in grey levels of 255, that is too little: it rounds to less than 2."""
MIN_CONTRAST_NOISE = 0.7
"""Least contrast of a shadow, over the noise of the pixels at its edge."""
MIN_DEPTH = 0.5
"""Least share of the board's light that a shadow takes: with less, more light than the lamp's own falls into it, or the
edge is one of the board's texture. Caps whose flanks are flatter than the lights cast no shadow at all.
"""
FLAT_SIGMAS = 3.0
"""Uncertainties from which on a flat top is significant."""
FLAT_SHARE = 0.01
"""A flat top is taken off the height where it is significant and more than this share of the radius."""
FLAT_MODEL = 0.25
"""Relative standard uncertainty of a flat top's depth: its edge is rounded, normals blend it with the slope beside."""
FLAT_BALLS, DEEPEST_FLAT = 0.05, 0.25
"""Balls that are flat at all, one in twenty, by up to so many radii: what is believed before a top was looked at."""
UNSEEN_TOP = 0.04
"""Of the radius: where a top is known no better, a flat one would pass for a round one."""
FLAT_TOP = "flat top"
MANY_OUTLIERS = 0.4
"""Share of the stretches of edge without weight from which on a ball is doubtful."""
CLIPPED_SHARE = 0.5
"""Share of board around a ball, saturated or masked, that explains why nothing was measured."""
LIGHT_WARNING_DEG = 5.0
"""Move of a light in the fit that is told."""
NO_SPHEROID = "its shadows show a tilted, oval or dented ball; its shape is fitted, and its uncertainties are larger"
WORTH_TELLING = 0.05
"""Causes of less than this share of an uncertainty are not listed: together they are a few thousandths of it."""


class Usability(NamedTuple):
    """(n,) whether a ball's shadows can be used, lights that show one, contrast in grey levels of 255."""

    usable: NDArray[np.bool_]
    lights: NDArray[np.intp]
    contrast_levels: Array


class _Told(NamedTuple):
    """Uncertainties (N,) of a reading, and the same by cause."""

    total: Array
    by_cause: dict[str, Array]


def judge_balls(edges: Edges) -> Usability:
    """Which balls have shadows enough, and contrast enough."""
    known = np.isfinite(edges.u_px)
    count = known.sum(axis=2)
    total = np.where(known, edges.contrast_levels, 0.0).sum(axis=2)
    contrast = total / np.maximum(count, 1)
    seen = count >= MIN_STRETCHES
    low, high = (np.where(known, level, 0.0).sum(axis=2) for level in (edges.low, edges.high))
    strong = seen & (contrast >= MIN_CONTRAST_NOISE * edges.noise_levels) & (high - low >= MIN_DEPTH * high)
    mean = np.where(seen, contrast, 0.0).sum(axis=1) / np.maximum(seen.sum(axis=1), 1)
    usable = (strong.sum(axis=1) >= MIN_LIGHTS) & (mean >= MIN_CONTRAST_LEVELS)
    return Usability(usable, strong.sum(axis=1), np.where(seen.any(axis=1), mean, np.nan))


def measurement(found: FoundBalls, problem: Problem, fit: Fit | None, flats: FlatTops | None) -> BallMeasurement:
    """Put everything into records."""
    pitch = problem.pitch_um
    unit = problem.vectors / np.linalg.norm(problem.vectors, axis=1, keepdims=True)
    solution = None if fit is None else fit.solution
    looked_at = {} if fit is None else {int(ball): place for place, ball in enumerate(fit.index)}
    fitted: dict[int, int] = {}
    budgets: dict[str, Budget] = {}
    told: dict[str, _Told] = {}
    if fit is not None and solution is not None:
        fitted = {int(ball): place for place, ball in enumerate(fit.index[fit.usability.usable])}
        budgets = _budgets(fit, solution, flats)
        told = {name: _Told(budget.total(), budget.by_cause()) for name, budget in budgets.items()}
    balls = []
    for index, ball in enumerate(found.balls):
        if index in fitted and fit is not None:
            lights = int(fit.usability.lights[looked_at[index]])
            balls.append(_measured(ball, fit, fitted[index], lights, flats, told, pitch))
        else:
            balls.append(_unmeasured(ball, index, problem, fit, looked_at, pitch))
    warnings = () if fit is None else fit.warnings
    half = np.hypot(problem.radiance.width, problem.radiance.height) / 2.0
    corner_um, u_pitch = float(half * pitch), problem.u_pixel_pitch
    if fit is None or solution is None:
        unknown = np.full(6, np.nan)
        no_change = np.zeros(len(unit))
        return BallMeasurement(
            tuple(balls), unknown, unit, no_change, float("nan"), warnings, corner_um=corner_um, u_pixel_pitch=u_pitch
        )
    c1, c2, c3, c4, c5 = solution.board.coefficients
    moved = np.degrees(angles_rad(solution.vectors, problem.vectors))
    files = problem.radiance.capture.files
    outlines = problem.table[fit.index[fit.usability.usable], 3]
    doubts = fit.doubts + silhouettes_or_shadows(outlines, _foot(solution.balls))
    if fit.settled is not None:
        warnings += what_is_odd(fit.settled, problem.pitch_um)
    if fit.own_shapes is not None:
        warnings += tuple(f"{found.balls[ball].name}: {NO_SPHEROID}" for ball in fit.own_shapes)
    warnings += tuple(
        f"{light_name(light, files)}: its shadows place it {moved[light]:.1f} degrees off its direction in the rig"
        for light in map(int, np.flatnonzero(moved > LIGHT_WARNING_DEG))
    )
    rows = np.array([fitted.get(index, -1) for index in range(len(balls))])
    shared = {
        name: np.where(rows[:, None] >= 0, budgets[name].shared[rows], 0.0) * pitch
        for name in ("x_um", "y_um", "top_um")
    }
    return BallMeasurement(
        tuple(balls),
        np.array([0.0, c1, c2, c3 / pitch, c4 / pitch, c5 / pitch]),
        solution.vectors / np.linalg.norm(solution.vectors, axis=1, keepdims=True),
        moved,
        float(np.sqrt(np.nanmean(np.square(fit.edges.noise_levels))) / np.nanmedian(fit.edges.contrast_levels)),
        warnings,
        board_covariance_um(solution.board_covariance, pitch),
        doubts,
        u_light_deg=np.degrees(solution.u_light_rad) / np.sqrt(2.0),
        u_light_common_deg=np.full(len(unit), np.degrees(solution.u_common_light_rad)),
        shared_um=shared,
        causes=budgets["top_um"].causes,
        corner_um=corner_um,
        u_pixel_pitch=u_pitch,
    )


def board_covariance_um(covariance_px: Array, pitch_um: float) -> Array:
    """(6, 6) covariance of the board's coefficients over um; the constant is 0 by definition."""
    scale = np.array([1.0, 1.0, 1.0 / pitch_um, 1.0 / pitch_um, 1.0 / pitch_um])
    covariance = np.zeros((6, 6))
    covariance[1:, 1:] = covariance_px * np.outer(scale, scale)
    return covariance


def _foot(balls: Array) -> Array:
    """(N,) horizontal radius of what is above the board: of a cap, that of its foot."""
    depth = np.minimum(balls[:, 2], 0.0) / balls[:, 4]
    foot: Array = np.sqrt(np.maximum(np.square(balls[:, 3]) - np.square(depth), 0.0))
    return foot


def _budgets(fit: Fit, solution: Solution, flats: FlatTops | None) -> dict[str, Budget]:
    """Budgets of all readings, px and ratios, by name; flat tops are in that of the tops."""
    assert fit.settled is not None
    assert fit.priors is not None
    _, _, z, radius, q = solution.balls.T
    zero, one = np.zeros_like(z), np.ones_like(z)
    foot = np.maximum(_foot(solution.balls), 1e-6)
    depth = np.minimum(z, 0.0) / q
    by_ball = {
        "x_um": (one, zero, zero, zero, zero),
        "y_um": (zero, one, zero, zero, zero),
        "diameter_um": (zero, zero, -2.0 * depth / (q * foot), 2.0 * radius / foot, 2.0 * depth**2 / (q * foot)),
        "centre_z_um": (zero, zero, one, zero, zero),
        "top_um": (zero, zero, one, q, radius),
        "aspect_ratio": (zero, zero, zero, zero, one),
    }
    priors = fit.priors.of_balls(fit.index[fit.usability.usable])
    budgets = {}
    for name, columns in by_ball.items():
        budgets[name] = reading_budget(fit.settled, priors, np.stack(columns, axis=1))
    u_flat = _u_flat(flats, radius)
    tops = budgets["top_um"]
    budgets["top_um"] = tops._replace(alone=np.hypot(tops.alone, u_flat), alone_by={**tops.alone_by, FLAT_TOP: u_flat})
    return budgets


def _u_flat(flats: FlatTops | None, radius: Array) -> Array:
    """(N,) what a flat top, seen or not, makes the height uncertain by, px.

    A depth that was not found significant is uncertain by u only if the ball is flat at all: with a share p of flat
    balls, deep evenly up to d, about ``p u sqrt(pi / 2) / d`` of those that look round within u are (Bayes' rule). A
    top that was hardly seen is uncertain by all of u.
    """
    deepest = DEEPEST_FLAT * radius
    if flats is None:
        unseen: Array = np.sqrt(FLAT_BALLS / 3.0) * deepest
        return unseen
    found = np.nan_to_num(flats.height_px)
    u = np.where(np.isfinite(flats.u_height_px), flats.u_height_px, deepest)
    still_flat: Array = FLAT_BALLS * np.minimum(1.0, u * np.sqrt(np.pi / 2.0) / deepest)
    round_ = np.where(u > UNSEEN_TOP * radius, u, np.sqrt(still_flat) * u)
    u_flat: Array = np.where(_is_flat(flats, radius), np.hypot(u, FLAT_MODEL * found), round_)
    return u_flat


def _is_flat(flats: FlatTops, radius: Array) -> NDArray[np.bool_]:
    """(N,) whether a flat top is significant, and deep enough to be taken off the height."""
    found = np.nan_to_num(flats.height_px)
    flat: NDArray[np.bool_] = (found > FLAT_SIGMAS * np.nan_to_num(flats.u_height_px)) & (found > FLAT_SHARE * radius)
    return flat


def _measured(
    ball: FoundBall,
    fit: Fit,
    place: int,
    lights: int,
    flats: FlatTops | None,
    told: dict[str, _Told],
    pitch: float,
) -> MeasuredBall:
    """A ball with its numbers."""
    solution = fit.solution
    assert solution is not None
    x, y, z, radius, q = solution.balls[place]
    u = {name: float(each.total[place]) for name, each in told.items()}
    top = z + q * radius
    reasons = []
    flat = u_flat = float("nan")
    if flats is not None:
        flat, u_flat = float(flats.height_px[place]), float(flats.u_height_px[place])
        if _is_flat(flats, solution.balls[:, 3])[place]:
            top -= flat
            reasons.append(f"flat top: {flat * pitch:.0f} um are missing")
        elif not u_flat <= UNSEEN_TOP * radius:
            reasons.append("its top was not seen well enough (clipped, or too dark): a flat top would look the same")
    known = np.isfinite(solution.residual_px[place])
    outliers = float((solution.weight[place][known] < 0.1).mean()) if known.any() else 1.0  # noqa: PLR2004
    if outliers > MANY_OUTLIERS:
        reasons.append(f"doubtful: {100 * outliers:.0f} % of its shadow's edge does not fit a ball")
    return MeasuredBall(
        name=ball.name,
        row=ball.row,
        col=ball.col,
        x_um=float(x * pitch),
        y_um=float(y * pitch),
        diameter_um=float(2.0 * _foot(solution.balls[place : place + 1])[0] * pitch),
        centre_z_um=float(z * pitch),
        top_um=float(top * pitch),
        aspect_ratio=float(q),
        flat_top_depth_um=flat * pitch,
        u_x_um=u["x_um"] * pitch,
        u_y_um=u["y_um"] * pitch,
        u_diameter_um=u["diameter_um"] * pitch,
        u_centre_z_um=u["centre_z_um"] * pitch,
        u_top_um=u["top_um"] * pitch,
        u_aspect_ratio=u["aspect_ratio"],
        u_flat_top_depth_um=u_flat * pitch,
        lights_used=lights,
        kind=ball.kind,
        reasons=tuple(reasons),
        budget={name: _causes_um(told[name], place, pitch) for name in ("x_um", "y_um", "diameter_um", "top_um")},
    )


def _causes_um(told: _Told, place: int, pitch: float) -> dict[str, float]:
    """Causes of one ball's uncertainty, largest first, without those that hardly count."""
    parts = {name: float(part[place]) * pitch for name, part in told.by_cause.items()}
    least = WORTH_TELLING * float(told.total[place]) * pitch
    kept = {name: part for name, part in parts.items() if part >= least}
    return dict(sorted(kept.items(), key=lambda pair: -pair[1]))


def _unmeasured(
    ball: FoundBall, index: int, problem: Problem, fit: Fit | None, looked_at: dict[int, int], pitch: float
) -> MeasuredBall:
    """A ball that has only its circle, and why."""
    nan = float("nan")
    lights = 0
    if problem.bridged[index]:
        reasons = ["bridged: its height cannot be measured"]
    elif fit is None or index not in looked_at:
        reasons = ["its shadows were not found"]
    else:
        place = looked_at[index]
        lights, contrast = int(fit.usability.lights[place]), float(fit.usability.contrast_levels[place])
        reasons = _why(problem, index, lights, contrast)
    # All outlines together are known no better than one, as in the priors of the fit.
    u_radius_px = float(np.hypot(ball.u_radius_px, np.median(problem.u_radius)))
    return MeasuredBall(
        name=ball.name,
        row=ball.row,
        col=ball.col,
        x_um=ball.x_px * pitch,
        y_um=ball.y_px * pitch,
        diameter_um=2.0 * ball.radius_px * pitch,
        centre_z_um=nan,
        top_um=nan,
        aspect_ratio=nan,
        flat_top_depth_um=nan,
        u_x_um=ball.u_centre_px * pitch,
        u_y_um=ball.u_centre_px * pitch,
        u_diameter_um=2.0 * u_radius_px * pitch,
        u_centre_z_um=nan,
        u_top_um=nan,
        u_aspect_ratio=nan,
        u_flat_top_depth_um=nan,
        lights_used=lights,
        kind=ball.kind,
        reasons=tuple(reasons),
    )


def _why(problem: Problem, index: int, lights: int, contrast: float) -> list[str]:
    """Reasons for a ball without usable shadows."""
    x, y, _, radius, _ = problem.table[index]
    angle = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)
    reach = radius * np.array([1.25, 1.4, 1.6])[:, None]
    radiance = problem.radiance
    row = np.rint(radiance.row(y + reach * np.sin(angle))).astype(np.intp)
    col = np.rint(radiance.col(x + reach * np.cos(angle))).astype(np.intp)
    inside = (row >= 0) & (row < radiance.height) & (col >= 0) & (col < radiance.width)
    values = radiance.at((row * radiance.width + col)[inside]) if inside.any() else np.zeros((1, 1), np.float32)
    if np.isnan(values).mean() > CLIPPED_SHARE:
        return ["the board around it is saturated or masked out"]
    level = float(np.nanpercentile(values, 90.0)) / radiance.scale
    if level < MIN_CONTRAST_LEVELS or (np.isfinite(contrast) and contrast < MIN_CONTRAST_LEVELS):
        shown = min(level, contrast) if np.isfinite(contrast) else level
        return [f"too little contrast of shadow and board: {max(shown, 0.0):.1f} grey levels of 255, 2 are needed"]
    if lights >= MIN_LIGHTS:
        return ["too little of its shadows is in view to fit a ball to them"]
    return [f"fewer than 2 usable lights ({lights}): shadows hidden, outside the image, or none cast by so flat a bump"]
