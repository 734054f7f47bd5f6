"""From measured balls to a verdict on the part."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bgars.files.light_names import light_name
from bgars.inspection.coplanarity import Coplanarity, measure_coplanarity, seating_budget
from bgars.inspection.decision import COVERAGE_FACTOR, worst
from bgars.inspection.judge_ball import Position, judge_ball
from bgars.inspection.judge_part import part_checks, part_reasons
from bgars.inspection.lens_scale import PIXEL_PITCH
from bgars.inspection.odd_sizes import odd_sizes
from bgars.inspection.on_grid import finite_centres, is_seen, lay_grid, like_turn_deg, true_positions
from bgars.inspection.places import Slot, match_balls
from bgars.inspection.position import GridFit
from bgars.inspection.to_scale import lens_scale, to_scale
from bgars.inspection.warpage import board_height_um, board_terms, warpage
from bgars.records.ball_result import BallResult
from bgars.records.input_file import InputFile
from bgars.records.part_result import PartResult
from bgars.records.seating_result import SeatingResult

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from bgars.records.found_balls import FoundBalls
    from bgars.records.measured_balls import BallMeasurement
    from bgars.records.part_recipe import PartRecipe

    Array = NDArray[np.float64]

__all__ = ["judge_part"]

OWN_PITCH = "no recipe: true positions are against a grid of the part's own pitch"
MIN_ROCKING = 2
"""A part with two seating planes rocks."""
EACH_BALL = "each ball by itself"
MAX_LIGHT_CHANGE_DEG = 5.0
"""Beyond this nothing that rests on the lights may pass."""


def judge_part(
    found: FoundBalls,
    measurement: BallMeasurement,
    recipe: PartRecipe | None = None,
    *,
    name: str = "part",
    pixel_pitch_um: float = math.nan,
    files: Sequence[tuple[str, str]] = (),
    version: str = "",
    light_files: Sequence[str] = (),
    warnings: tuple[str, ...] = (),
) -> PartResult:
    """Judge a measured part.

    Parameters
    ----------
    found : FoundBalls
        The balls in the image, missing places, bridges.
    measurement : BallMeasurement
        What was measured of them.
    recipe : PartRecipe, optional
        Layout and limits. Without one, missing, extra and bridged balls still fail, and everything else is undecided.
    name : str
        Of the part, where there is no recipe.
    pixel_pitch_um, files, version
        Copied into the result.
    light_files : sequence of str
        Image file of each light, for reasons.
    warnings : tuple of str
        Put before those of the measurement.

    Returns
    -------
    PartResult

    Raises
    ------
    InputError
        Records that do not belong together.
    """
    slots = match_balls(found, measurement, recipe)
    pitch_um, u_pitch_um = _pitch(lay_grid(slots, recipe)[0], recipe, measurement)
    lens = lens_scale(slots, measurement, recipe)
    if lens is not None:
        measurement = to_scale(measurement, lens)
        slots = match_balls(found, measurement, recipe)
    fit, nominal_um = lay_grid(slots, recipe)
    coplanarity, rows, budget = _coplanarity(slots, measurement, recipe, fit, nominal_um)
    limits = None if recipe is None else recipe.limits
    names = {
        slot.name: slot.name if recipe is None else recipe.name_of(slot.name, slot.row, slot.col) for slot in slots
    }
    doubts = (*_strayed_lights(measurement.light_change_deg, light_files), *measurement.doubts)
    enough = is_seen(slots)
    positions = true_positions(slots, nominal_um, measurement)
    balls = []
    for index, (slot, position) in enumerate(zip(slots, positions, strict=True)):
        partners = tuple(names.get(each, each) for each in _partners(slot.name, found.bridges))
        verdict, reasons = judge_ball(slot, position, limits, partners, doubts, is_seen=enough)
        ball = _ball(slot, names[slot.name], nominal_um[index], position)
        balls.append(replace(ball, verdict=verdict, reasons=reasons))
    balls = _with_deviations(balls, rows, coplanarity)
    warpage_um, u_warpage_um = warpage(
        measurement.board_coefficients_um, measurement.board_covariance, finite_centres(slots)
    )
    unmeasured = [
        names[slot.name]
        for index, slot in enumerate(slots)
        if (slot.found or slot.unclear) and slot.kind != "extra" and index not in rows
    ]
    checks = part_checks(coplanarity, (pitch_um, u_pitch_um), (warpage_um, u_warpage_um), limits, unmeasured=unmeasured)
    bridges = tuple((names.get(one, one), names.get(two, two)) for one, two in found.bridges)
    verdicts = [ball.verdict for ball in balls] + [check.verdict for check in checks if check.verdict is not None]
    if bridges:
        verdicts.append("fail")
    if doubts or not limits or not enough:
        verdicts.append("undecided")
    return PartResult(
        name=name if recipe is None else recipe.name,
        balls=tuple(balls),
        verdict=worst(verdicts),
        reasons=(
            *part_reasons(balls, checks, bridges, has_limits=bool(limits), is_seen=enough, doubts=doubts),
            *doubts,
        ),
        pitch_um=pitch_um,
        u_pitch_um=u_pitch_um,
        grid_angle_deg=math.nan if fit is None else math.degrees(fit.angle_rad),
        seating_coplanarity_um=coplanarity.seating_um,
        u_seating_coplanarity_um=coplanarity.u_seating_um,
        seating_noise_bias_um=coplanarity.seating_bias_um,
        regression_coplanarity_um=coplanarity.regression_um,
        u_regression_coplanarity_um=coplanarity.u_regression_um,
        regression_noise_bias_um=coplanarity.regression_bias_um,
        warpage_um=warpage_um,
        u_warpage_um=u_warpage_um,
        seatings=_seatings(coplanarity, [balls[index].name for index in rows]),
        checks=checks,
        bridges=bridges,
        light_directions=measurement.light_directions,
        light_change_deg=measurement.light_change_deg,
        board_coefficients_um=measurement.board_coefficients_um,
        shadow_residual_rms=measurement.shadow_residual_rms,
        seating_budget=budget,
        warnings=(*warnings, *measurement.warnings, *_own_warnings(recipe, fit, coplanarity, balls)),
        recipe=recipe,
        pixel_pitch_um=pixel_pitch_um,
        files=tuple(InputFile(*file) for file in files),
        version=version,
    )


def _with_deviations(balls: list[BallResult], rows: Sequence[int], coplanarity: Coplanarity) -> list[BallResult]:
    """The balls with the distances of their tops below both planes; `rows` are the balls of those planes."""
    judged = list(balls)
    for row, index in enumerate(rows):
        if coplanarity.seating:
            seat_um = float(coplanarity.seating[0].deviations_um[row])
            judged[index] = replace(judged[index], seating_deviation_um=seat_um)
        if coplanarity.regression is not None:
            deviation_um = float(coplanarity.regression.deviations_um[row])
            judged[index] = replace(judged[index], regression_deviation_um=deviation_um)
    return judged


def _seatings(coplanarity: Coplanarity, names: list[str]) -> tuple[SeatingResult, ...]:
    """The planes on which the part comes to rest; `names` are those of their balls."""
    return tuple(
        SeatingResult(
            tuple(names[touching] for touching in plane.balls),
            plane.coplanarity_um,
            plane.slope_x,
            plane.slope_y,
            plane.offset_um,
        )
        for plane in coplanarity.seating
    )


def _own_warnings(
    recipe: PartRecipe | None, fit: GridFit | None, coplanarity: Coplanarity, balls: list[BallResult]
) -> list[str]:
    warnings = [OWN_PITCH] if recipe is None and fit is not None else []
    if recipe is None or recipe.limits.diameter_um is None:
        warnings += odd_sizes([ball.name for ball in balls], [ball.diameter_um for ball in balls])
    count = len(coplanarity.seating)
    if count >= MIN_ROCKING and _rocks(coplanarity):
        warnings.append(f"the part can rock between {count} seating planes; the worst is judged")
    turn_deg = None if recipe is None or fit is None else math.degrees(fit.angle_rad)
    other_deg = None if recipe is None or turn_deg is None else like_turn_deg(recipe, turn_deg)
    if other_deg is not None:
        warnings.append(
            f"the part is turned by {turn_deg:.1f} degrees, and its layout looks the same at {other_deg:.1f}: balls "
            "are named by the smaller turn; lay the part within 40 degrees, or names may be those of other balls"
        )
    return warnings


def _rocks(coplanarity: Coplanarity) -> bool:
    """Whether the seating planes differ by more than the uncertainty of the coplanarity, where it is known."""
    deviations_um = np.array([plane.deviations_um for plane in coplanarity.seating])
    u_um = coplanarity.u_seating_um
    return not float(np.ptp(deviations_um, axis=0).max()) <= COVERAGE_FACTOR * u_um


def _strayed_lights(change_deg: Array, files: Sequence[str]) -> list[str]:
    """Lights that the shadows put elsewhere: a wrong rig, or an image under another light's name."""
    return [
        f"{light_name(index, files)} stands {change:.1f} degrees off its direction in the rig, by its shadows; over "
        f"{MAX_LIGHT_CHANGE_DEG:g} degrees the rig or the pairing of images and lights is wrong"
        for index, change in enumerate(change_deg)
        if change > MAX_LIGHT_CHANGE_DEG
    ]


def _pitch(fit: GridFit | None, recipe: PartRecipe | None, measurement: BallMeasurement) -> tuple[float, float]:
    """Pitch by the declared size of a pixel, not by the recipe's grid, and its standard uncertainty."""
    if fit is None or (recipe is not None and recipe.layout.pitch_um is None):
        return math.nan, math.nan
    unit_um = 1.0 if recipe is None else float(recipe.layout.pitch_um or math.nan)
    u_pixel = PIXEL_PITCH.spread if measurement.u_pixel_pitch is None else measurement.u_pixel_pitch
    u_scale = math.hypot(fit.u_free_scale, fit.free_scale * u_pixel)
    return fit.free_scale * unit_um, u_scale * unit_um


def _coplanarity(
    slots: tuple[Slot, ...],
    measurement: BallMeasurement,
    recipe: PartRecipe | None,
    fit: GridFit | None,
    nominal_um: Array,
) -> tuple[Coplanarity, list[int], dict[str, float]]:
    """Coplanarity of the apexes in the world, the slots that have one, and the budget of the seating one."""
    coefficients_um = measurement.board_coefficients_um
    rows, tops = [], []
    for index, slot in enumerate(slots):
        ball = slot.measured
        if ball is not None and slot.kind != "extra" and np.isfinite([ball.x_um, ball.y_um, ball.top_um]).all():
            rows.append(index)
            tops.append((ball.x_um, ball.y_um, ball.top_um, ball.u_x_um, ball.u_y_um, ball.u_top_um))
    table = np.array(tops, dtype=np.float64).reshape(-1, 6)
    if not np.isfinite(coefficients_um[1:]).all():
        rows, table = [], table[:0]
    apexes_um, u_um = table[:, :3].copy(), table[:, 3:].copy()
    if rows:
        apexes_um[:, 2] += board_height_um(coefficients_um, table[:, 0], table[:, 1])
        u_um[:, 2] = np.hypot(u_um[:, 2], _u_board_um(measurement, table))
    gravity_um = _gravity_um(recipe, fit, nominal_um, slots)
    if not np.isfinite(gravity_um).all():  # a single ball, or a single whole one
        apexes_um, u_um, gravity_um = apexes_um[:0], u_um[:0], np.zeros(2)
    shared_um = None
    if rows and measurement.shared_um:
        places = {ball.name: place for place, ball in enumerate(measurement.balls)}
        shared_um = measurement.shared_um["top_um"][[places[slots[index].name] for index in rows]]
        u_um[:, 2] = np.sqrt(np.maximum(np.square(u_um[:, 2]) - np.square(shared_um).sum(axis=1), 0.0))
    if len(apexes_um) != len(rows):
        shared_um = None
    coplanarity = measure_coplanarity(apexes_um, u_um, gravity_um, shared_um)
    if shared_um is None:
        return coplanarity, rows, {}
    causes = measurement.causes
    return coplanarity, rows, seating_budget(coplanarity, apexes_um, gravity_um, shared_um, causes, EACH_BALL)


def _u_board_um(measurement: BallMeasurement, table: Array) -> Array:
    """(n,) standard uncertainty of the board's bend under the balls; its tilt moves no apex against the planes."""
    covariance = measurement.board_covariance
    if covariance is None:
        return np.zeros(len(table))
    terms = board_terms(table[:, 0], table[:, 1])
    scale = np.abs(terms).max(axis=0)
    plane = terms[:, :3] / np.where(scale[:3] > 0, scale[:3], 1.0)
    bend = terms[:, 3:] - plane @ np.linalg.lstsq(plane, terms[:, 3:], rcond=None)[0]
    variance: Array = np.einsum("ni,ij,nj->n", bend, covariance[3:, 3:], bend)
    return np.sqrt(np.maximum(variance, 0.0))


def _gravity_um(recipe: PartRecipe | None, fit: GridFit | None, nominal_um: Array, slots: tuple[Slot, ...]) -> Array:
    """Centre of gravity in the image: as the recipe says, else the mean of all places."""
    if recipe is not None and recipe.gravity_um is not None and fit is not None:
        x_um, y_um = recipe.gravity_um
        return fit.place(np.array([x_um if recipe.view == "bottom" else -x_um, y_um]))
    on_layout = np.array([slot.nominal is not None for slot in slots], dtype=np.bool_)
    places_um = nominal_um[on_layout]
    return places_um.mean(axis=0) if len(places_um) else np.full(2, math.nan)


def _partners(name: str, bridges: tuple[tuple[str, str], ...]) -> tuple[str, ...]:
    return tuple(two if one == name else one for one, two in bridges if name in {one, two})


def _ball(slot: Slot, name: str, nominal_um: Array, position: Position) -> BallResult:
    """The readings of a ball, not judged yet."""
    result = BallResult(
        name,
        slot.row,
        slot.col,
        slot.found,
        "undecided",
        (),
        kind=slot.kind,
        x_nominal_um=float(nominal_um[0]),
        y_nominal_um=float(nominal_um[1]),
        true_position_um=position.distance_um,
        u_true_position_um=position.u_um,
    )
    ball = slot.measured
    if ball is None:
        return result
    return replace(
        result,
        x_um=ball.x_um,
        u_x_um=ball.u_x_um,
        y_um=ball.y_um,
        u_y_um=ball.u_y_um,
        diameter_um=ball.diameter_um,
        u_diameter_um=ball.u_diameter_um,
        centre_z_um=ball.centre_z_um,
        u_centre_z_um=ball.u_centre_z_um,
        top_um=ball.top_um,
        u_top_um=ball.u_top_um,
        aspect_ratio=ball.aspect_ratio,
        u_aspect_ratio=ball.u_aspect_ratio,
        flat_top_depth_um=ball.flat_top_depth_um,
        u_flat_top_depth_um=ball.u_flat_top_depth_um,
        lights_used=ball.lights_used,
        budget=ball.budget,
    )
