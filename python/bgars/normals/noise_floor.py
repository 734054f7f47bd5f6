"""Black background: pixels so dark that their normals are made of noise are not measured."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from bgars.records.capture import Capture
    from bgars.records.normal_field import NormalField

__all__ = ["albedo_floor", "without_background"]

LEVELS = 4.0
"""Albedo in grey levels of 8 bits at which rounding alone (0.3 levels, and as much noise) makes a direction uncertain
by 5 degrees under eight lights: the standard error at which the confidence is one half."""
DEEP_LEVELS = 16.0
"""The same in levels of 12 bits for deeper files: cameras that write them have a read noise of one or two levels."""


def albedo_floor(capture: Capture) -> float:
    """Albedo below which a pixel is background, 1 = full scale.

    Examples
    --------
    >>> import bgars
    >>> round(albedo_floor(bgars.read_capture(bgars.sample_capture())), 4)
    0.0157
    """
    return LEVELS / 255.0 if capture.images.dtype == np.uint8 else DEEP_LEVELS / 4095.0


def without_background(field: NormalField, capture: Capture) -> NormalField:
    """Return the field with background not measured.

    Parameters
    ----------
    field : NormalField
        Of `capture`.
    capture : Capture
    """
    if capture.images.dtype.kind != "u":
        return field
    dark = field.mask & (field.albedo < albedo_floor(capture))
    return replace(field, is_measured=field.is_measured & ~dark) if dark.any() else field
