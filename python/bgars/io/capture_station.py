"""A capture of a station: which file describes that, and what of it must fit the capture."""

from __future__ import annotations

from typing import TYPE_CHECKING

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
    capture = with_station(capture, station)
    check_near_lights(capture, where, None if station.lights is None else name)
    return capture
