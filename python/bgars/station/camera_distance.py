"""Distance of the camera, from a grid photographed at known heights: the nearer it is, the larger it looks.

A pixel shows ``p(h) = p(0) (1 - h / d)`` of a plane at height h under a camera at distance d. Where no distance shows,
and it would, the lens is telecentric.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bgars.errors import InputError
from bgars.records.remark import Remark

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bgars.records.scale import Scale

__all__ = ["checked_heights", "with_distance"]

Array = NDArray[np.float64]

HEIGHT_SHARE = 0.01
"""Standard uncertainty of heights, of their range: shims and stages. Height 0, where parts lie, is exact."""
SCALE_SHARE = 2e-5
"""Standard uncertainty of a scale against that at another height beside what its points scatter: 0.01 of 500 pixels, by
which focus and light move the dots that are found."""
SEEN_SIGMAS = 3.0
LEAST_DISTANCE_MM = 3000.0
"""Standard uncertainty of 1 / distance, as its inverse, from which on the distance is kept: what an inspection allows a
stated one to be off by."""
MISFIT = 3.0
"""Standard uncertainties that sizes at three and more heights may lie off a line."""


def checked_heights(heights_um: ArrayLike | None, count: int) -> Array | None:
    """Heights (K,) of the grid, one per capture, or None for a single capture.

    Raises
    ------
    InputError
        Several captures without heights, another number of heights, heights that are not finite, or all the same.
    """
    if heights_um is None:
        if count == 1:
            return None
        msg = f"heights_um: {count} captures of a grid need its height in each of them"
        raise InputError(msg)
    heights = np.atleast_1d(np.asarray(heights_um, dtype=np.float64))
    if heights.shape != (count,):
        msg = f"heights_um: must hold one height per capture ({count}), got shape {heights.shape}"
        raise InputError(msg)
    if not np.isfinite(heights).all():
        msg = f"heights_um: must be finite, got {heights.tolist()}"
        raise InputError(msg)
    if np.ptp(heights) == 0:
        msg = f"heights_um: must hold two different heights or more, got {heights.tolist()}"
        raise InputError(msg)
    return heights


def with_distance(
    scales: Sequence[Scale], heights_um: Array, u_grid: float, name: str
) -> tuple[Scale, tuple[Remark, ...]]:
    """The scale at height 0 and the distance of the camera from there.

    Parameters
    ----------
    scales : sequence of Scale
        By the grid at each height.
    heights_um : (K,) float64
        Above the plane of the parts, toward the camera.
    u_grid : float
        Relative standard uncertainty of the grid's pitch, in all scales alike.
    name : str
        Of the captures, for messages.
    """
    pitch = np.array([scale.pixel_pitch_um for scale in scales])
    u_all = np.array([scale.pixel_pitch_u_um for scale in scales])
    u_own = np.sqrt(np.maximum(np.square(u_all) - np.square(u_grid * pitch), 0.0) + np.square(SCALE_SHARE * pitch))
    u_height = HEIGHT_SHARE * np.ptp(heights_um) * (heights_um != 0.0)
    at_zero, slope = float(pitch.mean()), 0.0
    for _ in range(2):  # the first time without the heights, which move sizes by as much as these grow with height
        u = np.hypot(u_own, slope * u_height)
        design = np.column_stack([np.ones_like(heights_um), -heights_um]) / u[:, None]
        covariance = np.linalg.inv(design.T @ design)
        at_zero, slope = (float(value) for value in covariance @ design.T @ (pitch / u))
    off = np.abs(design @ [at_zero, slope] - pitch / u).max() / math.sqrt(max(len(pitch) - 2, 1))
    u_zero, u_slope = np.sqrt(np.diag(covariance)) * max(float(off), 1.0)
    per_mm, u_per_mm = 1000.0 * slope / at_zero, 1000.0 * float(u_slope) / at_zero
    span_mm = float(np.ptp(heights_um)) / 1000.0
    reference = scales[int(np.argmin(np.abs(heights_um)))]
    distance_mm, remark = _judged(per_mm, u_per_mm, span_mm, name)
    findings = [remark]
    if len(pitch) > 2 and off > MISFIT:  # noqa: PLR2004 - two lie on a line
        words = f"{name}: sizes of the grid lie {off:.1f} u off a line over its height: is a height wrong?"
        findings.append(Remark("doubt", words, "heights", float(off), MISFIT))
    return replace(
        reference,
        pixel_pitch_um=at_zero,
        pixel_pitch_u_um=math.hypot(float(u_zero), u_grid * at_zero),
        camera_distance_mm=distance_mm,
    ), tuple(findings)


def _judged(per_mm: float, u_per_mm: float, span_mm: float, name: str) -> tuple[float | None, Remark]:
    """The distance to keep, None where it is not known well enough, and a word about it."""
    seen = abs(per_mm) > SEEN_SIGMAS * u_per_mm
    if seen and per_mm < 0:
        words = (
            f"{name}: the grid looks smaller the higher it lies: heights count upward, toward the camera; "
            "the distance is not kept"
        )
        return None, Remark("doubt", words, "heights", per_mm, 0.0, "1/mm")
    if u_per_mm * LEAST_DISTANCE_MM > 1.0:
        words = (
            f"{name}: {span_mm:g} mm of height tell 1 / distance to {u_per_mm:.1g} per mm only, "
            f"{1.0 / LEAST_DISTANCE_MM:.1g} is needed: the distance is not kept; raise the grid further"
        )
        return None, Remark("note", words, "distance", u_per_mm, 1.0 / LEAST_DISTANCE_MM, "1/mm")
    if not seen:
        nearest = 1.0 / (abs(per_mm) + 2.0 * u_per_mm)
        words = f"{name}: the lens is telecentric: no distance shows, and one below {nearest:.2g} mm would"
        return math.inf, Remark("note", words, "distance", per_mm, None, "1/mm")
    distance = 1.0 / per_mm
    words = f"{name}: the camera is {distance:.1f} mm (u {u_per_mm * distance**2:.2g} mm) above the plane of the parts"
    return distance, Remark("note", words, "distance", distance, None, "mm")
