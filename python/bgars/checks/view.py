"""A small copy of a capture in linear light, on which nearly every check works."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from bgars.records.capture import Capture
    from bgars.records.pixels import PixelArray

__all__ = ["TILES", "View", "linear_values", "make_view", "tile_sums", "used_scale"]

Array = NDArray[np.float64]
Floats = NDArray[np.float32]

SIDE = 144
"""Rows and columns of the small copy, about: balls of ten pixels radius on a part of ten by ten are left."""
TAPS = 3
"""Pixels of a block that are read along each axis: enough to average noise away, a fraction of the memory traffic."""
TILES = 8
"""Tiles along each axis: each is one independent witness of the error models."""
FEWEST_BITS = 10
"""Depth of the cameras that write files of 16 bits, at least."""
MIN_SIGNAL = 4.0 / 255.0
"""Mean signal, of full scale, below which quantisation alone is 7 % of a value's differences between lights."""


@dataclass(frozen=True, eq=False)
class View:
    """The small copy.

    Attributes
    ----------
    values : (L, h, w) float32
        Linear light, of full scale: dark level taken away, response undone, near lights' fall-off undone, divided by
        the rig's intensities.
    use : (h, w) bool
        Inside the mask, and bright enough in the mean.
    clipped : (L, h, w) bool
        A pixel of the block is clipped.
    lights : (L, 3) float64
        Unit vectors to the lights, as the rig says.
    block_px : float
        Pixels of the capture along one pixel of this copy.
    names : tuple of str
        What to call the images.
    used_scale : float
        Full scale of `values`, of the files' full scale: below 1 where 16-bit files use fewer bits.
    """

    values: Floats
    use: NDArray[np.bool_]
    clipped: NDArray[np.bool_]
    lights: Array
    block_px: float
    names: tuple[str, ...]
    used_scale: float = 1.0

    @property
    def mean(self) -> Floats:
        """(h, w) mean over the lights."""
        mean: Floats = self.values.mean(axis=0)
        return mean

    @property
    def tiles(self) -> NDArray[np.intp]:
        """(h, w) number of the tile of each pixel."""
        rows, cols = self.values.shape[1:]
        across = np.arange(cols) * TILES // cols
        down = np.arange(rows) * TILES // rows
        numbers: NDArray[np.intp] = down[:, None] * TILES + across[None, :]
        return numbers

    def with_lights(self, lights: Array) -> View:
        """Return the same images under another table of lights."""
        return replace(self, lights=lights)

    def without(self, image: int) -> View:
        """Return the copy without one image."""
        keep = np.arange(len(self.values)) != image
        names = tuple(name for index, name in enumerate(self.names) if index != image)
        return replace(
            self,
            values=self.values[keep],
            clipped=self.clipped[keep],
            lights=self.lights[keep],
            names=names,
        )


def make_view(capture: Capture) -> View:
    """Reduce a capture.

    Parameters
    ----------
    capture : Capture

    Returns
    -------
    View
    """
    rows, cols = capture.mask.shape
    block = max(1, round((rows * cols) ** 0.5 / SIDE))
    taps = min(TAPS, block)
    step = block // taps
    step = max(step, 1)
    grid = step * taps
    high, wide = max(rows // grid, 1), max(cols // grid, 1)
    picked = np.s_[: high * grid : step, : wide * grid : step]
    raw = capture.images[:, picked[0], picked[1]]
    sub_mask = capture.mask[picked]
    value = linear_values(capture, raw, None if capture.dark is None else capture.dark[picked])
    value = value / capture.rig.intensities.astype(np.float32)[:, None, None]
    lights = capture.rig.directions / np.linalg.norm(capture.rig.directions, axis=1, keepdims=True)
    if capture.rig.is_near:
        value = value * _near_gain(capture, picked)
    inside = _blocks(sub_mask[None].astype(np.float32), taps)[0]
    small = _blocks(value * sub_mask, taps) / np.maximum(inside, np.float32(1e-6))
    clipped = np.asarray(_blocks((raw >= capture.saturation).astype(np.float32) * sub_mask, taps) > 0)
    use = (inside > 0.5) & (small.mean(axis=0) > MIN_SIGNAL) & np.isfinite(small).all(axis=0)  # noqa: PLR2004 - half
    used = used_scale(capture, raw) / capture.full_scale if np.isfinite(capture.full_scale) else 1.0
    files = [path.name for path in capture.files] or list(capture.rig.files)
    names = tuple(files[index] if index < len(files) else f"image {index}" for index in range(len(raw)))
    return View(np.nan_to_num(small), use, clipped, lights, float(grid), names, used)


def linear_values(capture: Capture, raw: PixelArray, dark: NDArray[Any] | None) -> Floats:
    """Grey levels as linear light, of full scale, above the dark level."""
    full = np.float32(used_scale(capture, raw))
    table = capture.response
    if table is not None and raw.dtype.kind == "u":
        value = table[raw.astype(np.intp)]
        black = np.interp(capture.black_level, np.arange(len(table)), table)
        offset = np.asarray(black) if dark is None else table[dark.astype(np.intp)]
        full = np.float32(table[-1])
    else:
        value = raw.astype(np.float32)
        offset = np.asarray(capture.black_level) if dark is None else dark.astype(np.float32)
    linear: Floats = ((value - offset.astype(np.float32)) / full).astype(np.float32)
    return linear


def used_scale(capture: Capture, raw: PixelArray) -> float:
    """Full scale of the bits that are used: cameras write 10 to 14 bits into files of 16."""
    if raw.dtype.kind != "u":
        return capture.full_scale if np.isfinite(capture.full_scale) else max(float(np.nanmax(raw)), 1e-9)
    if raw.dtype == np.uint8 or capture.response is not None:
        return capture.full_scale
    bits = min(max(int(raw.max()).bit_length(), FEWEST_BITS), 16)
    return min(capture.full_scale, float((1 << bits) - 1))


def _near_gain(capture: Capture, picked: tuple[slice, slice]) -> Floats:
    """(L, h, w) what undoes the fall-off of near lights over the board, and that they shine on it at other angles.

    Light of a pixel is ``n . d / r^3`` with ``d`` from there to the lamp, which is linear in the place: times ``r^3``
    it is as under a lamp far away, but for a term that lights of one height have in common.
    """
    rig, pitch = capture.rig, float(capture.pixel_pitch_um or 1.0)
    rows, cols = capture.mask.shape
    x = ((np.arange(cols) + 0.5 - cols / 2) * pitch)[picked[1]]
    y = ((rows / 2 - np.arange(rows) - 0.5) * pitch)[picked[0]]
    gain = []
    positions = rig.positions_um
    if positions is None:
        return np.ones((1, 1, 1), dtype=np.float32)
    for light in positions:
        square = (light[0] - x[None, :]) ** 2 + (light[1] - y[:, None]) ** 2 + light[2] ** 2
        gain.append((square / float(light @ light)) ** 1.5)
    return np.array(gain, dtype=np.float32)


def _blocks(stack: Floats, taps: int) -> Floats:
    """(L, h, w) means of blocks of taps x taps."""
    count, rows, cols = stack.shape
    blocks = stack.reshape(count, rows // taps, taps, cols // taps, taps)
    means: Floats = blocks.mean(axis=(2, 4), dtype=np.float32)
    return means


def tile_sums(tiles: NDArray[np.intp], values: NDArray[np.floating], use: NDArray[np.bool_]) -> Array:
    """(T,) sums of an image over its tiles, where it is used."""
    sums = np.bincount(tiles[use], weights=values[use].astype(np.float64), minlength=TILES * TILES)
    return np.asarray(sums, np.float64)
