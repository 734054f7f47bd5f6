"""The arrays that the kernels of normals write to, fresh ones or those of an earlier result."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from bgars.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bgars.records.normal_field import NormalField
    from bgars.records.pixels import BoolArray, FloatArray

__all__ = ["KernelOutputs", "fresh_outputs", "kernel_view", "measured_by", "outputs_of"]


class KernelOutputs(NamedTuple):
    """Attributes of :class:`bgars.NormalField`; `measured`, there `is_measured`, is None where it would be the mask."""

    normals: FloatArray
    albedo: FloatArray
    mask: BoolArray
    confidence: FloatArray
    measured: BoolArray | None
    lights_kept: NDArray[np.uint16]
    kept_sets: BoolArray | None


def fresh_outputs(shape: tuple[int, int], set_lights: int, *, fills: bool) -> KernelOutputs:
    """Arrays for images of a shape (H, W).

    Parameters
    ----------
    set_lights : int
        Lights of the kept sets; 0 where these are not asked for.
    fills : bool
        Whether normals may be filled in that are not measured.
    """
    return KernelOutputs(
        normals=np.zeros((*shape, 3), np.float32),
        albedo=np.zeros(shape, np.float32),
        mask=np.zeros(shape, np.bool_),
        confidence=np.zeros(shape, np.float32),
        measured=np.zeros(shape, np.bool_) if fills else None,
        lights_kept=np.zeros(shape, np.uint16),
        kept_sets=np.zeros((*shape, set_lights), np.bool_) if set_lights else None,
    )


def outputs_of(field: NormalField, shape: tuple[int, int], set_lights: int, *, fills: bool) -> KernelOutputs:
    """Arrays of an earlier result, to be overwritten; arguments as of :func:`fresh_outputs`."""
    height, width = shape
    found = field.normals.shape
    if found != (height, width, 3):
        msg = f"out: must be the result for images of {width} x {height} pixels, got one for {found[1]} x {found[0]}"
        raise InputError(msg)
    sets_shape = (height, width, set_lights) if set_lights else None
    if (None if field.kept_sets is None else field.kept_sets.shape) != sets_shape:
        msg = "out: must have kept sets, for the same number of lights, exactly when keep_sets is asked for"
        raise InputError(msg)
    measured: BoolArray | None = field.is_measured
    if _shows(field.is_measured, field.mask):
        measured = np.zeros(shape, np.bool_) if fills else None
    outputs = KernelOutputs(
        field.normals, field.albedo, field.mask, field.confidence, measured, field.lights_kept, field.kept_sets
    )
    for name, array in zip(KernelOutputs._fields, outputs, strict=True):
        if array is not None and not array.flags.writeable:
            told = "is_measured" if name == "measured" else name
            msg = f"out: its arrays are overwritten, but {told} is read-only"
            raise InputError(msg)
        if array is not None and array.dtype == np.bool_ and (levels := array.view(np.uint8)).max(initial=0) > 1:
            np.not_equal(levels, 0, out=array)  # no value of bool, which the kernels would take it for
    return outputs


def kernel_view(field: NormalField) -> KernelOutputs:
    """The arrays of a field under the names by which the kernels know them."""
    return KernelOutputs(
        field.normals,
        field.albedo,
        field.mask,
        field.confidence,
        field.is_measured,
        field.lights_kept,
        field.kept_sets,
    )


def measured_by(outputs: KernelOutputs) -> BoolArray:
    """What is measured: where the kernels have not said it, a read-only view of the mask."""
    if outputs.measured is not None:
        return outputs.measured
    measured = outputs.mask.view()
    measured.flags.writeable = False
    return measured


def _shows(measured: BoolArray, mask: BoolArray) -> bool:
    """Whether it is a view of the mask, as of :func:`measured_by`."""
    return not measured.flags.writeable and measured.base is mask
