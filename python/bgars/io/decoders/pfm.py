"""PFM: float32 as it lies in memory, the bottom row first (Debevec, HDR Shop 1998; stereo and shape data sets)."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from bgars.errors import FileFormatError
from bgars.io.decoders.limits import check_size

if TYPE_CHECKING:
    from pathlib import Path

    from bgars.io.image_formats import ImageFormat
    from bgars.records.pixels import PixelArray

__all__ = ["read_pfm"]

HEADER = re.compile(rb"(P[Ff])\s+(\d{1,9})\s+(\d{1,9})\s+([-+]?[0-9.]{1,20}(?:[eE][-+]?\d{1,3})?)(?:\r\n|\s)")
CHANNELS = {b"PF": 3, b"Pf": 1}


def read_pfm(path: Path, kind: ImageFormat, max_megapixels: float) -> PixelArray:  # noqa: ARG001 - all decoders alike
    """Return (H, W) or (H, W, 3) float32 as stored: the header's scale is a unit, which files fill in as they like."""
    content = path.read_bytes()
    header = HEADER.match(content)
    if header is None:
        msg = f"{path}: cannot be decoded as an image (no PFM header of columns, rows and scale)"
        raise FileFormatError(msg)
    columns, rows, channels = int(header[2]), int(header[3]), CHANNELS[header[1]]
    check_size(path, rows, columns, max_megapixels)
    expected, held = rows * columns * channels * 4, len(content) - header.end()
    if held != expected:
        msg = f"{path}: cannot be decoded as an image ({held} bytes of pixels, {expected} expected)"
        raise FileFormatError(msg)
    # A scale below 0 says that the lowest byte comes first.
    order = "<f4" if header[4].startswith(b"-") else ">f4"
    values = np.frombuffer(content, order, offset=header.end()).astype(np.float32)
    shape = (rows, columns) if channels == 1 else (rows, columns, channels)
    return values.reshape(shape)[::-1]
