"""Checks of single numbers that a caller gives."""

from __future__ import annotations

import math

import numpy as np

from bgars.errors import InputError

__all__ = ["check_pitch", "number"]


def number(name: str, value: object) -> float:
    """Return the value, or raise InputError unless it is a number."""
    if isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool):
        return float(value)
    msg = f"{name}: must be a number, got {value!r}"
    raise InputError(msg)


def check_pitch(pixel_pitch_um: object, name: str = "pixel_pitch_um") -> None:
    """Raise InputError unless the pixel pitch is finite and above 0, or None."""
    if pixel_pitch_um is None:
        return
    pitch = number(name, pixel_pitch_um)
    if not (math.isfinite(pitch) and pitch > 0):
        msg = f"{name}: must be finite and above 0, got {pitch:g}"
        raise InputError(msg)
