"""Normals to integrate: one wavy, noisy surface on masks that a solver finds easy or hard."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

SLOPE_NOISE = 0.01
"""Standard deviation added to each slope: no surface has exactly these normals, as with measured ones."""
WALLS = 8
WALL_GAP_PX = 8
CUTS = 16
HOLES_ACROSS = 12


class Field(NamedTuple):
    """Unit normals (H, W, 3) float32 and the mask (H, W)."""

    normals: NDArray[np.float32]
    mask: NDArray[np.bool_]


def make_field(shape: str, side: int) -> Field:
    """A square field: "rectangle" (the full image), "disc with holes", or a kind of slits: `MASKS`, `GRAPH_MASKS`."""
    return Field(_wavy_normals(side), (MASKS | GRAPH_MASKS)[shape](side))


def _wavy_normals(side: int) -> NDArray[np.float32]:
    """Waves as long as the image and waves of 37 and 53 pixels, slopes up to about 0.6, and noise on the slopes."""
    random = np.random.default_rng(3)
    along = np.arange(side, dtype=np.float32)
    turn = 2.0 * np.pi
    normals = np.zeros((side, side, 3), dtype=np.float32)
    long_x, short_x = np.cos(turn * along / side), np.cos(turn * along / 37.0)
    for row in range(side):
        long_y, short_y = np.cos(turn * 1.5 * row / side), np.cos(turn * row / 53.0)
        p, q = random.normal(0.0, SLOPE_NOISE, (2, side)).astype(np.float32)
        p += 0.35 * long_x + 0.25 * short_x
        q += 0.35 * long_y + 0.25 * short_y
        inverse = 1.0 / np.sqrt(1.0 + p * p + q * q)
        normals[row] = np.stack([-p * inverse, -q * inverse, inverse], axis=-1)
    return normals


def _rectangle(side: int) -> NDArray[np.bool_]:
    return np.ones((side, side), dtype=np.bool_)


def _disc_with_holes(side: int) -> NDArray[np.bool_]:
    """A disc as wide as the image, with round holes on a grid."""
    middle = (side - 1) / 2.0
    rows, cols = np.ogrid[0:side, 0:side]
    disc = (rows - middle) ** 2 + (cols - middle) ** 2 < (0.48 * side) ** 2
    pitch = side / HOLES_ACROSS
    y, x = (rows % pitch) - pitch / 2.0, (cols % pitch) - pitch / 2.0
    return disc & (y * y + x * x >= (0.2 * pitch) ** 2)


def _winding_slits(side: int) -> NDArray[np.bool_]:
    """Walls one pixel thin, open at the top and at the bottom by turns: one long winding lane."""
    mask = np.ones((side, side), dtype=np.bool_)
    for turn, col in enumerate(range(side // WALLS, side - 1, side // WALLS)):
        wall = slice(WALL_GAP_PX, None) if turn % 2 else slice(None, -WALL_GAP_PX)
        mask[wall, col] = False
    return mask


def _random_slits(side: int) -> NDArray[np.bool_]:
    """Cuts one pixel thin and a quarter of the image long, along rows and columns, wherever they fall."""
    return _cut(side, CUTS, side // 4)


def _dense_slits(side: int) -> NDArray[np.bool_]:
    """Cuts of 256 pixels, one for every 128 x 128: the longer the side, the more a coarse pixel has to keep apart."""
    return _cut(side, (side // 128) ** 2, 256)


def _cut(side: int, cuts: int, length: int) -> NDArray[np.bool_]:
    random = np.random.default_rng(0)
    mask = np.ones((side, side), dtype=np.bool_)
    for cut in range(cuts):
        row, col = (random.random(2) * side).astype(int)
        if cut % 2:
            mask[row : row + length, col] = False
        else:
            mask[row, col : col + length] = False
    return mask


def _many_holes(side: int) -> NDArray[np.bool_]:
    """Three pixels in ten missing, wherever they fall."""
    return np.random.default_rng(5).random((side, side)) > 0.3


def _quarter_holes(side: int) -> NDArray[np.bool_]:
    """One pixel in four missing: about the fewest that leave nothing to grids, and so the most for the graph."""
    return np.random.default_rng(5).random((side, side)) > 0.25


def _narrow_lanes(side: int) -> NDArray[np.bool_]:
    """Lanes one pixel wide with walls as wide between them, all open at the bottom."""
    mask = np.ones((side, side), dtype=np.bool_)
    mask[:-1, 0::2] = False
    return mask


MASKS = {
    "rectangle": _rectangle,
    "disc with holes": _disc_with_holes,
    "winding slits": _winding_slits,
    "random slits": _random_slits,
    "dense slits": _dense_slits,
}

GRAPH_MASKS = {"many holes": _many_holes, "quarter holes": _quarter_holes, "narrow lanes": _narrow_lanes}
"""Nearly all of these is the graph's: for `memory.py` by hand, not in the tables."""
