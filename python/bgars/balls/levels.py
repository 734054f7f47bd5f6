"""Linear grey levels of a capture, computed only where they are needed: no float copy of the whole stack."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from bgars.records.capture import Capture
    from bgars.records.pixels import FloatArray

__all__ = ["Levels", "block_means"]

MAX_THREADS = 8


class Levels:
    """Linear grey levels of 255 of a capture, the offset taken off, divided by the lights' intensities.

    Parameters
    ----------
    capture : Capture
        Images and what is known of the camera.
    threads : int or None
        Largest number of threads.
    """

    def __init__(self, capture: Capture, threads: int | None) -> None:
        self.capture = capture
        self.threads = min(threads or os.cpu_count() or 1, MAX_THREADS)
        self.lights, self.height, self.width = capture.images.shape
        gains = 255.0 / capture.full_scale / capture.rig.intensities
        self.gains: FloatArray = (gains * len(gains) / np.sum(1.0 / capture.rig.intensities)).astype(np.float32)
        self.black = capture.black_level
        if capture.response is not None:
            codes = np.arange(len(capture.response))
            self.black = float(np.interp(capture.black_level, codes, capture.response))

    def map_lights(self, work: Callable[[int], object]) -> None:
        """Call `work` once a light, on the threads."""
        if self.threads == 1:
            for light in range(self.lights):
                work(light)
            return
        with ThreadPoolExecutor(self.threads) as pool:
            list(pool.map(work, range(self.lights)))

    def at(self, pixels: NDArray[np.intp]) -> FloatArray:
        """(L, ...) levels of the pixels with these flat indices."""
        images = self.capture.images.reshape(self.lights, -1)
        offset = self._offset(pixels)
        levels = np.zeros((self.lights, *pixels.shape), np.float32)

        def one(light: int) -> None:
            levels[light] = (self._linear(images[light].take(pixels)) - offset) * self.gains[light]

        self.map_lights(one)
        return levels

    def of_lights(self, pixels: NDArray[np.intp]) -> FloatArray:
        """(L, ...) levels of pixels of their own for each light, flat indices (L, ...)."""
        images = self.capture.images.reshape(self.lights, -1)
        levels = np.zeros(pixels.shape, np.float32)

        def one(light: int) -> None:
            linear = self._linear(images[light].take(pixels[light]))
            levels[light] = (linear - self._offset(pixels[light])) * self.gains[light]

        self.map_lights(one)
        return levels

    def clipped_at(self, pixels: NDArray[np.intp]) -> NDArray[np.bool_]:
        """(L, ...) True where the pixels with these flat indices are saturated."""
        images = self.capture.images.reshape(self.lights, -1)
        clipped = np.zeros((self.lights, *pixels.shape), np.bool_)
        if np.isfinite(self.capture.saturation):

            def one(light: int) -> None:
                clipped[light] = images[light].take(pixels) >= self.capture.saturation

            self.map_lights(one)
        return clipped

    def reduced(self, factor: int) -> FloatArray:
        """(L, H // factor, W // factor) levels averaged over blocks (codes are averaged before the response)."""
        dark = self.capture.dark
        offset: FloatArray | np.float32 = np.float32(self.black)
        if dark is not None:
            offset = self._linear_mean(block_means(dark, factor))
        levels = np.zeros((self.lights, self.height // factor, self.width // factor), np.float32)

        def one(light: int) -> None:
            mean = self._linear_mean(block_means(self.capture.images[light], factor))
            levels[light] = (mean - offset) * self.gains[light]

        self.map_lights(one)
        return levels

    def _linear(self, codes: NDArray[Any]) -> FloatArray:
        response = self.capture.response
        return codes.astype(np.float32) if response is None else response.take(codes.astype(np.intp))

    def _linear_mean(self, codes: FloatArray) -> FloatArray:
        response = self.capture.response
        return codes if response is None else np.interp(codes, np.arange(len(response)), response).astype(np.float32)

    def _offset(self, pixels: NDArray[np.intp]) -> FloatArray | np.float32:
        dark = self.capture.dark
        return np.float32(self.black) if dark is None else self._linear(dark.reshape(-1).take(pixels))


def block_means(image: NDArray[Any], factor: int) -> FloatArray:
    """Means over blocks of factor x factor pixels, what is left over dropped; (H // factor, W // factor).

    Rows first, because they lie together in memory.
    """
    if factor == 1:
        return image.astype(np.float32)
    height, width = image.shape[0] // factor * factor, image.shape[1] // factor * factor
    wide: type[Any] = np.float32 if image.dtype.kind == "f" else np.uint32
    total: NDArray[Any] = image[:height:factor, :width].astype(wide)
    for row in range(1, factor):
        total += image[row:height:factor, :width]
    mean: FloatArray = total[:, ::factor].astype(np.float32)
    for col in range(1, factor):
        mean += total[:, col::factor]
    mean *= np.float32(1.0 / factor**2)
    return mean
