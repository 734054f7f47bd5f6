"""Numeric arrays of MATLAB files, version 5 to 7 (MathWorks, "MAT-File Format", 2023, chapter 1).

Every length is checked before it is followed, so that a damaged file is an error; common readers crash on some.
"""

from __future__ import annotations

import struct
import zlib
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Container, Iterator
    from typing import Any

    from numpy.typing import NDArray

__all__ = ["read_arrays", "read_texts"]

HEADER_BYTES = 128
MATRIX, COMPRESSED = 14, 15
STORED = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
CELL, CHARACTERS, NUMERIC_CLASSES = 1, 4, range(6, 16)
COMPLEX = 0x0800
MAX_AXES = 8
MAX_ELEMENTS = 10_000
ALIGNED = 8


class Element(NamedTuple):
    """A tagged piece of a file."""

    kind: int
    data: memoryview
    end: int


class Matrix(NamedTuple):
    """A variable: its class, whether it is complex, its sizes and name, and where its values begin."""

    kind: int
    is_complex: bool
    shape: tuple[int, ...]
    name: str
    content: memoryview


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
    arrays: dict[str, NDArray[Any]] = {}
    for data, order in _matrices(content, max_bytes):
        _add_array(arrays, data, order)
    return arrays


def read_texts(content: bytes, max_bytes: int) -> dict[str, tuple[str, ...]]:
    """Return the texts by name: the rows of a matrix of characters, or the cells of an array of texts.

    Parameters and errors as of :func:`read_arrays`.
    """
    texts: dict[str, tuple[str, ...]] = {}
    for data, order in _matrices(content, max_bytes):
        matrix = _matrix(data, order, (CELL, CHARACTERS))
        rows = _cells(matrix, order) if matrix is not None and matrix.kind == CELL else _rows(matrix, order)
        if matrix is not None and rows is not None:
            texts[matrix.name] = rows
    return texts


def _matrices(content: bytes, max_bytes: int) -> Iterator[tuple[memoryview, str]]:
    """Yield each variable, unpacked, and the order of its bytes."""
    mark = content[126:128]
    if len(content) < HEADER_BYTES or mark not in (b"IM", b"MI"):
        msg = "no header of MATLAB 5 to 7"
        raise ValueError(msg)
    order = "<" if mark == b"IM" else ">"
    data, place = memoryview(content), HEADER_BYTES
    for _ in range(MAX_ELEMENTS):
        if place + ALIGNED > len(data):
            return
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
            yield element.data, order
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


def _matrix(data: memoryview, order: str, kinds: Container[int]) -> Matrix | None:
    """Read what a variable of some classes begins with; None of any other, which may begin as it likes."""
    if len(data) == 0:
        return None
    flags = _element(data, 0, order)
    if len(flags.data) < 4:  # noqa: PLR2004 - one number
        msg = "a variable without its kind"
        raise ValueError(msg)
    (word,) = struct.unpack_from(order + "I", flags.data)
    if word & 0xFF not in kinds:
        return None
    sizes = _element(data, flags.end, order)
    name = _element(data, sizes.end, order)
    if len(sizes.data) % 4 or len(sizes.data) // 4 not in range(2, MAX_AXES + 1):
        msg = "a variable without sizes or values"
        raise ValueError(msg)
    shape = struct.unpack(order + "i" * (len(sizes.data) // 4), sizes.data)
    return Matrix(word & 0xFF, bool(word & COMPLEX), shape, bytes(name.data).decode("latin-1"), data[name.end :])


def _add_array(arrays: dict[str, NDArray[Any]], data: memoryview, order: str) -> None:
    matrix = _matrix(data, order, NUMERIC_CLASSES)
    if matrix is None or matrix.is_complex:
        return
    values, shape = _element(matrix.content, 0, order), matrix.shape
    if values.kind not in STORED:
        msg = "a variable without sizes or values"
        raise ValueError(msg)
    stored = np.dtype(order + STORED[values.kind])
    if min(shape) < 0 or np.prod(shape, dtype=float) * stored.itemsize != len(values.data):
        msg = f"a variable of {'x'.join(map(str, shape))} has {len(values.data)} bytes of values"
        raise ValueError(msg)
    array = np.frombuffer(values.data, stored).reshape(shape, order="F")
    arrays[matrix.name] = array.astype(stored.newbyteorder("="))


def _cells(matrix: Matrix, order: str) -> tuple[str, ...] | None:
    """Texts of the cells of an array; None where one is no text of one row."""
    texts: list[str] = []
    place = 0
    while place + ALIGNED <= len(matrix.content) and len(texts) < MAX_ELEMENTS:
        element = _element(matrix.content, place, order)
        place = element.end
        rows = _rows(_matrix(element.data, order, (CHARACTERS,)), order) if element.kind == MATRIX else None
        if rows is None or len(rows) != 1:
            return None
        texts.append(rows[0])
    return tuple(texts)


def _rows(matrix: Matrix | None, order: str) -> tuple[str, ...] | None:
    """Rows of a matrix of characters without the blanks at their ends; None for anything else."""
    if matrix is None or matrix.kind != CHARACTERS or len(matrix.shape) != 2:  # noqa: PLR2004 - a matrix
        return None
    values = _element(matrix.content, 0, order)
    encoding = {16: "utf-8", 2: "latin-1", 1: "latin-1"}.get(values.kind, f"utf-16-{'le' if order == '<' else 'be'}")
    text = bytes(values.data).decode(encoding, errors="replace")
    count, length = matrix.shape
    if min(count, length) < 1 or len(text) != count * length:
        return None
    return tuple(text[row::count].rstrip() for row in range(count))  # column by column
