"""Images as a lens without distortion would show them: resampled once, after response and flat field."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bgars.records.capture import Capture

__all__ = ["straightened"]

LEAST_PX = 0.1
"""Displacement at the corner of the image below which nothing is resampled: it costs sharpness, and gains nothing."""
TOUCHED = 0.02
"""Share of a clipped pixel in a resampled one that makes it clipped, too."""


def straightened(capture: Capture, distortion: float) -> Capture:
    """Return the capture without radial distortion (Brown 1971, first term).

    Parameters
    ----------
    capture : Capture
        As the camera gave it, or divided by a flat field.
    distortion : float
        Displacement at the corner of the image, of its distance from the middle; barrels are negative.

    Returns
    -------
    Capture
        float32 images, linear and without their dark level; the same capture where the lens moves nothing by 0.1 pixel.

    Examples
    --------
    >>> import bgars
    >>> scene, camera = bgars.Scene.hemisphere(300.0), bgars.Camera()
    >>> capture, _ = bgars.simulate(scene, bgars.LightRig.ring(4), bgars.Material(), camera)
    >>> straightened(capture, 1e-5) is capture
    True
    >>> straightened(capture, 0.01).images.dtype.name
    'float32'
    """
    height, width = capture.images.shape[1:]
    half = 0.5 * math.hypot(height, width)
    if abs(distortion) * half < LEAST_PX:
        return capture
    from scipy.ndimage import map_coordinates  # noqa: PLC0415 - takes as long as a small part

    rows, cols = np.mgrid[:height, :width].astype(np.float64)
    down, right = rows - (height - 1) / 2.0, cols - (width - 1) / 2.0
    bend = distortion * (down**2 + right**2) / half**2
    places = np.stack([rows + down * bend, cols + right * bend])
    full = capture.full_scale if math.isfinite(capture.full_scale) else float(capture.images.max())

    def linear(values: NDArray[np.generic]) -> NDArray[np.float32]:
        table = capture.response
        return (values if table is None else table[values.astype(np.intp)]).astype(np.float32)

    dark = np.float32(0.0) if capture.dark is None else linear(capture.dark)
    if capture.dark is None and capture.black_level:
        dark = (
            linear(np.array([round(capture.black_level)]))[0]
            if capture.response is not None
            else np.float32(capture.black_level)
        )
    top = np.float32(capture.saturation if capture.response is None and math.isfinite(capture.saturation) else full)
    images = np.zeros(capture.images.shape, np.float32)
    for picture, into in zip(capture.images, images, strict=True):
        clipped = picture >= capture.saturation
        into[:] = map_coordinates(linear(picture) - dark, places, order=3, mode="nearest")
        np.maximum(into, 0.0, out=into)
        # What is beside a clipped pixel and takes a share of it is clipped; all others are below.
        touched = map_coordinates(clipped.astype(np.float32), places, order=1, mode="nearest") > TOUCHED
        into[~touched] = np.minimum(into[~touched], np.nextafter(top, np.float32(0.0)))
        into[touched] = top
    inside = (places[0] >= 0) & (places[0] <= height - 1) & (places[1] >= 0) & (places[1] <= width - 1)
    mask = map_coordinates(capture.mask.astype(np.float32), places, order=1, mode="nearest") > 1.0 - TOUCHED
    return replace(
        capture,
        images=images,
        mask=mask & inside,
        response=None,
        dark=None,
        black_level=0.0,
        saturation=float(top),
        full_scale=full,
    )
