"""A capture in the units of the Rust kernels."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bgars.errors import InputError
from bgars.records.plain_arrays import plain

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bgars.records.capture import Capture
    from bgars.records.pixels import FloatArray, PixelArray

__all__ = ["KernelCapture", "kernel_capture"]


@dataclass(frozen=True, eq=False)
class KernelCapture:
    """What the kernels read of a capture; attributes as in :class:`bgars.Capture` unless said.

    Attributes
    ----------
    lights : (L, 3) float64
        Unit vectors to the lights, or their positions in pixels.
    lights_are_positions : bool
        Which of the two.
    reference_px : list of float
        For positions, the distances at which the intensities hold; else empty.
    intensities : list of float
        Relative intensities.
    full_scale : float or None
        None: the kernels look for the largest value of the images.
    """

    images: PixelArray
    lights: NDArray[np.float64]
    lights_are_positions: bool
    reference_px: list[float]
    intensities: list[float]
    response: FloatArray | None
    dark: PixelArray | None
    black_level: float
    saturation: float
    full_scale: float | None


def kernel_capture(capture: Capture) -> KernelCapture:
    """Return the capture as the kernels read it; nothing is copied but the rig.

    Raises
    ------
    InputError
        Near lights without a pixel pitch.
    """
    rig = capture.rig
    lights, reference_px = rig.directions, []
    near = rig.positions_um is not None and rig.intensity_distance_um is not None
    if rig.positions_um is not None and rig.intensity_distance_um is not None:
        if capture.pixel_pitch_um is None:
            msg = "pixel_pitch_um: needed with near lights, to place pixels and lights together"
            raise InputError(msg)
        lights = rig.positions_um / capture.pixel_pitch_um
        reference_px = (rig.intensity_distance_um / capture.pixel_pitch_um).tolist()
    return KernelCapture(
        images=capture.images,
        lights=plain("light_directions", lights, np.float64),
        lights_are_positions=near,
        reference_px=reference_px,
        intensities=rig.intensities.tolist(),
        response=capture.response,
        dark=capture.dark,
        black_level=capture.black_level,
        saturation=capture.saturation,
        full_scale=None if math.isnan(capture.full_scale) else capture.full_scale,
    )
