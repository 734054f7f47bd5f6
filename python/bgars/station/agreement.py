"""Whether the sections of a station fit together: each was calibrated by itself, and all are applied to one capture."""

from __future__ import annotations

import math
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bgars.errors import CalibrationError
from bgars.records.remark import Remark
from bgars.records.station_apply import flat_intensities
from bgars.records.station_sections import WHOLE

if TYPE_CHECKING:
    from collections.abc import Iterator

    from bgars.records.flat_field import FlatField
    from bgars.records.light_calibration import LightCalibration
    from bgars.records.station import Station

__all__ = ["agreement"]

Array = NDArray[np.float64]

SIGMAS, LEAST = 3.0, 0.1
"""A level that is off by more than both contradicts; a lamp that lost some per cent with age is no contradiction."""
WARM = 0.02
"""Standard deviation by which LEDs differ that are warm at one calibration and cold at the other."""
ASKED = 36.0
"""Chi square by which another order must be better: six standard deviations, of a hundred orders that are tried."""
TILT_DEG = 1.0
"""Standard deviation of the tilt of a board by hand, 1 mm in 60: it dims one side's lights, and lifts the other's."""


def agreement(station: Station) -> list[Remark]:
    """Compare the sections of a station with each other.

    Returns
    -------
    list of Remark
        Doubts: sections of different image sizes, levels of the board that contradict the strengths of the lights.

    Raises
    ------
    CalibrationError
        Lights and flat field with different numbers of images, or in different orders.
    """
    lights, flat = station.lights, station.flat
    found = _sizes(station)
    if lights is None or flat is None:
        return found
    if len(lights.rig) != len(flat.coefficients):
        msg = (
            f"{station.name}: {len(lights.rig)} lights, but a flat field of {len(flat.coefficients)} images: no "
            "capture fits both; photograph board and balls under the same lights, and calibrate both at once (bgars "
            "calibrate station BALL... --board BOARD), or into a new station file"
        )
        raise CalibrationError(msg)
    return found + _strengths(station.name, lights, flat)


def _sizes(station: Station) -> list[Remark]:
    sizes = {
        name: tuple(part.size_px)
        for name, part in (("lights", station.lights), ("flat", station.flat), ("scale", station.scale))
        if part is not None and part.size_px is not None
    }
    if len(set(sizes.values())) < 2:  # noqa: PLR2004
        return []
    words = ", ".join(f"{name} {width} x {height}" for name, (height, width) in sizes.items())
    message = (
        f"sections of different image sizes ({words}): captures of one size do not fit all of them; use one binning "
        "and region of interest, and calibrate the others again"
    )
    return [Remark("doubt", message, f"{WHOLE}size")]


def _strengths(name: str, lights: LightCalibration, flat: FlatField) -> list[Remark]:
    """Compare the levels of the board with the measured strengths of the lights, but for tilt and exposure."""
    if lights.u_intensities is None or (lights.rig.directions[:, 2] <= 0).any():
        return []
    slopes = lights.rig.directions[:, :2] / lights.rig.directions[:, 2:]
    u_levels = np.radians(lights.u_deg) * np.linalg.norm(slopes, axis=1)
    u: Array = np.sqrt(np.square(lights.u_intensities) + np.square(u_levels) + WARM**2)
    limits = np.maximum(SIGMAS * u, LEAST)
    shown, known = np.log(flat_intensities(lights.rig, flat)), np.log(lights.rig.intensities)
    # A light that flat and ball see from different sides of the image is as strong on both but for its fall-off.
    off = _without_tilt(shown - known, u, slopes)
    if (np.abs(off) <= limits).all():
        return []
    misfit = float(np.square(SIGMAS * off / limits).sum())
    upright = lights.rig.directions[:, 2]
    for order in _orders(len(known)):
        # The levels are those at the lights' slopes, which the images of another order have not.
        levels = np.log((np.exp(shown) * upright)[order] / upright)
        left = _without_tilt(levels - known, u, slopes) / limits
        if np.abs(left).max() <= 1.0 and float(np.square(SIGMAS * left).sum()) < misfit - ASKED:
            first = int(np.flatnonzero(order != np.arange(len(order)))[0])
            msg = (
                f"{name}: the board's images are in another order than the lights: image {int(order[first])} is as "
                f"bright as light {first} is strong (counted from 0), and so on; photograph board and balls in one "
                "order"
            )
            raise CalibrationError(msg)
    worst = int(np.argmax(np.abs(off) / limits))
    message = (
        f"light {worst} (counted from 0) is {100 * math.expm1(off[worst]):+.0f} % as strong on the board, against the "
        f"others, as on the ball (limit {100 * limits[worst]:.0f} %): a lamp or its current was changed in between, or "
        "the images are in another order; calibrate lights and flat field anew"
    )
    return [Remark("doubt", message, f"{WHOLE}strength", float(off[worst]), float(limits[worst]), "", worst)]


def _without_tilt(off: Array, u: Array, slopes: Array) -> Array:
    """(L,) differences of logarithms less what exposure and a slight tilt of the board explain of them."""
    rows = np.column_stack([np.ones(len(off)), slopes]) / u[:, None]
    prior = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]) / math.radians(TILT_DEG)
    law, *_ = np.linalg.lstsq(np.vstack([rows, prior]), np.append(off / u, [0.0, 0.0]), rcond=None)
    left: Array = off - np.column_stack([np.ones(len(off)), slopes]) @ law
    return left


def _orders(count: int) -> Iterator[NDArray[np.intp]]:
    """Orders that happen: begun at another light, the other way round, or two lights exchanged."""
    usual = np.arange(count)
    for shift in range(count):
        for order in (np.roll(usual, shift), np.roll(usual[::-1], shift)):
            if (order != usual).any():
                yield order
    for one, two in combinations(range(count), 2):
        order = usual.copy()
        order[[one, two]] = two, one
        yield order
