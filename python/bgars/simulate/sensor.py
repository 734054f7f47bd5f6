"""From light to grey levels: noise, black level, response, clipping, quantisation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bgars.simulate.camera import Camera
    from bgars.simulate.solids import Array

__all__ = ["Sensor", "stream_key"]

EIGHT_BITS = 8
LIGHT_SHIFT = 32
"""Noise streams are keyed by light and row, so that no tiling and no thread order changes a bit."""


def stream_key(seed: int, number: int) -> NDArray[np.uint64]:
    """Key of a counter-based random stream (Salmon et al. 2011); whole numbers, so no two of them round alike."""
    return np.array([seed, number], dtype=np.uint64)


@dataclass(frozen=True)
class Sensor:
    """A camera and the seed of its noise."""

    camera: Camera
    seed: int

    @property
    def saturation_level(self) -> float:
        """Grey level of clipped pixels in the files."""
        camera = self.camera
        level = camera.full_scale if camera.saturation is None else camera.saturation
        return float(self._quantised(np.array(level)))

    def linear_levels(self) -> NDArray[np.float32] | None:
        """Linear grey level of every code, (256,) or (65536,); None for a linear camera."""
        camera = self.camera
        if camera.gamma == 1.0 and camera.response_table is None:
            return None
        codes = np.arange(camera.full_scale + 1.0)
        return (self._signal_of(codes) * camera.full_scale).astype(np.float32)

    def expose(self, signal: Array, light: int, first_row: int) -> NDArray[np.uint8] | NDArray[np.uint16]:
        """Return the grey levels of (R, C) signals, fractions of full scale, in image rows from `first_row`."""
        camera = self.camera
        exposed = signal * camera.gain
        if camera.full_well_e is not None or camera.read_noise_levels > 0:
            exposed = np.stack([self._noisy(row, light, first_row + index) for index, row in enumerate(exposed)])
        exposed = np.clip(exposed + float(self._signal_of(np.array(camera.black_level))), 0.0, 1.0)
        level = self._level_of(exposed)
        if camera.saturation is not None:
            level = np.minimum(level, camera.saturation)
        codes = self._quantised(level)
        return codes.astype(np.uint8) if camera.bit_depth == EIGHT_BITS else codes.astype(np.uint16)

    def _noisy(self, row: Array, light: int, number: int) -> Array:
        """Shot noise (Poisson in electrons) and read noise (normal), drawn from the row's own stream."""
        camera = self.camera
        random = np.random.Generator(np.random.Philox(key=stream_key(self.seed, (light << LIGHT_SHIFT) | number)))
        if camera.full_well_e is not None:
            row = random.poisson(row * camera.full_well_e).astype(np.float64) / camera.full_well_e
        if camera.read_noise_levels > 0:
            row = row + random.standard_normal(len(row)) * (camera.read_noise_levels / camera.full_scale)
        return row

    def _level_of(self, signal: Array) -> Array:
        """Response: linear signal in [0, 1] to grey level."""
        camera = self.camera
        if camera.response_table is not None:
            levels, radiances = self._table()
            return np.asarray(np.interp(radiances[0] + signal * (radiances[-1] - radiances[0]), radiances, levels))
        encoded = signal if camera.gamma == 1.0 else np.power(signal, 1.0 / camera.gamma)
        return np.asarray(encoded * camera.full_scale)

    def _signal_of(self, level: Array) -> Array:
        """Inverse response: grey level to linear signal in [0, 1]."""
        camera = self.camera
        if camera.response_table is not None:
            levels, radiances = self._table()
            return np.asarray((np.interp(level, levels, radiances) - radiances[0]) / (radiances[-1] - radiances[0]))
        linear = level / camera.full_scale
        return linear if camera.gamma == 1.0 else np.asarray(linear**camera.gamma)

    def _table(self) -> tuple[Array, Array]:
        table: Array = np.array(self.camera.response_table, dtype=np.float64)
        return table[:, 0], table[:, 1]

    def _quantised(self, level: Array) -> Array:
        """Nearest code; codes of 10 and 12 bits are spread over the 16-bit range."""
        full = self.camera.full_scale
        codes = 2.0**self.camera.bit_depth - 1.0
        if codes == full:
            return np.rint(level)
        return np.rint(np.rint(level * (codes / full)) * (full / codes))
