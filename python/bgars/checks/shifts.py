"""How far images are shifted against each other, by the edges that they share.

Edges of albedo and outlines lie where they lie under every lamp; which side is bright does not. So not grey levels are
compared but the squares of their gradients, ``g g^T / (g^2 + e^2)``: the direction of an edge without its sign or its
contrast. Each image's is correlated with the sum of the others'. Shadows and highlights move with the lamp, and take
the peak along in proportion to the direction of the light; what does not go with it is a shift.

References
----------
E. Haber, J. Modersitzki, Intensity gradient based registration and fusion of multi-modal images, MICCAI 2006.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bgars.checks.patches import cut_patches

if TYPE_CHECKING:
    from collections.abc import Iterator

    from bgars.checks.patches import Patch
    from bgars.records.capture import Capture

__all__ = ["ImageShifts", "edge_products", "image_shifts"]

Array = NDArray[np.float64]
Floats = NDArray[np.float32]

SIDE_PX = 160
TILE_PX = 64
REACH_PX = 8
"""Largest shift that is looked for, along each axis."""
PASSES = 4
"""Binomial filters of three pixels: with them gradients rise over the noise of a dim board."""
COVERED = 0.5
"""Share of a tile that must be inside the mask."""
MIN_TILES = 4


class ImageShifts(NamedTuple):
    """(L, 2) place of each image's edges against those of the others, px, x right and y up; the same without a tile."""

    place_px: Array
    without_px: Array
    """(T, L, 2)"""
    agreement: Array
    """(L,) how well the edges agree at that place, of the median of the images."""


def image_shifts(capture: Capture, kept: NDArray[np.intp]) -> ImageShifts | None:
    """Register each image with the sum of the others; None where there is too little to go by.

    Parameters
    ----------
    capture : Capture
    kept : (K,) intp
        Images with light of their own.
    """
    surfaces = np.array(
        [each for patch in cut_patches(capture, SIDE_PX) for each in _surfaces(patch, patch.levels[kept])]
    )
    if len(surfaces) < MIN_TILES:
        return None
    total = surfaces.sum(axis=0)
    height = total.max(axis=(1, 2))
    without = np.array([_peaks(total - each) for each in surfaces])
    return ImageShifts(_peaks(total), without, height / max(float(np.median(height)), 1e-12))


def _surfaces(patch: Patch, levels: Floats) -> Iterator[Array]:
    """(L, 2 R + 1, 2 R + 1) correlation of each image with the others, of every tile."""
    if min(patch.inside.shape) < 2 * (PASSES + REACH_PX) + 1:
        return  # Smaller than the shifts that are looked for.
    edges = edge_products(levels, PASSES)
    inside = patch.inside[PASSES:-PASSES, PASSES:-PASSES]
    rows, cols = inside.shape
    for row in _cuts(rows):
        for col in _cuts(cols):
            share = inside[row, col]
            if share.mean() < COVERED:
                continue
            # Transforms of float32 take longer than those of float64.
            tile = edges[..., row, col].astype(np.float64)
            own = whole = np.fft.rfft2(tile - tile.mean(axis=(-2, -1), keepdims=True))
            if not share.all():
                masked = tile * share
                whole = np.fft.rfft2(masked - masked.mean(axis=(-2, -1), keepdims=True))
            others = whole.sum(axis=1, keepdims=True) - whole
            found = np.fft.irfft2((own * others.conj()).sum(axis=0), s=share.shape)
            yield np.roll(found, (REACH_PX, REACH_PX), axis=(1, 2))[:, : 2 * REACH_PX + 1, : 2 * REACH_PX + 1]


def edge_products(levels: Floats, passes: int) -> Floats:
    """(3, L, h, w) products of the gradients, over their size: xx, xy and yy; `passes` pixels of border are cut off."""
    smooth = levels
    quarter, half = np.float32(0.25), np.float32(0.5)
    for _ in range(passes):
        smooth = quarter * (smooth[..., :-2, :] + smooth[..., 2:, :]) + half * smooth[..., 1:-1, :]
        smooth = quarter * (smooth[..., :-2] + smooth[..., 2:]) + half * smooth[..., 1:-1]
    across, down = np.gradient(smooth, axis=-1), np.gradient(smooth, axis=-2)
    square = across**2 + down**2
    # Half of the pixels show nothing but noise and slow shading.
    square += np.median(square, axis=(-2, -1), keepdims=True) + np.float32(1e-12)
    edges: Floats = np.stack([across**2, np.float32(2.0**0.5) * across * down, down**2]) / square
    return edges


def _cuts(size: int) -> list[slice]:
    """Tiles of equal sides, multiples of 4: a transform whose length is a large prime takes three times as long."""
    count = max(1, size // TILE_PX)
    side = max(size // count // 4 * 4, 1)
    return [slice(int(first), int(first) + side) for first in np.linspace(0, size - side, count)]


def _peaks(surfaces: Array) -> Array:
    """(L, 2) places of the highest points, x right and y up: of the parabolas through their neighbours."""
    size = surfaces.shape[-1]
    # Of the peaks of a regular pattern, which are as high, the nearest.
    away = np.square(np.arange(size) - REACH_PX)
    near = np.exp(-(away[:, None] + away[None, :]) / (2.0 * (2.0 * REACH_PX) ** 2))
    raised = surfaces - surfaces.min(axis=(1, 2), keepdims=True)
    highest = (raised * near).reshape(len(surfaces), -1).argmax(axis=1)
    places = []
    for surface, at in zip(surfaces, highest, strict=True):
        row, col = (min(max(int(each), 1), size - 2) for each in divmod(int(at), size))
        down = _vertex(surface[row - 1 : row + 2, col])
        right = _vertex(surface[row, col - 1 : col + 2])
        places.append((col + right - REACH_PX, REACH_PX - row - down))
    return np.array(places)


def _vertex(three: Array) -> float:
    """Place of the vertex of a parabola through three values at -1, 0, 1."""
    bend = float(three[0] - 2.0 * three[1] + three[2])
    return float(np.clip(0.5 * (three[0] - three[2]) / bend, -1.0, 1.0)) if bend < 0.0 else 0.0
