"""Values proportional to light at chosen pixels, never as a float copy of the stack."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from bgars.records.capture import Capture

__all__ = ["Radiance"]

Array = NDArray[np.float64]
Index = NDArray[np.intp]


class Radiance:
    """Reads linear grey levels of a capture, pixel by pixel: (response(code) - response(dark)), clipped pixels NaN.

    Parameters
    ----------
    capture : Capture
        Its response, dark frame, black level, saturation and mask are honoured; intensities are not divided out here.

    Attributes
    ----------
    mask : (H, W) bool or None
        Pixels to use; None for all.
    """

    def __init__(self, capture: Capture) -> None:
        self.capture = capture
        self.lights, self.height, self.width = capture.images.shape
        self._stack = capture.images.reshape(self.lights, -1)
        self._dark = None if capture.dark is None else capture.dark.reshape(-1)
        table = capture.response
        black = capture.black_level
        self._black = black if table is None else float(np.interp(black, np.arange(len(table)), table))
        self.masked = not (capture.mask.strides == (0, 0) and bool(capture.mask[:1, :1].all()))
        self.mask = np.ascontiguousarray(capture.mask) if self.masked else None
        self._mask = None if self.mask is None else self.mask.reshape(-1)

    @property
    def scale(self) -> float:
        """Grey levels of this capture per grey level of 255."""
        return self.capture.full_scale / 255.0

    def at(self, pixels: Index) -> NDArray[np.float32]:
        """(L, ...) linear grey levels under every light at flat pixel indices (...); NaN where clipped or masked."""
        return self._linear(np.take(self._stack, pixels, axis=1), pixels)

    def under(self, lights: Index, pixels: Index) -> NDArray[np.float32]:
        """Linear grey levels of pixels, each under its own light."""
        return self._linear(self._stack[lights, pixels], pixels)

    def _linear(self, codes: NDArray[np.generic], pixels: Index) -> NDArray[np.float32]:
        capture = self.capture
        values = codes.astype(np.float32) if capture.response is None else capture.response[codes.astype(np.intp)]
        if self._dark is None:
            values -= np.float32(self._black)
        else:
            dark = self._dark[pixels]
            values -= dark if capture.response is None else capture.response[dark.astype(np.intp)]
        if np.isfinite(capture.saturation):
            values[codes >= capture.saturation] = np.nan  # type: ignore[operator]
        if self._mask is not None:
            values[..., ~self._mask[pixels]] = np.nan
        return values

    def x(self, col: NDArray[np.generic]) -> Array:
        """World x in pixels of a column."""
        x: Array = col + (0.5 - self.width / 2.0)
        return x

    def y(self, row: NDArray[np.generic]) -> Array:
        """World y in pixels of a row."""
        y: Array = (self.height / 2.0 - 0.5) - row
        return y

    def col(self, x: Array) -> Array:
        """Column, with fraction, of a world x in pixels."""
        col: Array = x + (self.width / 2.0 - 0.5)
        return col

    def row(self, y: Array) -> Array:
        """Row, with fraction, of a world y in pixels."""
        row: Array = (self.height / 2.0 - 0.5) - y
        return row
