"""Normals that somebody else estimated, as a field."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bgars.errors import InputError
from bgars.records.normal_field import NormalField

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from bgars.records.capture import Capture

__all__ = ["GIVEN", "given_field"]

GIVEN = "normals as given"


def given_field(given: NormalField | ArrayLike, capture: Capture, name: str) -> NormalField:
    """Return a field of the images' size: the given one, or one made of an array (H, W, 3) of any lengths.

    What an array does not say is not made up: albedo is NaN, confidence 0 (any error is possible), no lights are kept,
    and `choice` is :data:`GIVEN`.

    Raises
    ------
    InputError
        Normals that are not as large as the images.
    """
    if isinstance(given, NormalField):
        if given.mask.shape != capture.mask.shape:
            msg = f"method: normals have shape {given.mask.shape}, but the images have {capture.mask.shape}"
            raise InputError(msg)
        return (
            given if given.method_reason != "" or name == "given" else replace(given, method_reason=f"{name}, as asked")
        )
    normals = np.asarray(given)
    shape = (*capture.mask.shape, 3)
    if normals.shape != shape or normals.dtype.kind not in "fiu":
        msg = f"method: normals must be numbers of shape {shape}, got {normals.dtype} of shape {normals.shape}"
        raise InputError(msg)
    wide = normals.astype(np.float64)
    length = np.linalg.norm(wide, axis=2)
    mask = np.isfinite(length) & (length > 0)
    unit = np.where(mask[..., None], wide / np.where(mask, length, 1.0)[..., None], np.nan).astype(np.float32)
    nothing = np.full(mask.shape, np.nan, np.float32)
    lights, unsure = np.zeros(mask.shape, np.uint16), np.zeros(mask.shape, np.float32)
    return NormalField(unit, nothing, mask, unsure, mask, lights, name, capture.pixel_pitch_um, method_reason=GIVEN)
