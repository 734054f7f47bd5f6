"""Radiance HDR: red, green and blue mantissas with one exponent a pixel (Ward, Graphics Gems II, 1991)."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from bgars.errors import FileFormatError
from bgars.io.decoders.limits import check_size

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from bgars.io.image_formats import ImageFormat
    from bgars.records.pixels import PixelArray

__all__ = ["read_hdr"]

SIZE = re.compile(rb"([-+])Y (\d{1,9}) ([-+])X (\d{1,9})")
NEW_LENGTHS = range(8, 32768)
"""Widths of scan lines that may be packed channel by channel."""
EXPONENT_BIAS = 128 + 8


def read_hdr(path: Path, kind: ImageFormat, max_megapixels: float) -> PixelArray:  # noqa: ARG001 - all decoders alike
    """Return (H, W, 3) float32 radiances."""
    content = path.read_bytes()
    header, separator, rest = content.partition(b"\n\n")
    line, newline, data = rest.partition(b"\n")
    size = SIZE.fullmatch(line.strip())
    if not (separator and newline and size):
        msg = f"{path}: cannot be decoded as an image (no line of the size)"
        raise FileFormatError(msg)
    if b"32-bit_rle_xyze" in header:
        msg = f"{path}: holds CIE XYZ, not red, green and blue, which is not read"
        raise FileFormatError(msg)
    rows, columns = int(size[2]), int(size[4])
    check_size(path, rows, columns, max_megapixels)
    rgbe = _unpack(data, rows, columns, path)
    scale = np.ldexp(np.float32(1.0), rgbe[..., 3].astype(np.int32) - EXPONENT_BIAS)
    pixels = rgbe[..., :3].astype(np.float32) * np.where(rgbe[..., 3:] > 0, scale[..., None], np.float32(0.0))
    return pixels[:: -1 if size[1] == b"+" else 1, :: -1 if size[3] == b"-" else 1]


def _unpack(data: bytes, rows: int, columns: int, path: Path) -> NDArray[np.uint8]:
    if columns not in NEW_LENGTHS or data[:2] != b"\x02\x02":
        flat = np.frombuffer(data, np.uint8, count=-1)
        if flat.size != rows * columns * 4:
            msg = f"{path}: cannot be decoded as an image ({flat.size} bytes of pixels, {rows * columns * 4} expected)"
            raise FileFormatError(msg)
        return flat.reshape(rows, columns, 4)
    out = np.zeros((rows, 4, columns), np.uint8)
    place = 0
    for row in out:
        if data[place : place + 4] != b"\x02\x02" + columns.to_bytes(2, "big"):
            _refuse_packed(path)
        place += 4
        for channel in row:
            place = _unpack_channel(data, place, channel, path)
    return np.moveaxis(out, 1, 2)


def _unpack_channel(data: bytes, place: int, channel: NDArray[np.uint8], path: Path) -> int:
    """Fill one channel of a scan line from runs and literals; return where the next one begins."""
    column = 0
    while column < len(channel):
        count = data[place] if place + 1 < len(data) else 0
        is_run = count > 128  # noqa: PLR2004 - the top bit says run
        length = count - 128 if is_run else count
        if length == 0 or column + length > len(channel):
            _refuse_packed(path)
        values = data[place + 1 : place + 2] * length if is_run else data[place + 1 : place + 1 + length]
        if len(values) != length:
            _refuse_packed(path)
        channel[column : column + length] = np.frombuffer(values, np.uint8)
        column += length
        place += 2 if is_run else 1 + length
    return place


def _refuse_packed(path: Path) -> None:
    msg = f"{path}: cannot be decoded as an image (a packed scan line is damaged or truncated)"
    raise FileFormatError(msg)
