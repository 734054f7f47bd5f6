"""From fitted shadows to records: micrometres, uncertainties, and reasons where something was not measured."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bgars.ball_records import BallMeasurement, MeasuredBall
from bgars.inspection.bundle import angles_rad
from bgars.inspection.highlights import sharpen_centres
from bgars.inspection.plateaus import edge_bias_px
from bgars.inspection.radii import sharpen_radii
from bgars.inspection.shape_or_lights import shape_or_lights, silhouettes_or_shadows
from bgars.inspection.spread import SHARP_PX
from bgars.light_names import light_name

if TYPE_CHECKING:
    from bgars.ball_records import FoundBall, FoundBalls
    from bgars.inspection.bundle import Solution
    from bgars.inspection.flat_top import FlatTops
    from bgars.inspection.highlights import Highlights
    from bgars.inspection.problem import Problem
    from bgars.inspection.shadow_edges import Edges
    from bgars.inspection.shadow_fit import Fit

__all__ = ["Usability", "judge_balls", "measurement"]

Array = NDArray[np.float64]

MIN_STRETCHES = 4
"""Measured stretches of edge that make a shadow usable."""
MIN_LIGHTS = 2
MIN_CONTRAST_LEVELS = 1.5
"""Contrast of lit and shadowed board, in grey levels of 255, that is too little: it rounds to less than 2."""
MIN_CONTRAST_NOISE = 0.7
FLAT_SIGMAS = 3.0
FLAT_SHARE = 0.01
"""A flat top is taken off the height where it is significant and more than this share of the radius."""
POOR_SHARE = 0.02
MANY_OUTLIERS = 0.4
MODEL_CENTRE_PX, MODEL_RADIUS_PX = 0.0010, 0.0030
MODEL_HEIGHT_PER_RADIUS = -1.2
"""Scatter of simulated balls beyond the fit's own uncertainty (docs/make_inspection_accuracy.py prints both), for sharp
edges; it grows with the root of their spread. Height and radius err against each other: the tip of the shadow stays.
"""
MODEL_FLANK_PX, FLANK_SHARE = 0.001, 0.7
"""What edges between tip and side of a shadow are off by against both, and its share of what all edges are off by:
heights hang on that where the rig is free.
"""
GRID_SHARE = 0.1
"""The same of images of few samples a pixel: share of what points of edges scatter beyond their own uncertainty."""
CLIPPED_SHARE = 0.5
LIGHT_WARNING_DEG = 5.0


class Usability(NamedTuple):
    """(n,) whether a ball's shadows can be used, lights that show one, contrast in grey levels of 255."""

    usable: NDArray[np.bool_]
    lights: NDArray[np.intp]
    contrast_levels: Array


def judge_balls(edges: Edges) -> Usability:
    """Which balls have shadows enough, and contrast enough."""
    known = np.isfinite(edges.u_px)
    count = known.sum(axis=2)
    total = np.where(known, edges.contrast_levels, 0.0).sum(axis=2)
    contrast = total / np.maximum(count, 1)
    seen = count >= MIN_STRETCHES
    strong = seen & (contrast >= MIN_CONTRAST_NOISE * edges.noise_levels)
    mean = np.where(seen, contrast, 0.0).sum(axis=1) / np.maximum(seen.sum(axis=1), 1)
    usable = (strong.sum(axis=1) >= MIN_LIGHTS) & (mean >= MIN_CONTRAST_LEVELS)
    return Usability(usable, strong.sum(axis=1), np.where(seen.any(axis=1), mean, np.nan))


def measurement(
    found: FoundBalls, problem: Problem, fit: Fit | None, flats: FlatTops | None, highlights: Highlights | None
) -> BallMeasurement:
    """Put everything into records."""
    pitch = problem.pitch_um
    unit = problem.vectors / np.linalg.norm(problem.vectors, axis=1, keepdims=True)
    solution = None if fit is None else fit.solution
    looked_at = {} if fit is None else {int(ball): place for place, ball in enumerate(fit.index)}
    fitted: dict[int, int] = {}
    if fit is not None and solution is not None:
        fitted = {int(ball): place for place, ball in enumerate(fit.index[fit.usability.usable])}
        fit = _with_silhouettes(_with_highlights(fit, solution, highlights))
    balls = []
    for index, ball in enumerate(found.balls):
        if index in fitted and fit is not None:
            lights = int(fit.usability.lights[looked_at[index]])
            missing = highlights is not None and bool(highlights.missing[fitted[index]])
            balls.append(_measured(ball, fit, fitted[index], lights, flats, missing, pitch))
        else:
            balls.append(_unmeasured(ball, index, problem, fit, looked_at, pitch))
    if solution is None:
        warnings = () if fit is None else fit.warnings
        unknown = np.full(6, np.nan)
        return BallMeasurement(tuple(balls), unknown, unit, np.zeros(len(unit)), float("nan"), warnings)
    c1, c2, c3, c4, c5 = solution.board.coefficients
    moved = np.degrees(angles_rad(solution.vectors, problem.vectors))
    refined = solution.vectors / np.linalg.norm(solution.vectors, axis=1, keepdims=True)
    warnings = fit.warnings if fit is not None else ()
    files = problem.radiance.capture.files
    doubts = fit.doubts if fit is not None else ()
    doubts += shape_or_lights(solution.balls[:, 4], problem.vectors, solution.vectors)
    if fit is not None:
        doubts += silhouettes_or_shadows(problem.table[fit.index[fit.usability.usable], 3], solution.balls[:, 3])
    warnings += tuple(
        f"{light_name(light, files)}: its shadows say that it stands {moved[light]:.1f} degrees from where the rig says"
        for light in map(int, np.flatnonzero(moved > LIGHT_WARNING_DEG))
    )
    contrast = float(np.nanmedian(fit.edges.contrast_levels)) if fit is not None else float("nan")
    noise = float(np.sqrt(np.nanmean(np.square(fit.edges.noise_levels)))) if fit is not None else float("nan")
    return BallMeasurement(
        tuple(balls),
        np.array([0.0, c1, c2, c3 / pitch, c4 / pitch, c5 / pitch]),
        refined,
        moved,
        noise / contrast,
        warnings,
        board_covariance_um(solution.board_covariance, pitch),
        doubts,
    )


def board_covariance_um(covariance_px: Array, pitch_um: float) -> Array:
    """(6, 6) covariance of the board's coefficients over um; the constant is 0 by definition."""
    scale = np.array([1.0, 1.0, 1.0 / pitch_um, 1.0 / pitch_um, 1.0 / pitch_um])
    covariance = np.zeros((6, 6))
    covariance[1:, 1:] = covariance_px * np.outer(scale, scale)
    return covariance


def _with_highlights(fit: Fit, solution: Solution, highlights: Highlights | None) -> Fit:
    """The fit with centres sharpened by highlights."""
    if highlights is None:
        return fit
    u_centre = np.sqrt(np.stack([solution.covariance[:, 0, 0], solution.covariance[:, 1, 1]], axis=1))
    here = solution.balls[:, :2]
    u_common = np.sqrt(np.diag(solution.common_covariance)[:2])
    centres, u_sharp = sharpen_centres(highlights, here, here, u_centre, u_common)
    balls, covariance = solution.balls.copy(), solution.covariance.copy()
    balls[:, :2] = centres
    for axis in (0, 1):
        share = u_sharp[:, axis] / u_centre[:, axis]
        covariance[:, axis, :] *= share[:, None]
        covariance[:, :, axis] *= share[:, None]
    return replace(fit, solution=replace(solution, balls=balls, covariance=covariance))


def _with_silhouettes(fit: Fit) -> Fit:
    """The fit with radii sharpened by silhouettes; its covariance holds what all balls have in common, too."""
    if fit.solution is None:
        return fit
    chosen = fit.index[fit.usability.usable]
    balls, covariance = sharpen_radii(fit.solution, fit.problem.table[chosen, 3], fit.problem.u_radius[chosen])
    bias_px = edge_bias_px(fit.problem.radiance, fit.edges, fit.spread.sharp_px)
    flank_px = np.hypot(MODEL_FLANK_PX * np.sqrt(fit.spread.sharp_px / SHARP_PX), FLANK_SHARE * bias_px)
    for size_px, response in ((bias_px, fit.solution.edge_response), (flank_px, fit.solution.flank_response)):
        together = size_px * response
        covariance += together[:, :, None] * together[:, None, :]
    covariance += _model_error(fit.spread.sharp_px, GRID_SHARE * fit.solution.excess_px)
    return replace(fit, solution=replace(fit.solution, balls=balls, covariance=covariance))


def _model_error(sharp_px: float, grid_px: float) -> Array:
    """(5, 5) covariance of what no residual shows: blurred texture, pixels that straddle an edge."""
    size = np.sqrt(sharp_px / SHARP_PX)
    centre, radius = size * MODEL_CENTRE_PX, size * MODEL_RADIUS_PX
    together = radius * np.array([0.0, 0.0, MODEL_HEIGHT_PER_RADIUS, 1.0, 0.0])
    covariance: Array = np.diag(np.square([centre, centre, grid_px, grid_px, 0.0])) + np.outer(together, together)
    return covariance


def _measured(
    ball: FoundBall, fit: Fit, place: int, lights: int, flats: FlatTops | None, missing: bool, pitch: float
) -> MeasuredBall:
    """A ball with its numbers."""
    solution = fit.solution
    assert solution is not None
    x, y, z, radius, q = solution.balls[place]
    covariance = solution.covariance[place]
    u = np.sqrt(np.diag(covariance))
    by_top = np.array([0.0, 0.0, 1.0, q, radius])
    u_top = float(np.sqrt(by_top @ covariance @ by_top))
    top = z + q * radius
    reasons = []
    flat, u_flat = float("nan"), float("nan")
    if flats is not None:
        flat, u_flat = float(flats.height_px[place]), float(flats.u_height_px[place])
        if np.isfinite(flat) and flat > FLAT_SIGMAS * u_flat and flat > FLAT_SHARE * radius:
            top -= flat
            u_top = float(np.hypot(u_top, u_flat))
            reasons.append(f"flat top: {flat * pitch:.0f} um are missing")
    elif missing:
        reasons.append("flat top, or of another material: its highlights are missing")
    known = np.isfinite(solution.residual_px[place])
    outliers = float((solution.weight[place][known] < 0.1).mean()) if known.any() else 1.0  # noqa: PLR2004
    if outliers > MANY_OUTLIERS:
        reasons.append(f"doubtful: {100 * outliers:.0f} % of its shadow's edge does not fit a ball")
    if u_top > POOR_SHARE * radius:
        reasons.append(f"doubtful: the height is uncertain by {u_top * pitch:.1f} um")
    return MeasuredBall(
        name=ball.name,
        row=ball.row,
        col=ball.col,
        x_um=float(x * pitch),
        y_um=float(y * pitch),
        diameter_um=float(2.0 * radius * pitch),
        centre_z_um=float(z * pitch),
        top_um=float(top * pitch),
        q=float(q),
        flat_um=flat * pitch,
        u_x_um=float(u[0] * pitch),
        u_y_um=float(u[1] * pitch),
        u_diameter_um=float(2.0 * u[3] * pitch),
        u_centre_z_um=float(u[2] * pitch),
        u_top_um=u_top * pitch,
        u_q=float(u[4]),
        u_flat_um=u_flat * pitch,
        lights_used=lights,
        kind=ball.kind,
        reasons=tuple(reasons),
    )


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
    return MeasuredBall(
        name=ball.name,
        row=ball.row,
        col=ball.col,
        x_um=ball.x_px * pitch,
        y_um=ball.y_px * pitch,
        diameter_um=2.0 * ball.radius_px * pitch,
        centre_z_um=nan,
        top_um=nan,
        q=nan,
        flat_um=nan,
        u_x_um=ball.u_centre_px * pitch,
        u_y_um=ball.u_centre_px * pitch,
        u_diameter_um=2.0 * ball.u_radius_px * pitch,
        u_centre_z_um=nan,
        u_top_um=nan,
        u_q=nan,
        u_flat_um=nan,
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
    return [f"fewer than 2 usable lights ({lights}): shadows hidden, outside the image or without an edge"]
