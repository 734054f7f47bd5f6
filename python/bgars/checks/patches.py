"""Parts of a capture at full resolution, spread over the image: where noise and the floor of shadows are measured."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bgars.checks.view import linear_values, used_scale

if TYPE_CHECKING:
    from collections.abc import Iterator

    from bgars.records.capture import Capture

__all__ = ["Patch", "box_blocks", "cut_patches"]

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

SIDE_PX = 96
ALONG = 3
"""Patches along each axis of a large image."""
NEAR_CLIP = 0.9
"""Of the clip level: noise is cut off above."""


class Patch(NamedTuple):
    """Linear light of full scale, above black (L, h, w); clipped (L, h, w); inside the mask (h, w)."""

    levels: Floats
    clipped: Mask
    inside: Mask


def cut_patches(capture: Capture, side_px: int = SIDE_PX) -> Iterator[Patch]:
    """Cut patches evenly over the image; the whole of a small one."""
    rows, cols = capture.mask.shape
    full = used_scale(capture, capture.images)
    dark = None if capture.dark is None else np.asarray(np.median(capture.dark), dtype=capture.dark.dtype)
    limit = min(float(capture.saturation), full)
    for first_row, end_row in _cuts(rows, side_px):
        for first_col, end_col in _cuts(cols, side_px):
            at = np.s_[first_row:end_row, first_col:end_col]
            raw = capture.images[:, at[0], at[1]]
            yield Patch(linear_values(capture, raw, dark), np.asarray(raw >= NEAR_CLIP * limit), capture.mask[at])


def _cuts(size: int, side_px: int) -> list[tuple[int, int]]:
    if size <= ALONG * side_px:
        return [(0, size)]
    firsts = np.linspace(0, size - side_px, ALONG).astype(int)
    return [(int(first), int(first) + side_px) for first in firsts]


def box_blocks(stack: Floats, side: int) -> Floats:
    """(..., h / side, w / side) means of blocks."""
    rows, cols = stack.shape[-2] // side, stack.shape[-1] // side
    cut = stack[..., : rows * side, : cols * side]
    blocks = cut.reshape(*stack.shape[:-2], rows, side, cols, side)
    means: Floats = blocks.mean(axis=(-3, -1), dtype=np.float32)
    return means
