"""Lights calibrated on reference balls: one ball, several, or one that is moved from capture to capture."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import combinations
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bgars.errors import InputError
from bgars.files.light_names import light_name
from bgars.records.capture import Capture
from bgars.records.light_calibration import BallView, LightCalibration
from bgars.records.remark import Remark
from bgars.records.rig import STAND_IN_DEG, LightRig
from bgars.records.same_images import refuse_repeated, refuse_shared
from bgars.records.scalar_checks import check_pitch
from bgars.records.whole_capture import need_whole
from bgars.station.ball_diameter import need_diameter_of_scale
from bgars.station.believable import need_believable
from bgars.station.lamp_distance import LampDistance, learnt_distance, unknown_distance
from bgars.station.light_bundle import solve_lights
from bgars.station.mirror_lights import together
from bgars.station.observe import observe, outlines_a_capture
from bgars.station.strengths import strengths_of

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from bgars.station.light_bundle import LightSolution
    from bgars.station.observe import Observed, SeenBall

__all__ = ["Sphere", "calibrate_lights"]

Array = NDArray[np.float64]
Sphere = Literal["mirror", "matt"]

BALL_AGAIN = "photograph the ball once for each of its places"
MISFIT = 3.0
"""Reduced chi square from which on balls contradict each other."""
LENS_SHARE = 0.5
"""Share of an uncertainty by an unknown lens, or unknown distances of lamps, that is worth a word."""
OFF_SIGMAS = 5.0
WORTH_DEG = 0.1
"""Uncertainty of all lights together below which no second photograph is worth its work."""
UNSURE_DEG = 2.0
"""Standard uncertainty of a direction that is worth a word."""
FAR_DEG = 15.0
"""Turn of a light against the rig that the capture brings, from which on the order of the images is doubted."""
ONE_PLACE_DEG, ONE_PLACE_SIGMAS = (0.2, 1.0), 3.0
"""Two lamps this near each other are one that was fired twice: within three standard uncertainties, but not below the
width of the smallest LED, 1 mm at 300 mm, nor above what two housings need, 5 mm."""


def calibrate_lights(
    capture: Capture | Sequence[Capture],
    sphere: Sphere = "mirror",
    outline: ArrayLike | Sequence[ArrayLike | None] | None = None,
    *,
    near: bool | None = None,
    diameter_um: float | None = None,
    places_px: Array | None = None,
    progress: Callable[[float], object] | None = None,
) -> LightCalibration:
    """Find where the lights are, from a mirror or a matt ball in view: see :func:`bgars.calibrate_lights`.

    With `places_px` (L, 3), positions of near lights in pixels of the board, strengths are those of lamps there: what a
    single ball shows are directions, by which the light on board and ball does not fall off.

    Raises
    ------
    CalibrationError
        No ball, a ball that is cut off or overexposed, a light whose highlight is on no ball, or a direction at or
        below the board, or with an uncertainty beyond 10 degrees.
    InputError
        Captures with different numbers of images, the same image twice, an outline of a wrong shape, or a diameter
        that the scale contradicts.
    """
    captures = [capture] if isinstance(capture, Capture) else list(capture)
    for each in captures:
        need_whole(each)
        refuse_repeated(each)
    refuse_shared(captures, BALL_AGAIN)
    if sphere not in {"mirror", "matt"}:
        msg = f"sphere: must be 'mirror', 'matt' or 'balls', got {sphere!r}"
        raise InputError(msg)
    if sphere == "matt" and near:
        msg = "near: positions of lights need a mirror ball: shading does not say from which point a light is seen"
        raise InputError(msg)
    check_pitch(diameter_um, "diameter_um")
    for each in captures:
        _need_scale_of_camera(each, diameter_um)
    # A scale is known better than a diameter, which is then only compared with it.
    scaling_um = None if all(each.pixel_pitch_um is not None for each in captures) else diameter_um
    seen = observe(captures, sphere, outlines_a_capture(captures, outline), scaling_um, progress)
    if diameter_um is not None:
        need_diameter_of_scale(seen, diameter_um)
    balls, findings = seen.balls, seen.findings
    solution, pitch_um = _solve(captures, seen, scaling_um, near, findings)
    need_believable(solution, captures, sphere, findings)
    shone = solution if places_px is None else _placed(solution, places_px)
    strengths = strengths_of(sphere, captures, seen, shone, findings)
    rig = _rig(solution, pitch_um, strengths.relative)
    findings += together(_judge(solution, balls, captures, rig), captures[0].name, len(rig))
    own = solution.u_own_deg
    alone = [ball.own_deg for ball in balls if ball.own_deg is not None]
    if alone:
        own = np.minimum(np.sqrt(np.mean(np.square(alone), axis=0) / len(alone)), solution.u_deg)
    return LightCalibration(
        rig=rig,
        u_deg=solution.u_deg,
        u_own_deg=own,
        u_common_deg=np.sqrt(np.maximum(solution.u_deg**2 - own**2, 0.0)),
        sphere=sphere,
        balls=tuple(_views(balls, solution)),
        residual_px=_rms(solution.residuals_px),
        u_lens_deg=solution.u_lens_deg,
        u_distance_deg=solution.u_distance_deg,
        u_positions_um=_u_positions(solution, pitch_um),
        u_intensities=strengths.u,
        lamp_deg=seen.lamp_deg,
        level=strengths.level,
        level_by=strengths.by,
        pixel_pitch_um=None if rig.positions_um is None else pitch_um,
        size_px=captures[0].mask.shape,
        findings=tuple(findings),
    )


def _need_scale_of_camera(capture: Capture, diameter_um: float | None) -> None:
    """Refuse a camera at a distance in mm where no scale says how many pixels that is: it would count as infinite."""
    distance_mm = capture.camera_distance_mm
    if distance_mm is None or math.isinf(distance_mm):
        return
    if capture.pixel_pitch_um is None and diameter_um is None:
        msg = (
            f"{capture.name}: a camera at {distance_mm:g} mm needs a scale: calibrate it first, state pixel_pitch_um "
            "in capture.toml, or the diameter of the ball"
        )
        raise InputError(msg)


def _solve(
    captures: list[Capture],
    seen: Observed,
    diameter_um: float | None,
    near: bool | None,
    findings: list[Remark],
) -> tuple[LightSolution, float | None]:
    """Lights of all balls, and the pixel pitch that puts them in micrometres."""
    balls = seen.balls
    places = np.array([ball.places for ball in balls])
    covariances = np.array([ball.covariances for ball in balls])
    circles = np.array([ball.outline.circle_px for ball in balls])
    u_circles = np.array([ball.outline.u_px for ball in balls])
    # Nothing stated of the camera: it may be an ordinary one.
    unknown = captures[0].camera_distance_mm is None
    longer_px = float(max(captures[0].images.shape[1:]))
    side_px = longer_px if unknown else None
    lamps = _lamps(balls, near, captures[0].rig, longer_px)
    if lamps is not None and lamps.taken is not None:
        near = False
    solution = solve_lights(places, covariances, circles, u_circles, seen.camera_px, near, side_px, lamps)
    pitch_um = captures[0].pixel_pitch_um
    if diameter_um is not None:
        pitch_um = float(np.mean([diameter_um / (2.0 * circle[2]) for circle in solution.outlines_px]))
    if solution.nearness.any() and pitch_um is None:
        if near:
            msg = (
                f"{captures[0].name}: positions of lights need a scale: pixel_pitch_um in capture.toml, or "
                "diameter_um of the ball"
            )
            raise InputError(msg)
        message = (
            "the balls show that the lights are near, but no scale is known: state the diameter of the ball to get "
            "positions"
        )
        findings.append(Remark("doubt", message, "near-without-scale"))
        solution = solve_lights(places, covariances, circles, u_circles, seen.camera_px, False, side_px, lamps)
    return solution, pitch_um


def _lamps(balls: list[SeenBall], near: bool | None, rig: LightRig, side_px: float) -> LampDistance | None:
    """What is known of the distance that all lamps have in common; None of lamps that are stated to be distant."""
    learnt = np.array([[*ball.near[:2], ball.outline.radius_px] for ball in balls if ball.near is not None])
    if len(learnt):
        return learnt_distance(learnt[:, 0] / learnt[:, 2], learnt[:, 1] / learnt[:, 2])
    # A capture that gives its lights as directions states that they are distant, as to every other command.
    stated = rig.positions_um is None and (rig.u_deg is None or float(np.min(rig.u_deg)) < STAND_IN_DEG)
    return None if near is False or (near is None and stated) else unknown_distance(side_px)


def _rig(solution: LightSolution, pitch_um: float | None, intensities: Array) -> LightRig:
    if solution.nearness.any() and pitch_um is not None and (solution.nearness > 0).all():
        positions = solution.directions / solution.nearness[:, None] * pitch_um
        return LightRig.from_positions(positions, intensities=intensities, u_deg=solution.u_deg)
    return LightRig.from_directions(solution.directions, intensities=intensities, u_deg=solution.u_deg)


def _placed(solution: LightSolution, places_px: Array) -> LightSolution:
    """The solution with lights at known places."""
    distances = np.linalg.norm(places_px, axis=1)
    return replace(solution, directions=places_px / distances[:, None], nearness=1.0 / distances)


def _u_positions(solution: LightSolution, pitch_um: float | None) -> Array | None:
    if not solution.nearness.any() or pitch_um is None:
        return None
    found = np.zeros((len(solution.directions), 3))
    for index, (direction, w) in enumerate(zip(solution.directions, solution.nearness, strict=True)):
        columns = np.column_stack([*(solution.tangents[index] / w), -direction / w**2])
        found[index] = np.sqrt(np.diag(columns @ solution.covariance[index] @ columns.T))
    return found * pitch_um


def _judge(solution: LightSolution, balls: list[SeenBall], captures: list[Capture], rig: LightRig) -> list[Remark]:
    """What the result says about itself, and about the rig that was declared."""
    files = captures[0].files
    found = _judge_lens(solution, balls)
    if len(balls) > 1 and solution.reduced_chi_square > MISFIT:
        found.append(
            Remark(
                "doubt",
                f"the balls contradict each other: residuals of {_rms(solution.residuals_px):.2f} px are "
                f"{math.sqrt(solution.reduced_chi_square):.1f} times what was expected; uncertainties are raised "
                "by that",
                "balls-contradict",
                solution.reduced_chi_square,
                MISFIT,
            )
        )
        size = np.nanmax(np.linalg.norm(solution.residuals_px, axis=2), axis=0)
        usual = float(np.median(size))
        for index in np.flatnonzero(size > OFF_SIGMAS * usual):
            message = (
                f"{light_name(int(index), files)}: off by {size[index]:.2f} px between balls, others {usual:.2f} px"
            )
            found.append(
                Remark("doubt", message, "light-off", float(size[index]), OFF_SIGMAS * usual, "px", int(index))
            )
    # What comes from an unknown distance is alike in all lights, and said once.
    u_deg = solution.u_at_ball_deg
    for index in np.flatnonzero(u_deg > UNSURE_DEG):
        message = f"{light_name(int(index), files)}: its direction is known to {u_deg[index]:.1f} deg only"
        found.append(Remark("doubt", message, "unsure", float(u_deg[index]), UNSURE_DEG, "deg", int(index)))
    found += _judge_places(solution, files)
    declared = captures[0].rig
    if len(declared) == len(rig) and captures[0].folder is not None and declared.u_deg is None:
        turn = np.degrees(np.arccos(np.clip(declared.directions @ rig.directions.T, -1.0, 1.0)))
        off = np.diag(turn)
        nearest = turn.argmin(axis=1)
        if (
            (off > FAR_DEG).any()
            and len(set(nearest.tolist())) == len(rig)
            and turn.min(axis=1).max() < off.max() / 2.0
        ):
            first = int(np.flatnonzero(nearest != np.arange(len(rig)))[0])
            message = (
                f"images in another order than the lights of the capture: {light_name(first, files)} is declared where "
                f"light {int(nearest[first])} is"
            )
            found.append(Remark("note", message, "order", light=first))
    return found


def _judge_places(solution: LightSolution, files: Sequence[Path]) -> list[Remark]:
    """Lights that stand in one place: two photographs of one lamp."""
    found: list[Remark] = []
    for one, two in combinations(range(len(solution.directions)), 2):
        chord = float(np.linalg.norm(solution.directions[one] - solution.directions[two]))
        apart = math.degrees(2.0 * math.asin(min(chord / 2.0, 1.0)))
        limit = float(np.clip(ONE_PLACE_SIGMAS * math.hypot(*solution.u_own_deg[[one, two]]), *ONE_PLACE_DEG))
        if apart < limit:
            first, second = (light_name(each, files, what="image") for each in (one, two))
            message = (
                f"{first} and {second} show a lamp in the same place, {apart:.2f} deg "
                "apart: was one lamp fired twice, and another not at all?"
            )
            found.append(Remark("doubt", message, "one-lamp-twice", apart, limit, "deg", two))
    return found


def _judge_lens(solution: LightSolution, balls: list[SeenBall]) -> list[Remark]:
    """What a camera of which nothing is stated does to the result."""
    found: list[Remark] = []
    u_lens, u_distance = float(np.median(solution.u_lens_deg)), float(np.median(solution.u_distance_deg))
    if balls[0].near is None and u_distance > max(LENS_SHARE * float(np.median(solution.u_deg)), WORTH_DEG):
        message = (
            f"nothing is known of the lamps' distance, which leaves {u_distance:.2f} deg of the "
            f"{float(np.median(solution.u_deg)):.2f} deg of uncertainty, alike in all lights (lamps at 10 sides of the "
            "image); photograph the ball at three places, or state --distant if they stand at 100 sides or more"
        )
        found.append(Remark("note", message, "distance-unknown", u_distance, None, "deg"))
    if u_lens > LENS_SHARE * float(np.median(solution.u_at_ball_deg)):
        message = (
            f"nothing is stated of the camera: a lens that is not telecentric leaves {u_lens:.2f} deg of the "
            f"{float(np.median(solution.u_deg)):.2f} deg of uncertainty; state camera in capture.toml, or --camera"
        )
        found.append(Remark("note", message, "camera-unknown", u_lens, None, "deg"))
    if len(balls) > 1:
        views = solution.views_deg - solution.views_deg.mean(axis=0)
        size, expected = np.hypot(*views.T), np.maximum(solution.u_views_deg, 0.05)
        worst = int((size / expected).argmax())
        if size[worst] > MISFIT * expected[worst]:
            message = (
                f"the balls are seen from sides that differ by about {2.0 * size[worst]:.1f} deg: an ordinary lens "
                "near by, or pictures cut from larger ones; state the camera, and give whole images"
            )
            limit = float(MISFIT * expected[worst])
            found.append(Remark("doubt", message, "views-differ", float(size[worst]), limit, "deg"))
    return found


def _views(balls: list[SeenBall], solution: LightSolution) -> list[BallView]:
    return [
        BallView(
            ball.capture.name,
            circle,
            ball.outline.u_px if ball.u_outline_px is None else ball.u_outline_px,
            ball.places,
            residuals,
        )
        for ball, circle, residuals in zip(balls, solution.outlines_px, solution.residuals_px, strict=True)
    ]


def _rms(residuals: Array) -> float:
    return float(np.sqrt(np.nanmean(np.square(residuals).sum(axis=2))))
