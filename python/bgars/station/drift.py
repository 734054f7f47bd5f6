"""What moved since a station was calibrated: the same reference, photographed again."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bgars.errors import InputError
from bgars.files.light_names import light_name
from bgars.records.remark import Remark, Severity
from bgars.records.station_apply import flat_maps
from bgars.station.flat import calibrate_flat
from bgars.station.lights import calibrate_lights
from bgars.station.strengths import repeatable

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from bgars.records.capture import Capture
    from bgars.records.light_calibration import LightCalibration
    from bgars.records.station import Station

__all__ = ["COMPARED", "drift"]

Array = NDArray[np.float64]

COVERAGE = 2.0
"""Standard uncertainties, of both calibrations together, that a difference may have."""
LIMIT_DEG, LIMIT_INTENSITY, LIMIT_EVENNESS = 0.5, 0.05, 0.03
"""What may change beside that: directions in degrees, intensities and evenness as shares."""
LIMIT_LEVEL = 0.1
"""All lights alike: LEDs lose some per cent while they warm up, which costs noise and bends nothing; a changed exposure
or lens aperture is more."""
LIMIT_SCALE = 0.005
"""Magnification: heights and diameters change by the same share, 1.5 um of 300 um."""
SAME_BALL = 0.02
"""Spread of the radii of a calibration's balls, of their mean, up to which they are one ball or alike."""
COMPARED = frozenset({"light-moved", "light-strength", "level", "scale", "evenness"})
"""Codes of remarks that compare something with its limit."""


def drift(
    station: Station,
    capture: Capture,
    *,
    reference: str | None = None,
    outline: ArrayLike | None = None,
    limit_deg: float = LIMIT_DEG,
    limit_intensity: float = LIMIT_INTENSITY,
) -> tuple[Remark, ...]:
    """Compare a station with a new capture of its reference.

    Parameters
    ----------
    station : Station
        As calibrated.
    capture : Capture
        The reference now, read without the station's corrections.
    reference : {"mirror", "matt", "flat"}, optional
        What is in view; by default the ball that the station's lights were calibrated with, else a flat board.
    outline : (3,) array_like, optional
        Of the ball; see :func:`bgars.calibrate_lights`.
    limit_deg, limit_intensity : float
        What a light may move, and change in strength (a share), beside twice its uncertainty.

    Returns
    -------
    tuple of Remark
        One for each light and quantity, and for level and scale: "fail" beyond the limit, "note" within; `value` is in
        `unit`. A note "not-compared" names what the station file, or this reference, cannot tell.

    Raises
    ------
    InputError
        The station has no such calibration, or another number of lights.
    CalibrationError
        See :func:`bgars.calibrate_lights` and :func:`bgars.calibrate_flat`.
    """
    kind = reference or (station.lights.sphere if station.lights is not None else "flat")
    if kind == "balls":
        msg = (
            f"{station.name}: its lights were calibrated on the balls of a part: calibrate them again, or give "
            "reference 'mirror', 'matt' or 'flat' with a capture of that"
        )
        raise InputError(msg)
    if kind == "flat":
        return _even(station, capture, limit_intensity)
    if station.lights is None:
        msg = f"station: {station.name} has no calibrated lights to compare with"
        raise InputError(msg)
    before = station.lights
    if len(capture.images) != len(before.rig):
        msg = f"{capture.name}: {len(capture.images)} images, but {station.name} has {len(before.rig)} lights"
        raise InputError(msg)
    pitch_um = _pitch_of(station, capture)
    places_um = before.rig.positions_um
    placed = None if places_um is None or pitch_um is None else places_um / pitch_um
    now = calibrate_lights(capture, kind, outline, near=False, places_px=placed)  # type: ignore[arg-type]
    if places_um is not None and placed is None:
        # Seen from the side where a ball lies, near lamps are elsewhere, and as strong as the board there says.
        words = (
            "not compared: directions and strengths of near lamps, and their level (no pixel pitch is known: calibrate "
            "the scale, or the lights again)"
        )
        return (*now.findings, *_of_all(replace(before, level_by=""), now), Remark("note", words, "not-compared"))
    return (*now.findings, *_of_each(before, now, placed, capture, limit_deg, limit_intensity), *_of_all(before, now))


def _of_each(
    before: LightCalibration,
    now: LightCalibration,
    placed: Array | None,
    capture: Capture,
    limit_deg: float,
    limit_intensity: float,
) -> list[Remark]:
    """Compare direction and strength of each light; near ones are at `placed` (L, 3), in pixels of the board."""
    found: list[Remark] = []
    seen_from, u_parallax_deg = _origins(before, placed, now)
    turn_deg = np.degrees(
        2.0 * np.arcsin(np.clip(np.linalg.norm(now.rig.directions - seen_from, axis=1) / 2.0, 0.0, 1.0))
    )
    # What an unknown lens, or distance of the lamps, does to both calibrations is alike, and no drift.
    u_deg = np.sqrt(_of_its_own(before) ** 2 + _of_its_own(now) ** 2 + u_parallax_deg**2) * math.sqrt(2.0)
    change = _against_others(now.rig.intensities / before.rig.intensities)
    u_before, u_now = _u_strengths(before, now)
    for index in range(len(before.rig)):
        name = light_name(index, capture.files)
        limit = limit_deg + COVERAGE * float(u_deg[index])
        moved = float(turn_deg[index])
        words = f"{name}: moved by {moved:.2f} deg since calibration (limit {limit:.2f} deg)"
        found.append(Remark("fail" if moved > limit else "note", words, "light-moved", moved, limit, "deg", index))
        if u_before is not None and u_now is not None:
            limit = limit_intensity + COVERAGE * math.hypot(u_before[index], u_now[index])
            words = (
                f"{name}: {100 * change[index]:+.1f} % in strength against the other lights (limit {100 * limit:.1f} %)"
            )
            severity: Severity = "fail" if abs(change[index]) > limit else "note"
            found.append(Remark(severity, words, "light-strength", float(change[index]), limit, "", index))
    return found


def _of_all(before: LightCalibration, now: LightCalibration) -> list[Remark]:
    """Compare what all lights share: their level, and the size of the ball in pixels."""
    found, missing = [], []
    if before.level_by == now.level_by and before.level > 0 and now.level > 0:
        u = math.hypot(*(0.0 if each is None else float(each.mean()) for each in _u_strengths(before, now)))
        found.append(_level(now.level / before.level - 1.0, LIMIT_LEVEL + COVERAGE * u))
    elif before.level_by and now.level_by:
        missing.append(f"the level of all lights ({before.level_by} at calibration, {now.level_by} now)")
    else:
        when = "now" if before.level_by else "in the station file"
        missing.append(f"the level of all lights (none {when})")
    circles = np.array([ball.outline_px for ball in before.balls])
    if not len(circles):
        missing.append("the magnification (no outline in the station file)")
    elif np.ptp(circles[:, 2]) > SAME_BALL * circles[:, 2].mean():
        missing.append("the magnification (calibrated on balls of different sizes)")
    else:
        ball = now.balls[0]
        x, y, radius = ball.outline_px
        change = float(radius / circles[:, 2].mean()) - 1.0
        # The outline of the calibration was known about as well as this one.
        limit = LIMIT_SCALE + COVERAGE * math.sqrt(2.0) * float(ball.u_outline_px[2] / radius)
        words = (
            f"the ball's diameter in pixels changed by {100 * change:+.2f} % (limit {100 * limit:.2f} %): the "
            "magnification, unless it is another ball"
        )
        found.append(Remark("fail" if abs(change) > limit else "note", words, "scale", change, limit))
        moved = float(np.hypot(circles[:, 0] - x, circles[:, 1] - y).min())
        missing.append(f"the place of the ball ({moved:.1f} px from that of the calibration; it is put there by hand)")
    return [*found, Remark("note", f"not compared: {'; '.join(missing)}", "not-compared")] if missing else found


def _against_others(ratio: Array) -> Array:
    """(L,) change of each light against the usual one: the mean would make one weak lamp a change of all others."""
    change: Array = ratio / np.median(ratio) - 1.0
    return change


def _u_strengths(before: LightCalibration, now: LightCalibration) -> list[Array | None]:
    """Uncertainties of the strengths of either, without what is alike in both where one means measured them."""
    is_alike = before.level_by == now.level_by
    return [
        one.u_intensities if one.u_intensities is None or not is_alike else repeatable(one.u_intensities, one.level_by)
        for one in (before, now)
    ]


def _level(change: float, limit: float) -> Remark:
    words = f"the level of all lights changed by {100 * change:+.1f} % (limit {100 * limit:.1f} %): lamps or exposure"
    return Remark("fail" if abs(change) > limit else "note", words, "level", change, limit)


def _of_its_own(lights: LightCalibration) -> Array:
    """(L,) uncertainties without what another calibration on the same ball is off by as well."""
    alike = sum(np.square(u) for u in (lights.u_lens_deg, lights.u_distance_deg) if u is not None)
    u_deg: Array = np.sqrt(np.maximum(lights.u_deg**2 - alike, lights.u_own_deg**2))
    return u_deg


def _pitch_of(station: Station, capture: Capture) -> float | None:
    """The pixel pitch that puts positions where the images show them: best the one that they were measured with."""
    if station.lights is not None and station.lights.pixel_pitch_um is not None:
        return station.lights.pixel_pitch_um
    return capture.pixel_pitch_um if station.scale is None else station.scale.pixel_pitch_um


def _origins(before: LightCalibration, placed: Array | None, now: LightCalibration) -> tuple[Array, Array]:
    """(L, 3) directions of the station's lights as the ball sees them, (L,) what their distances leave open of these.

    The latter in degrees, standard deviations.
    """
    if placed is None or now.sphere == "matt":  # whose shading shows how far lamps are: directions from the board
        u_distance_deg = now.u_distance_deg if placed is not None else None
        return before.rig.directions, np.zeros(len(before.rig)) if u_distance_deg is None else u_distance_deg
    x, y, radius = now.balls[0].outline_px
    way = placed - np.array([x, y, radius])
    # A light is seen from its highlight, half way between the top of the ball and the light's side of it.
    way = way - 0.5 * radius * (way / np.linalg.norm(way, axis=1, keepdims=True) + [0.0, 0.0, 1.0])
    size = np.linalg.norm(way, axis=1)
    directions: Array = way / size[:, None]
    u_deg = np.zeros(len(placed))
    if before.u_positions_um is not None and before.rig.positions_um is not None:
        far_um = np.linalg.norm(before.rig.positions_um, axis=1)
        across_um = np.radians(before.u_deg) * far_um
        along_um = np.sqrt(np.maximum(np.square(before.u_positions_um).sum(axis=1) - 2.0 * across_um**2, 0.0))
        aside = np.linalg.norm(np.cross(before.rig.directions, directions), axis=1)
        u_deg = np.degrees(along_um / far_um * aside * np.linalg.norm(placed, axis=1) / size)
    return directions, u_deg / math.sqrt(2.0)  # in one direction, where u_deg of lights is that on either axis


def _even(station: Station, capture: Capture, limit_intensity: float) -> tuple[Remark, ...]:
    """Compare the flat board: strength of each light against the others, and its evenness."""
    if station.flat is None:
        msg = f"station: {station.name} has no flat field to compare with"
        raise InputError(msg)
    if len(capture.images) != len(station.flat.coefficients) or capture.mask.shape != tuple(station.flat.size_px):
        msg = f"{capture.name}: other images than the flat field of {station.name}"
        raise InputError(msg)
    now, said = calibrate_flat(capture)
    found = [*said]
    old, new = station.flat.coefficients[:, 0], now.coefficients[:, 0]
    change = _against_others(new / old)
    for index in range(len(new)):
        name = light_name(index, capture.files)
        words = (
            f"{name}: {100 * change[index]:+.1f} % in strength against the other lights (limit "
            f"{100 * limit_intensity:.1f} %)"
        )
        severity: Severity = "fail" if abs(change[index]) > limit_intensity else "note"
        found.append(Remark(severity, words, "light-strength", float(change[index]), limit_intensity, "", index))
        uneven = float(np.abs(flat_maps(now, index) / flat_maps(station.flat, index) - 1.0).max())
        words = f"{name}: its evenness changed by {100 * uneven:.1f} % (limit {100 * LIMIT_EVENNESS:.1f} %)"
        severity = "fail" if uneven > LIMIT_EVENNESS else "note"
        found.append(Remark(severity, words, "evenness", uneven, LIMIT_EVENNESS, "", index))
    found.append(_level(float(new.mean() / old.mean()) - 1.0, LIMIT_LEVEL))
    words = "not compared: the directions of the lights and the magnification (a board shows neither)"
    return (*found, Remark("note", words, "not-compared"))
