"""A capture of a station: which file describes that, and what of it must fit the capture."""

from __future__ import annotations

import math
import warnings
from dataclasses import replace
from typing import TYPE_CHECKING

from bgars.errors import CaptureWarning
from bgars.io.capture_lights import check_near_lights
from bgars.io.recipe import RECIPE_NAME
from bgars.io.station_file import read_station
from bgars.records.station import Station
from bgars.records.station_apply import with_station

if TYPE_CHECKING:
    from os import PathLike
    from pathlib import Path

    from bgars.io.recipe import CaptureRecipe
    from bgars.records.capture import Capture

    Given = Station | str | PathLike[str] | None

__all__ = ["seen_through", "station_of"]

CONTRADICTS = 3.0
"""Standard uncertainties by which a stated pixel pitch and that of the station may differ."""


def station_of(folder: Path, recipe: CaptureRecipe, given: Given) -> tuple[Station | None, str]:
    """Return the station of a capture, as it was given or as its recipe names it, and the name of its file."""
    if given is None and recipe.station is not None:
        given = folder / recipe.station
    if given is None or isinstance(given, Station):
        return given, "" if given is None else given.name
    return read_station(given), str(given)


def seen_through(capture: Capture, station: Station | None, folder: Path, name: str) -> Capture:
    """Return the capture with what its station knows; near lights must have a scale, from either of them.

    Raises
    ------
    InputError
        No pixel pitch for near lights, lights within the picture, or a station that does not fit the images.
    """
    where = str(folder / RECIPE_NAME)
    if station is None:
        check_near_lights(capture, where)
        return capture
    note = _other_pitch(capture, station, where, name)
    capture = with_station(capture, station)
    if note:
        warnings.warn(note, CaptureWarning, stacklevel=3)
        capture = replace(capture, assumed=(*capture.assumed, note))
    check_near_lights(capture, where, None if station.lights is None else name)
    return capture


def _other_pitch(capture: Capture, station: Station, where: str, name: str) -> str:
    """What to say of a stated pixel pitch that is not that of the station; "" where it is."""
    stated, scale = capture.pixel_pitch_um, station.scale
    if stated is None or scale is None:
        return ""
    u = math.hypot(scale.pixel_pitch_u_um, capture.pixel_pitch_u_um or 0.0)
    if abs(stated - scale.pixel_pitch_um) <= CONTRADICTS * u:
        return ""
    return (
        f"{where}: pixel_pitch_um = {stated:g}, but {scale.pixel_pitch_um:.6g} (u {scale.pixel_pitch_u_um:.2g}) by "
        f"{name}, which is used"
    )
