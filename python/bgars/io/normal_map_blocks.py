"""Pixels of a JPEG or WebP normal map that its blocks have mixed with what surrounds the object.

These formats round the coefficients of a block, not its pixels: an edge within a block leaves errors of some ten
degrees on all of its pixels, not near the edge alone.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy  # loads its modules when they are used

if TYPE_CHECKING:
    from pathlib import Path

    from bgars.records.pixels import BoolArray

__all__ = ["Blocks", "blocks_of", "mixed_with"]

UNIT_PX = 8
"""Rows and columns of a block of JPEG (ITU-T T.81, A.1.1); one of halved colour covers twice as many pixels."""
MACROBLOCK_PX = 16
"""Of WebP (RFC 6386, section 2), whose colour is always halved."""
FRAME_HEADERS = (*range(0xC0, 0xC4), *range(0xC5, 0xC8), *range(0xC9, 0xCC), *range(0xCD, 0xD0))
HEAD_BYTES = 1 << 20
UPSAMPLED_PX = 1
"""Decoders spread halved colour over the next pixel of a neighbouring block."""
LOOP_FILTER_PX = 7
"""WebP smooths three values on either side of a block's edge (RFC 6386, section 15), of colour six pixels."""

RINGING_PX = 2
"""Pixels along an edge whose colour is no longer that of the surround: its halved colour is as wide."""


class Blocks(NamedTuple):
    """Pixels that were rounded together, and how many beyond them a block can reach."""

    rows: int
    cols: int
    reach_px: int


USUAL = Blocks(2 * UNIT_PX, 2 * UNIT_PX, UPSAMPLED_PX)
"""Of a JPEG whose frame header lies too far behind others: halved colour is the default of all programs."""


def blocks_of(path: Path) -> Blocks | None:
    """Return the blocks of a lossy file, as its first bytes tell; None where each pixel is stored as it is."""
    with path.open("rb") as file:
        head = file.read(HEAD_BYTES)
    if head.startswith(b"\xff\xd8\xff"):
        try:
            return _jpeg_blocks(head)
        except (struct.error, IndexError):
            return USUAL
    if head[8:16] in {b"WEBPVP8 ", b"WEBPVP8X"} and b"VP8 " in head:  # VP8L is lossless
        return Blocks(MACROBLOCK_PX, MACROBLOCK_PX, LOOP_FILTER_PX)
    return None


def _jpeg_blocks(head: bytes) -> Blocks:
    """From the sampling factors of the frame header."""
    place = 2
    while True:
        _, marker, length = struct.unpack_from(">BBH", head, place)
        if marker in FRAME_HEADERS:
            factors = [head[place + 11 + 3 * index] for index in range(head[place + 9])]
            rows, cols = max(each & 15 for each in factors), max(each >> 4 for each in factors)
            return Blocks(UNIT_PX * rows, UNIT_PX * cols, UPSAMPLED_PX if len(set(factors)) > 1 else 0)
        place += 2 + length


def mixed_with(outside: BoolArray, odd: BoolArray, blocks: Blocks) -> BoolArray:
    """True on the pixels of all blocks in which something of the surround is.

    Parameters
    ----------
    outside : (H, W)
        What is known to be surround.
    odd : (H, W)
        Pixels that are no unit vectors; those connected with the surround belong to it.
    blocks : Blocks
        Of the file.
    """
    outside = scipy.ndimage.binary_propagation(outside, mask=outside | odd)
    outside = scipy.ndimage.binary_dilation(outside, iterations=RINGING_PX)
    rows, cols = (-(-size // step) for size, step in zip(outside.shape, blocks[:2], strict=True))
    padded = np.zeros((rows * blocks.rows, cols * blocks.cols), np.bool_)
    padded[: outside.shape[0], : outside.shape[1]] = outside
    hit = padded.reshape(rows, blocks.rows, cols, blocks.cols).any(axis=(1, 3))
    mixed = hit.repeat(blocks.rows, axis=0).repeat(blocks.cols, axis=1)[: outside.shape[0], : outside.shape[1]]
    if blocks.reach_px and mixed.any():
        mixed = scipy.ndimage.binary_dilation(mixed, np.ones((3, 3), np.bool_), iterations=blocks.reach_px)
    found: BoolArray = mixed
    return found
