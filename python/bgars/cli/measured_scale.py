"""The scale of a station from the options of a command: lengths in mm as they were typed, and what was known before."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Literal

import bgars
from bgars.errors import CalibrationError, InputError
from bgars.io.capture import read_unlit
from bgars.records.remark import Remark

if TYPE_CHECKING:
    from pathlib import Path

    from bgars.records.scale import Scale
    from bgars.records.station import Station

__all__ = ["measured_scale", "numbers"]

PIXELS_UM = (0.2, 1000.0)
"""Sizes of a pixel on the board that are usual: of a microscope, and of a board of a metre."""
FARTHEST_MM = 5000.0
"""A camera that is farther off is one on another unit of length."""


def measured_scale(
    known: Station,
    folders: list[Path],
    pitch: tuple[str, float],
    heights: tuple[str, str | None],
    target: Literal["dots", "chessboard"],
    u_pitch_mm: float | None = None,
) -> tuple[Scale, tuple[Remark, ...]]:
    """Measure the scale; `pitch` and `heights` are names of options and their values.

    The distance of the camera that the station knows is kept where this grid does not tell it: it is one of the lens.

    Raises
    ------
    InputError, CalibrationError
        Options that do not fit, by name, with their value; see :func:`bgars.calibrate_scale`.
    """
    option, pitch_mm = pitch
    if not (math.isfinite(pitch_mm) and pitch_mm > 0):
        msg = f"{option}: must be finite and above 0, got {pitch_mm:g}"
        raise InputError(msg)
    if u_pitch_mm is not None and not 0 <= u_pitch_mm < pitch_mm:
        msg = f"--u-pitch-mm: must be 0 or more, and below the pitch of {pitch_mm:g}, got {u_pitch_mm:g}"
        raise InputError(msg)
    heights_um = _heights_um(*heights, len(folders))
    found, findings = bgars.calibrate_scale(
        [read_unlit(folder) for folder in folders],
        1000.0 * pitch_mm,
        target=target,
        u_pitch_um=None if u_pitch_mm is None else 1000.0 * u_pitch_mm,
        heights_um=heights_um,
    )
    for one in findings:
        if one.code == "heights" and one.value is not None and one.value < 0:
            # Whichever of the heights is 0 then, the pitch would be that of another plane.
            msg = f"{heights[0]}: {one.message}; got {heights[1]}"
            raise CalibrationError(msg)
    before = known.scale
    if found.camera_distance_mm is None and before is not None and before.camera_distance_mm is not None:
        lens = f"{before.camera_distance_mm:g} mm to the camera"
        if math.isinf(before.camera_distance_mm):
            lens = "a telecentric lens"
        words = f"kept from the calibration before: {lens}; the grid at two heights ({heights[0]}) measures it anew"
        findings = (*findings, Remark("note", words, "grid-distance-kept"))
        found = replace(found, camera_distance_mm=before.camera_distance_mm)
    return found, (*findings, *_odd(found, option, pitch_mm))


def _odd(found: Scale, option: str, pitch_mm: float) -> list[Remark]:
    """Doubt sizes that another unit of length would explain."""
    said = []
    low, high = PIXELS_UM
    if not low <= found.pixel_pitch_um <= high:
        words = (
            f"a pixel of {found.pixel_pitch_um:.4g} um is unusual ({low:g} um to {high / 1000.0:g} mm): is {option} "
            f"{pitch_mm:g} in millimetres?"
        )
        said.append(Remark("doubt", words, "grid-unit", found.pixel_pitch_um, high, "um"))
    distance_mm = found.camera_distance_mm
    if distance_mm is not None and FARTHEST_MM < distance_mm < math.inf:
        words = f"a camera at {distance_mm / 1000.0:.3g} m is unusual: are the heights of the grid in millimetres?"
        said.append(Remark("doubt", words, "grid-unit", distance_mm, FARTHEST_MM, "mm"))
    return said


def _heights_um(option: str, text: str | None, folders: int) -> list[float] | None:
    if text is None:
        if folders > 1:
            msg = f"{option}: needed with several folders ({folders}): the height of the grid in each"
            raise InputError(msg)
        return None
    values = numbers(text, option)
    if len(values) != folders:
        msg = f"{option}: must hold one height per folder ({folders}), got {text}"
        raise InputError(msg)
    if not all(math.isfinite(value) for value in values) or len(set(values)) == 1:
        msg = f"{option}: must be finite, two different ones or more, got {text}"
        raise InputError(msg)
    return [1000.0 * value for value in values]


def numbers(text: str, option: str) -> list[float]:
    """Return the numbers of an option, which commas separate."""
    try:
        return [float(value) for value in text.split(",")]
    except ValueError:
        msg = f"{option}: must be numbers with commas between, got {text!r}"
        raise InputError(msg) from None
