"""Whether the parts of a capture that was made by hand fit each other."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from bgars.errors import InputError
from bgars.records.capture import Capture

if TYPE_CHECKING:
    from numpy.typing import NDArray

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
    if capture.dark is not None:
        _check_dark(capture.dark, images.dtype, capture.mask)
    if capture.response is not None:
        _check_response(capture.response, images.dtype)
    for name in ("black_level", "saturation", "full_scale"):
        if not _is_number(getattr(capture, name)):
            msg = f"{name}: must be a number, got {getattr(capture, name)!r}"
            raise InputError(msg)
    if capture.full_scale <= 0.0:  # NaN: the kernels look for it
        msg = f"full_scale: must be finite and above 0, got {capture.full_scale:g}"
        raise InputError(msg)
    pitch_um = capture.pixel_pitch_um
    if pitch_um is not None and not (_is_number(pitch_um) and 0.0 < pitch_um < float("inf")):
        msg = f"pixel_pitch_um: must be finite and above 0, or None, got {pitch_um!r}"
        raise InputError(msg)


def _check_dark(dark: NDArray[Any], dtype: np.dtype[Any], mask: NDArray[np.bool_]) -> None:
    if dark.dtype != dtype:
        msg = f"dark: must have the dtype of the images, {dtype}, got {dark.dtype}; round it, or make both float32"
        raise InputError(msg)
    if dark.dtype.kind == "f" and not np.isfinite(dark[mask]).all():
        msg = "dark: must be finite inside the mask"
        raise InputError(msg)


def _check_response(response: NDArray[Any], dtype: np.dtype[Any]) -> None:
    if dtype.kind == "u" and response.shape != (1 << 8 * dtype.itemsize,):
        msg = f"response: must have shape ({1 << 8 * dtype.itemsize},), one value for every code, got {response.shape}"
        raise InputError(msg)
    # A camera saturates: its curve may be level, but never falls.
    if not (np.diff(response) >= 0).all():
        msg = "response: must be finite and must not fall from one code to the next"
        raise InputError(msg)


def _is_number(value: Any) -> bool:  # noqa: ANN401 - whatever the constructor was given
    return isinstance(value, int | float | np.number) and not isinstance(value, bool)
