"""A capture, seen through its station: lights with uncertainties, response, even light, scale."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bgars.errors import InputError
from bgars.records.station import Station
from bgars.records.station_lens import straightened

if TYPE_CHECKING:
    from bgars.records.capture import Capture
    from bgars.records.flat_field import FlatField
    from bgars.records.response_curve import ResponseCurve
    from bgars.records.rig import LightRig

__all__ = ["flat_intensities", "flat_maps", "legendre_terms", "with_station"]

Array = NDArray[np.float64]

LEAST_GAIN = 0.05
"""Share of the level at the image centre below which a corner is dark, not uneven."""


def with_station(capture: Capture, station: Station) -> Capture:
    """Return a capture with what the station knows better: lights, response, flat field, pixel pitch, camera.

    With a flat field the images are float32 ratios to the flat board, times what a light at the image centre gives
    there; clipped pixels stay clipped. With a lens that distorts they are resampled without its distortion.

    Parameters
    ----------
    capture : Capture
        (L, H, W) images, one per light of the station, in its order.
    station : Station
        From :func:`bgars.read_station`; what it does not know is left as the capture has it.

    Returns
    -------
    Capture

    Raises
    ------
    InputError
        Another number or order of images than the station has lights, or another image size than its flat field, scale
        or positions of lights have.
    """
    given: object = station
    if not isinstance(given, Station):
        msg = f"station: must be a Station, as bgars.read_station(FILE) returns it, got {type(given).__name__}"
        raise InputError(msg)
    if station.lights is not None:
        expected = len(station.lights.rig)
        if len(capture.images) != expected:
            msg = (
                f"{capture.name}: {len(capture.images)} images, but {station.name} has {expected} lights, one per image"
            )
            raise InputError(msg)
        _refuse_other_order(capture, station)
        if station.lights.rig.positions_um is not None:
            _refuse_other_size(capture, station.lights.size_px, f"the positions of the lights of {station.name}")
        rig = replace(station.lights.rig, files=capture.rig.files)
        capture = replace(capture, rig=rig)
    if station.scale is not None:
        _refuse_other_size(capture, station.scale.size_px, f"scale and lens of {station.name}")
        distance_mm = station.scale.camera_distance_mm
        capture = replace(
            capture,
            pixel_pitch_um=station.scale.pixel_pitch_um,
            pixel_pitch_u_um=station.scale.pixel_pitch_u_um,
            camera_distance_mm=capture.camera_distance_mm if distance_mm is None else distance_mm,
        )
    if station.response is not None:
        capture = _with_response(capture, station.response)
    if station.flat is not None:
        capture = _with_flat(capture, station.flat, station.name)
    if station.scale is not None and station.scale.distortion:
        capture = straightened(capture, station.scale.distortion)
    return capture


def _refuse_other_size(capture: Capture, size_px: tuple[int, int] | None, what: str) -> None:
    """Refuse images of another binning or region of interest: another pitch, or another middle."""
    height, width = capture.images.shape[1:3]
    if size_px is not None and (height, width) != tuple(size_px):
        msg = (
            f"{capture.name}: images of {width} x {height} pixels, but {what} are those of {size_px[1]} x "
            f"{size_px[0]}: use the binning and the region of interest of the calibration, or calibrate with these"
        )
        raise InputError(msg)


def _refuse_other_order(capture: Capture, station: Station) -> None:
    """Refuse lights that the capture itself declares in another order."""
    if station.lights is None or capture.rig.u_deg is not None:
        return
    turn = capture.rig.directions @ station.lights.rig.directions.T
    nearest = turn.argmax(axis=1)
    if len(capture.rig) == len(station.lights.rig) and sorted(nearest.tolist()) == list(range(len(turn))):
        off = np.flatnonzero(nearest != np.arange(len(turn)))
        # Only lights that stand clearly nearer to another place are in another order: a ring may be turned a little.
        sure = [index for index in off if turn[index, nearest[index]] > math.cos(math.radians(5.0))]
        if sure:
            msg = (
                f"{capture.name}: image {sure[0]} is declared under light {int(nearest[sure[0]])} of {station.name} "
                "(counted from 0): the images are in another order than the station's lights"
            )
            raise InputError(msg)


def _with_response(capture: Capture, curve: ResponseCurve) -> Capture:
    """Set the inverse response, where the capture has integer pixels that are not linear already."""
    if capture.images.dtype.kind != "u" or capture.response is not None:
        return capture
    codes = 1 << 8 * capture.images.dtype.itemsize
    levels = np.arange(codes) / capture.full_scale
    table = np.interp(levels, curve.levels, curve.radiances) * capture.full_scale
    return replace(capture, response=table.astype(np.float32))


def legendre_terms(x: Array, y: Array, degree: int) -> list[Array]:
    """Products P_i(x) P_j(y) with i + j <= degree, i first, as outer products (len(y), len(x))."""
    powers = np.eye(degree + 1)
    of_x = [np.polynomial.legendre.legval(x, row) for row in powers]
    of_y = [np.polynomial.legendre.legval(y, row) for row in powers]
    return [np.outer(of_y[j], of_x[i]) for i in range(degree + 1) for j in range(degree + 1 - i)]


def flat_maps(flat: FlatField, light: int) -> Array:
    """(H, W) level of the flat board under a light, against its level at the image centre."""
    height, width = flat.size_px
    x = (np.arange(width) + 0.5) / width * 2.0 - 1.0
    y = 1.0 - (np.arange(height) + 0.5) / height * 2.0
    centre = np.array([0.0])
    powers = flat.coefficients[light]
    level = float(sum(c * t[0, 0] for c, t in zip(powers, legendre_terms(centre, centre, flat.degree), strict=True)))
    total: Array = np.zeros((height, width))
    for coefficient, term in zip(powers, legendre_terms(x, y, flat.degree), strict=True):
        total += coefficient * term
    return total / level


def _with_flat(capture: Capture, flat: FlatField, name: str) -> Capture:
    shape = capture.images.shape
    if (shape[1], shape[2]) != tuple(flat.size_px) or shape[0] != len(flat.coefficients):
        has = f"{len(flat.coefficients)} maps of {flat.size_px[1]} x {flat.size_px[0]} pixels"
        msg = (
            f"{capture.name}: {shape[0]} images of {shape[2]} x {shape[1]} pixels, but the flat field of {name} "
            f"has {has}"
        )
        raise InputError(msg)
    full = capture.full_scale if math.isfinite(capture.full_scale) else float(capture.images.max())
    table = capture.response

    def linear(values: NDArray[np.generic]) -> NDArray[np.float32]:
        return (values if table is None else table[values.astype(np.intp)]).astype(np.float32)

    dark = np.float32(capture.black_level) if capture.dark is None else linear(capture.dark)
    if capture.dark is None and table is not None and capture.black_level:
        dark = linear(np.array([round(capture.black_level)]))[0]
    images = np.zeros(shape, np.float32)
    gains = [np.maximum(flat_maps(flat, light) / _modelled(capture, light), LEAST_GAIN) for light in range(shape[0])]
    # Brackets are on the scale of their longest exposure: their highlights exceed full scale.
    clip = max(full, capture.saturation) if math.isfinite(capture.saturation) else full
    top = clip / min(float(gain.min()) for gain in gains)
    for light, gain in enumerate(gains):
        values = capture.images[light]
        images[light] = (linear(values) - dark) / gain
        clipped = values >= capture.saturation
        images[light][clipped] = top
    rig = replace(capture.rig, intensities=flat_intensities(capture.rig, flat))
    return replace(
        capture,
        images=images,
        rig=rig,
        response=None,
        dark=None,
        black_level=0.0,
        saturation=float(top),
        full_scale=full,
    )


def flat_intensities(rig: LightRig, flat: FlatField) -> Array:
    """(L,) intensities, mean 1, as the flat board shows them at the image centre."""
    centre = np.array([0.0])
    terms = np.array([term[0, 0] for term in legendre_terms(centre, centre, flat.degree)])
    levels = flat.coefficients @ terms / np.maximum(rig.directions[:, 2], 0.02)
    if rig.positions_um is not None and rig.intensity_distance_um is not None:
        levels = levels * np.square(np.linalg.norm(rig.positions_um, axis=1) / rig.intensity_distance_um)
    relative: Array = levels / levels.mean()
    return relative


def _modelled(capture: Capture, light: int) -> Array | float:
    """Level of a flat board that the near-light model explains, against the image centre: 1 of distant lights."""
    rig = capture.rig
    if rig.positions_um is None or capture.pixel_pitch_um is None:
        return 1.0
    height, width = capture.images.shape[1:]
    x = (np.arange(width) + 0.5 - width / 2.0) * capture.pixel_pitch_um
    y = (height / 2.0 - np.arange(height) - 0.5) * capture.pixel_pitch_um
    px, py, pz = rig.positions_um[light]
    distance = np.sqrt((px - x[None, :]) ** 2 + (py - y[:, None]) ** 2 + pz**2)
    level: Array = (np.linalg.norm(rig.positions_um[light]) / distance) ** 3
    return level
