"""Numeric arrays of MATLAB files, version 5 to 7 (MathWorks, "MAT-File Format", 2023, chapter 1).

Every length is checked before it is followed, so that a damaged file is an error; common readers crash on some.
"""

from __future__ import annotations

import struct
import zlib
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from typing import Any

    from numpy.typing import NDArray

__all__ = ["read_arrays"]

HEADER_BYTES = 128
MATRIX, COMPRESSED = 14, 15
STORED = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
NUMERIC_CLASSES = range(6, 16)
COMPLEX = 0x0800
MAX_AXES = 8
MAX_ELEMENTS = 10_000
ALIGNED = 8


class Element(NamedTuple):
    """A tagged piece of a file."""

    kind: int
    data: memoryview
    end: int


def read_arrays(content: bytes, max_bytes: int) -> dict[str, NDArray[Any]]:
    """Return the real numeric arrays by name; text, cells, structures and sparse matrices are left out.

    Parameters
    ----------
    content : bytes
        The file.
    max_bytes : int
        Most bytes that a compressed variable may unpack to.

    Raises
    ------
    ValueError
        The bytes are no such file, or damaged.
    """
    mark = content[126:128]
    if len(content) < HEADER_BYTES or mark not in (b"IM", b"MI"):
        msg = "no header of MATLAB 5 to 7"
        raise ValueError(msg)
    order = "<" if mark == b"IM" else ">"
    arrays: dict[str, NDArray[Any]] = {}
    data, place = memoryview(content), HEADER_BYTES
    for _ in range(MAX_ELEMENTS):
        if place + ALIGNED > len(data):
            return arrays
        element = _element(data, place, order, pad=False)
        place = element.end
        if element.kind == COMPRESSED:
            unpacker = zlib.decompressobj()
            try:
                inner = unpacker.decompress(element.data, max_bytes)
            except zlib.error as error:
                msg = f"a compressed variable is damaged ({error})"
                raise ValueError(msg) from error
            if unpacker.unconsumed_tail:
                msg = f"a compressed variable has more than {max_bytes} bytes"
                raise ValueError(msg)
            element = _element(memoryview(inner), 0, order, pad=False)
        if element.kind == MATRIX:
            _add_array(arrays, element.data, order)
    msg = f"more than {MAX_ELEMENTS} variables"
    raise ValueError(msg)


def _element(data: memoryview, place: int, order: str, *, pad: bool = True) -> Element:
    """Read a tag and what it announces."""
    if place + ALIGNED > len(data):
        msg = f"ends within a variable, at byte {place}"
        raise ValueError(msg)
    kind, length = struct.unpack_from(order + "II", data, place)
    start = place + ALIGNED
    if kind >> 16:  # a small element: length and up to four bytes within the tag
        kind, length, start = kind & 0xFFFF, kind >> 16, place + 4
        if length > 4:  # noqa: PLR2004 - as above
            msg = f"a small element announces {length} bytes"
            raise ValueError(msg)
        return Element(kind, data[start : start + length], place + ALIGNED)
    if length > len(data) - start:
        msg = f"announces {length} bytes, but {len(data) - start} follow"
        raise ValueError(msg)
    end = start + length
    return Element(kind, data[start:end], end + (-length) % ALIGNED if pad else end)


def _add_array(arrays: dict[str, NDArray[Any]], data: memoryview, order: str) -> None:
    if len(data) == 0:
        return
    flags = _element(data, 0, order)
    if len(flags.data) < 4:  # noqa: PLR2004 - one number
        msg = "a variable without its kind"
        raise ValueError(msg)
    (word,) = struct.unpack_from(order + "I", flags.data)
    if word & 0xFF not in NUMERIC_CLASSES or word & COMPLEX:
        return
    sizes = _element(data, flags.end, order)
    name = _element(data, sizes.end, order)
    values = _element(data, name.end, order)
    if len(sizes.data) % 4 or len(sizes.data) // 4 not in range(2, MAX_AXES + 1) or values.kind not in STORED:
        msg = "a variable without sizes or values"
        raise ValueError(msg)
    shape = struct.unpack(order + "i" * (len(sizes.data) // 4), sizes.data)
    stored = np.dtype(order + STORED[values.kind])
    if min(shape) < 0 or np.prod(shape, dtype=float) * stored.itemsize != len(values.data):
        msg = f"a variable of {'x'.join(map(str, shape))} has {len(values.data)} bytes of values"
        raise ValueError(msg)
    array = np.frombuffer(values.data, stored).reshape(shape, order="F")
    arrays[bytes(name.data).decode("latin-1")] = array.astype(stored.newbyteorder("="))
