"""What `integrate_normals` is given, checked and brought into the form of the solver."""

from __future__ import annotations

import math
import operator
from typing import TYPE_CHECKING, Literal

import numpy as np

from bgars import _bgars
from bgars.errors import InputError
from bgars.records.anchors import Anchors
from bgars.records.normal_field import NormalField
from bgars.records.pinhole import Pinhole
from bgars.records.plain_arrays import plain, plain_bool, without_mask

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike, NDArray

    from bgars.records.pixels import BoolArray, FloatArray

__all__ = [
    "anchor_regions",
    "check_camera",
    "check_others",
    "count",
    "edge_trust",
    "normal_array",
    "used_pixels",
]

NORMALS_NDIM = 3
MAX_COUNT = 2**31 - 1
DEFAULTS = {
    "difference": "trapezoid",
    "relative_tolerance": 1e-8,
    "absolute_tolerance": 1e-12,
    "k": 2.0,
    "tol": 1e-4,
    "solver": "converged",
}
"""Of the arguments that only one method has."""


def count(name: str, value: object, default: int) -> int:
    """Return the value, the default for None, or raise InputError unless it is a whole number of at least 1."""
    if value is None:
        return default
    try:
        whole = operator.index(value)  # type: ignore[arg-type]  # what has no index raises
    except TypeError:
        msg = f"{name}: must be a whole number, got {value!r}"
        raise InputError(msg) from None
    if not 1 <= whole <= MAX_COUNT:
        rule = "at least 1" if whole < 1 else f"at most {MAX_COUNT}"
        msg = f"{name}: must be {rule}, got {whole}"
        raise InputError(msg)
    return whole


def check_others(method: str, others: Mapping[str, object], own: Mapping[str, object]) -> None:
    """Raise InputError where an argument that only the other method has is not at its default."""
    for name, value in others.items():
        if value != DEFAULTS[name]:
            msg = f"{name}: method {method!r} has no such argument (it has {', '.join(own)}); got {value!r}"
            raise InputError(msg)


def check_camera(camera: object, method: str, anchors: Anchors | None) -> None:
    """Raise InputError where there is a camera that this integration cannot have."""
    if camera is None:
        return
    if not isinstance(camera, Pinhole):
        msg = f"camera: must be a bgars.Pinhole, got {type(camera).__name__}"
        raise InputError(msg)
    if method != "bilateral":
        msg = f"camera: only method 'bilateral' integrates under a camera, got {method!r}"
        raise InputError(msg)
    if anchors is not None:
        msg = "anchors: heights in micrometres do not fix a depth under a camera; leave one of the two out"
        raise InputError(msg)


def normal_array(normals: ArrayLike, mask: ArrayLike | None, threads: int | None) -> tuple[FloatArray, BoolArray]:
    """Return plain normals and where they can be integrated: where the mask says, if there is one."""
    vectors = plain("normals", without_mask(normals, math.nan), np.float32)
    if vectors.ndim != NORMALS_NDIM or vectors.shape[2] != NORMALS_NDIM:
        msg = f"normals: must have shape (H, W, 3), got {vectors.shape}"
        raise InputError(msg)
    if mask is not None:
        return vectors, _bool_mask(mask, vectors.shape[:2])
    return vectors, _bgars.usable_normals(vectors, threads=threads)


def used_pixels(valid: BoolArray, mask: ArrayLike | None) -> BoolArray:
    """Return the pixels of both masks, in an array of its own."""
    use = np.zeros(valid.shape, np.bool_)
    np.logical_and(valid, valid if mask is None else _bool_mask(mask, valid.shape), out=use)
    return use


def _bool_mask(mask: ArrayLike, shape: tuple[int, ...]) -> BoolArray:
    """Return the mask, or raise InputError unless it is one of this shape."""
    given = plain_bool("mask", mask)
    if given.shape != shape:
        msg = f"mask: must be bool of shape {shape}, got shape {given.shape}"
        raise InputError(msg)
    return given


def edge_trust(
    normals: NormalField | ArrayLike, weights: Literal["confidence"] | ArrayLike | None, use: BoolArray
) -> FloatArray | None:
    """Return the weights of the pixels as an array; None for none."""
    if weights is None:
        return None
    if isinstance(weights, str):
        if weights != "confidence" or not isinstance(normals, NormalField):
            msg = f"weights: must be an array of shape (H, W), or 'confidence' with a NormalField; got {weights!r}"
            raise InputError(msg)
        return normals.confidence
    trust = plain("weights", without_mask(weights, 0.0), np.float32)
    if trust.shape != use.shape:
        msg = f"weights: must have shape {use.shape}, got {trust.shape}"
        raise InputError(msg)
    return trust


def anchor_regions(anchors: object, shape: tuple[int, ...]) -> NDArray[np.int32] | None:
    """Return the regions of the anchors, checked; None for none."""
    if anchors is None:
        return None
    if not isinstance(anchors, Anchors):
        msg = f"anchors: must be bgars.Anchors, got {type(anchors).__name__}"
        raise InputError(msg)
    anchors.check(shape)
    return None if anchors.regions is None else plain("anchors.regions", anchors.regions, np.int32)
