"""What balls in captures show: highlights or shading of every light, before lights are fitted to all of them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bgars.errors import CalibrationError, InputError
from bgars.files.light_names import light_name
from bgars.station.balls_seen import given_outlines, outlines_of
from bgars.station.levels import linear_levels
from bgars.station.matt_lights import shading_on
from bgars.station.mirror import image_of, sphere_of_outline
from bgars.station.mirror_lights import highlights_on

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from bgars.records.capture import Capture
    from bgars.records.remark import Remark
    from bgars.station.levels import Levels
    from bgars.station.matt_lights import Near, SeenShading
    from bgars.station.outline import Outline

__all__ = ["Observed", "SeenBall", "observe", "outlines_a_capture"]

Array = NDArray[np.float64]

ZENITH = 1e-9


class SeenBall(NamedTuple):
    """A ball, and where its highlights are, with covariances; of matt balls as a mirror would show them."""

    capture: Capture
    outline: Outline
    places: Array
    covariances: Array
    own_deg: Array | None = None
    u_outline_px: Array | None = None
    near: Near | None = None
    """Of matt balls: the ball's radius over the distance of the lamps."""


class Observed(NamedTuple):
    """All balls of all captures."""

    balls: list[SeenBall]
    levels: list[Levels]
    strengths: list[Array]
    lamp_deg: float
    camera_px: float
    findings: list[Remark]


def observe(
    captures: list[Capture],
    sphere: str,
    outlines: Sequence[Array | None],
    diameter_um: float | None,
    progress: Callable[[float], object] | None,
) -> Observed:
    """Find the balls of every capture, and on each what every light shows.

    Raises
    ------
    CalibrationError
        No ball, or a light that shows on none.
    """
    balls: list[SeenBall] = []
    findings: list[Remark] = []
    levels_of: list[Levels] = []
    strengths: list[Array] = []
    lamps: list[Array] = []
    for index, (one, given) in enumerate(zip(captures, outlines, strict=True)):
        levels = linear_levels(one)
        levels_of.append(levels)
        found, said = outlines_of(one, levels, given, matt=sphere == "matt")
        findings += said
        for ball in found:
            camera_px = _camera_px(one, ball, diameter_um)
            if sphere == "mirror":
                seen = highlights_on(one, levels, ball, camera_px)
                balls.append(SeenBall(one, ball, seen.places_px, seen.covariances_px2))
                findings += seen.findings
                lamps.append(seen.lamp_deg)
                strengths.append(seen.flux)
            else:
                shading = shading_on(one, levels, ball, camera_px)
                findings += shading.findings
                strengths.append(shading.strengths)
                balls.append(_as_highlights(one, ball, shading, camera_px))
        if progress is not None:
            progress((index + 1) / len(captures))
    _need_all(balls, captures)
    camera_px = _camera_px(captures[0], balls[0].outline, diameter_um)
    known = [lamp[np.isfinite(lamp)] for lamp in lamps]
    lamp_deg = float(np.median(np.concatenate(known))) if known and sum(map(len, known)) else math.nan
    return Observed(balls, levels_of, strengths, lamp_deg, camera_px, findings)


def outlines_a_capture(
    captures: list[Capture], outline: ArrayLike | Sequence[ArrayLike | None] | None
) -> list[Array | None]:
    """Outlines that the caller gives for each capture, one list a capture; captures must have equally many images."""
    if not captures:
        msg = "capture: must be one capture or more, got none"
        raise InputError(msg)
    counts = [len(capture.images) for capture in captures]
    if len(set(counts)) > 1:
        odd = next(index for index, count in enumerate(counts) if count != counts[0])
        msg = (
            f"capture: {captures[odd].name} has {counts[odd]} images, {captures[0].name} has {counts[0]}: one a "
            "light, in one order"
        )
        raise InputError(msg)
    if outline is None:
        return [None] * len(captures)
    if len(captures) == 1:
        return [given_outlines(cast("ArrayLike", outline))]
    entries = cast("Sequence[ArrayLike | None]", outline)
    if len(entries) != len(captures):
        msg = f"outline: must have one entry for each of the {len(captures)} captures, got {len(entries)}"
        raise InputError(msg)
    return [given_outlines(one) for one in entries]


def _camera_px(capture: Capture, outline: Outline, diameter_um: float | None) -> float:
    """Distance of the camera in pixels; infinite where it is not known."""
    pitch_um = capture.pixel_pitch_um if diameter_um is None else diameter_um / (2.0 * outline.radius_px)
    if capture.camera_distance_mm is None or pitch_um is None:
        return math.inf
    return 1000.0 * capture.camera_distance_mm / pitch_um


def _as_highlights(capture: Capture, outline: Outline, shading: SeenShading, camera_px: float) -> SeenBall:
    """Lights of a matt ball, written as the highlights that a mirror of its place would show.

    The outline's errors move both, by different amounts; the difference is added to the covariance of each light.
    """
    directions, own = shading.directions, shading.own_covariances
    sphere = sphere_of_outline(outline.circle_px, camera_px)

    def seen(of: Array) -> Array:
        return image_of(of, np.zeros(len(of)), sphere, camera_px)

    places = seen(directions)
    covariances = np.zeros((len(directions), 2, 2))
    for index, direction in enumerate(directions):
        level = np.cross([0.0, 0.0, 1.0], direction)
        level = np.array([1.0, 0.0, 0.0]) if np.linalg.norm(level) < 1e-9 else level / np.linalg.norm(level)  # noqa: PLR2004
        across = np.stack([level, np.cross(direction, level)])
        step = 1e-4
        ahead = direction + step * across
        ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
        to_px = (seen(ahead) - places[index]).T / step
        by_outline = across @ shading.outline_jacobians[index] * outline.u_px
        # A highlight that moves with the outline stands for a direction that stays: only the rest is an error.
        covariance = own[index] + by_outline @ by_outline.T
        covariances[index] = to_px @ covariance @ to_px.T
    fixed = type(outline)(
        outline.x_px, outline.y_px, outline.radius_px, 1e-6, 1e-6, outline.edge_px, outline.arc, outline.given
    )
    own_deg = np.degrees(np.sqrt(0.5 * np.trace(own, axis1=1, axis2=2)))
    return SeenBall(capture, fixed, places, covariances, own_deg, outline.u_px, shading.near)


def _need_all(balls: list[SeenBall], captures: list[Capture]) -> None:
    seen = np.array([np.isfinite(ball.places).all(axis=1) for ball in balls]).any(axis=0)
    if not seen.all():
        missing = [light_name(int(index), captures[0].files) for index in np.flatnonzero(~seen)]
        shown = ", ".join(missing[:4]) + (", ..." if len(missing) > 4 else "")  # noqa: PLR2004
        msg = f"{captures[0].name}: {shown}: no highlight on {'the ball' if len(balls) == 1 else 'any ball'}"
        raise CalibrationError(msg)
