"""Components moved onto known heights."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bgars.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bgars.records.anchors import Anchors
    from bgars.records.component import Component
    from bgars.records.pixels import BoolArray, FloatArray

__all__ = ["anchored"]

FEW = 1e-3
"""Density of anchors below which a surface keeps its shape."""


def anchored(
    height_px: FloatArray,
    labels: NDArray[np.int32],
    components: tuple[Component, ...],
    anchors: Anchors,
    pixel_pitch_um: float | None,
) -> tuple[FloatArray, tuple[Component, ...]]:
    """Move each component by the weighted mean of what its anchors lack; one without anchors stays where it is.

    The mean is the least-squares constant, and an anchor that contradicts the others shows in the component's
    ``anchor_rms_px``. Where a region has a reach, what its anchors then still lack is added, smoothed over that reach.

    Raises
    ------
    InputError
        The pixel pitch is not known, or no anchor lies on the surface.
    """
    if pixel_pitch_um is None:
        msg = "anchors: heights in micrometres need pixel_pitch_um"
        raise InputError(msg)
    known = np.isfinite(anchors.height_um) & (labels >= 0)
    trust = np.ones(int(known.sum())) if anchors.weights is None else anchors.weights[known].astype(np.float64)
    if not trust.any():
        msg = "anchors: none lies on a pixel that was integrated (and has a weight above 0)"
        raise InputError(msg)
    trust = trust / trust.max()  # sums of any weights are then finite
    parts, count = labels[known], len(components)
    lack_px = anchors.height_um[known].astype(np.float64) / pixel_pitch_um - height_px[known]
    total = np.bincount(parts, trust, count)
    held = total > 0
    divisor = np.where(held, total, 1.0)
    offset_px = np.bincount(parts, trust * lack_px, count) / divisor
    rms_px = np.sqrt(np.bincount(parts, trust * (lack_px - offset_px[parts]) ** 2, count) / divisor)
    pixels = np.bincount(parts[trust > 0], minlength=count)
    moved = height_px + np.append(offset_px, 0.0)[labels]
    lack_px = lack_px - offset_px[parts]
    for region, reach_px in anchors.reach_px.items():
        inside = (labels >= 0) & (True if anchors.regions is None else anchors.regions == region)
        moved[inside] += _smoothed(lack_px, trust, known, inside, reach_px)[inside]
    return moved.astype(np.float32), tuple(
        replace(part, anchor_pixels=int(pixels[k]), anchor_rms_px=float(rms_px[k])) if held[k] else part
        for k, part in enumerate(components)
    )


def _smoothed(
    lack_px: NDArray[np.float64], trust: NDArray[np.float64], known: BoolArray, inside: BoolArray, reach_px: float
) -> NDArray[np.float64]:
    """Gaussian mean of what the anchors inside a region lack; it fades to 0 where there are none."""
    density, lack = np.zeros(known.shape), np.zeros(known.shape)
    density[known], lack[known] = trust, trust * lack_px
    top = max(float(trust.max()), FEW)
    mean: NDArray[np.float64] = _blurred(lack * inside, reach_px)
    return mean / (_blurred(density * inside, reach_px) + FEW * top)


def _blurred(values: NDArray[np.float64], sigma_px: float) -> NDArray[np.float64]:
    """Convolve with a Gaussian, cut off at four standard deviations, zeros outside; by Fourier along each axis."""
    reach = int(4.0 * sigma_px + 0.5)
    weight = np.exp(-0.5 * np.square(np.arange(-reach, reach + 1) / sigma_px))
    for axis, size in enumerate(values.shape):
        length = size + 2 * reach
        along = np.fft.rfft(weight / weight.sum(), length).reshape((-1, 1) if axis == 0 else (1, -1))
        whole = np.fft.irfft(np.fft.rfft(values, length, axis=axis) * along, length, axis=axis)
        values = np.take(whole, range(reach, reach + size), axis=axis)
    return values
