"""Whether the parts of a capture that was made by hand fit each other."""

from __future__ import annotations

from typing import Any

import numpy as np

from bgars.errors import InputError
from bgars.records.capture import Capture

__all__ = ["need_whole"]

STACK_NDIM = 3


def need_whole(capture: object) -> None:
    """Raise InputError where images, lights, mask, dark frame and levels of a capture do not fit each other.

    Readers make captures that do; the constructor takes what it is given.
    """
    if not isinstance(capture, Capture):
        msg = f"capture: must be a Capture, as bgars.read_capture(FOLDER) returns it, got {type(capture).__name__}"
        raise InputError(msg)
    images = capture.images
    if images.ndim != STACK_NDIM or not images.size:
        msg = f"images: must have shape (lights, rows, columns), none of them 0, got {images.shape}"
        raise InputError(msg)
    if len(capture.rig.directions) != len(images):
        msg = f"rig: must have one light for each of the {len(images)} images, got {len(capture.rig.directions)}"
        raise InputError(msg)
    size = images.shape[1:]
    for name, values in (("mask", capture.mask), ("dark", capture.dark)):
        if values is not None and values.shape != size:
            msg = f"{name}: must have shape {size}, that of the images, got {values.shape}"
            raise InputError(msg)
    if capture.response is not None and images.dtype.kind == "u":
        codes = 1 << 8 * images.dtype.itemsize
        if capture.response.shape != (codes,):
            msg = f"response: must have shape ({codes},), one value for every code, got {capture.response.shape}"
            raise InputError(msg)
    for name in ("black_level", "saturation", "full_scale"):
        if not _is_number(getattr(capture, name)):
            msg = f"{name}: must be a number, got {getattr(capture, name)!r}"
            raise InputError(msg)
    pitch_um = capture.pixel_pitch_um
    if pitch_um is not None and not (_is_number(pitch_um) and 0.0 < pitch_um < float("inf")):
        msg = f"pixel_pitch_um: must be finite and above 0, or None, got {pitch_um!r}"
        raise InputError(msg)


def _is_number(value: Any) -> bool:  # noqa: ANN401 - whatever the constructor was given
    return isinstance(value, int | float | np.number) and not isinstance(value, bool)
