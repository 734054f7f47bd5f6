"""Arrays as the kernels read them: C order, native bytes, aligned, unmasked; copied only where they are not."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from bgars.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, DTypeLike, NDArray

__all__ = [
    "every_pixel",
    "integer_full_scale",
    "keep",
    "masked_pixels",
    "plain",
    "plain_bool",
    "plain_fields",
    "without_mask",
]


def plain(name: str, values: ArrayLike, dtype: DTypeLike | None = None) -> NDArray[Any]:
    """Return an array in C order, of native bytes and aligned; the same object where it is so already.

    Raises
    ------
    InputError
        No numbers of this type, or a numpy masked array: its mask would be lost.
    """
    if isinstance(values, np.ma.MaskedArray):
        msg = f"{name}: is a numpy masked array; fill it, and say in a mask which values count"
        raise InputError(msg)
    try:
        array = np.asarray(values)
        wanted = array.dtype if dtype is None else np.dtype(dtype)
        if not wanted.isnative:  # a dtype made anew would make a view, not the same object
            wanted = wanted.newbyteorder("=")
        if wanted.kind not in "bc" and array.dtype.kind == "c":
            msg = f"{name}: must be real numbers, got {array.dtype}"
            raise InputError(msg)
        return np.require(array, wanted, ["C", "A"])
    except InputError:
        raise
    except (TypeError, ValueError, OverflowError) as error:
        reason = " ".join(str(error).split())
        msg = f"{name}: must be an array of numbers ({reason})"
        raise InputError(msg) from error


def plain_bool(name: str, values: ArrayLike) -> NDArray[np.bool_]:
    """Return a mask of zeros and ones in C order; what a numpy masked array hides is False.

    ``view(bool)`` of other bytes than 0 and 1 makes bools that are neither. One True for all pixels stays one.

    Raises
    ------
    InputError
        Other values than bools.
    """
    try:
        given = np.asarray(without_mask(values, False))
    except (TypeError, ValueError) as error:
        msg = f"{name}: must be bool ({' '.join(str(error).split())})"
        raise InputError(msg) from error
    if given.dtype != np.bool_:
        msg = f"{name}: must be bool, got {given.dtype}"
        raise InputError(msg)
    levels = given.view(np.uint8)
    is_constant = given.size > 0 and not any(given.strides)
    if (levels.flat[:1] if is_constant else levels).max(initial=0) > 1:
        given = levels != 0
    return given if is_constant else np.require(given, np.bool_, ["C", "A"])


def without_mask(values: ArrayLike, fill: float | bool) -> ArrayLike:
    """Return what a numpy masked array holds, with `fill` where it is masked; anything else as it is."""
    if not isinstance(values, np.ma.MaskedArray):
        return values
    if fill != fill and values.dtype.kind in "iu":  # noqa: PLR0124 - NaN, which integers have not
        values = values.astype(np.float32)
    return np.ma.filled(values, fill)


def masked_pixels(stack: ArrayLike) -> NDArray[np.bool_] | None:
    """(H, W) True where any value of a numpy masked stack (L, H, W[, channels]) is masked; None of another array."""
    if not isinstance(stack, np.ma.MaskedArray):
        return None
    return np.asarray(np.ma.getmaskarray(stack).any(axis=(0, *range(3, stack.ndim))))


def keep(record: object, arrays: dict[str, Any]) -> None:
    """Put arrays into a frozen record that is being made."""
    for name, array in arrays.items():
        object.__setattr__(record, name, array)


def plain_fields(record: object, types: dict[str, Any]) -> None:
    """Bring arrays of a record into C order and their types; without those that are None."""
    given = {name: getattr(record, name) for name in types}
    keep(
        record,
        {
            name: plain_bool(name, values) if types[name] is np.bool_ else plain(name, values, types[name])
            for name, values in given.items()
            if values is not None
        },
    )


def every_pixel(shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """Return a read-only mask (H, W) that uses every pixel: one True in memory."""
    return np.ndarray(shape, np.bool_, b"\x01", strides=(0, 0))


def integer_full_scale(pixels: NDArray[Any]) -> float | None:
    """Return the largest grey level of an integer dtype (255 or 65535), None for floats."""
    return float((1 << 8 * pixels.dtype.itemsize) - 1) if pixels.dtype.kind == "u" else None
