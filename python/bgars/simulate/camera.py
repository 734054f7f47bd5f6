"""The camera: how much of the scene it sees, and how light becomes grey levels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from bgars.simulate.checks import at_least, one_of, positive, require, whole

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Camera"]

BIT_DEPTHS = (8, 10, 12, 16)
MAX_SUPERSAMPLE = 32
MAX_BLUR_PX = 10.0
MAX_MEGAPIXELS = 256.0
MAX_ELECTRONS = 1e15
BLUR_REACH = 4.0
"""The Gaussian blur is cut off at this many sigma."""


@dataclass(frozen=True)
class Camera:
    """An orthographic camera that looks along -z at the origin.

    Grey levels are those of the image files: 0 to 255 for 8 bits, 0 to 65535 for 10, 12 and 16 bits (10- and 12-bit
    codes are spread over the 16-bit range, as most cameras write them).

    Attributes
    ----------
    pixel_pitch_um : float
        Size of a pixel on the board.
    shape : (int, int) or None
        Rows and columns; by default what the scene needs.
    bit_depth : {8, 10, 12, 16}
        Bits of a pixel.
    gain : float
        Exposure: factor of the signal.
    full_well_e : float or None
        Electrons at full scale: shot noise. None = no shot noise.
    read_noise_levels : float
        Standard deviation of the read noise in linear grey levels (electrons * full scale / `full_well_e`).
    black_level : float
        Grey level of no light.
    gamma : float
        Response ``signal^(1/gamma)``; 1 = linear.
    response_table : sequence of (float, float) or None
        A measured response instead: grey level and radiance (any unit), both increasing, from 0 to full scale.
    saturation : float or None
        Grey level at which the sensor clips; full scale by default.
    supersample : int
        Samples per pixel along each axis (a box filter); 1 = the pixel's centre.
    blur_px : float
        Standard deviation of a Gaussian blur by the lens.

    Raises
    ------
    InputError
        A value out of range.

    Examples
    --------
    >>> Camera(bit_depth=12).full_scale
    65535.0
    """

    pixel_pitch_um: float = 10.0
    shape: tuple[int, int] | None = None
    bit_depth: Literal[8, 10, 12, 16] = 8
    gain: float = 1.0
    full_well_e: float | None = None
    read_noise_levels: float = 0.0
    black_level: float = 0.0
    gamma: float = 1.0
    response_table: tuple[tuple[float, float], ...] | None = None
    saturation: float | None = None
    supersample: int = 1
    blur_px: float = 0.0

    def __post_init__(self) -> None:
        positive("camera.pixel_pitch_um", self.pixel_pitch_um)
        if self.shape is not None:
            pair = isinstance(self.shape, Sequence) and len(self.shape) == 2  # noqa: PLR2004
            require(pair, "camera.shape", "must be two whole numbers (rows, columns)", self.shape)
            for count in self.shape:
                whole("camera.shape", count, 1)
            object.__setattr__(self, "shape", tuple(self.shape))
        one_of("camera.bit_depth", self.bit_depth, BIT_DEPTHS)
        positive("camera.gain", self.gain)
        if self.full_well_e is not None:
            at_least("camera.full_well_e", self.full_well_e, 10.0)
            rule = f"times the gain of {self.gain:g}, must be {MAX_ELECTRONS:g} or less"
            require(self.full_well_e * self.gain <= MAX_ELECTRONS, "camera.full_well_e", rule, self.full_well_e)
        at_least("camera.read_noise_levels", self.read_noise_levels, 0.0)
        positive("camera.gamma", self.gamma)
        self._check_levels()
        whole("camera.supersample", self.supersample, 1, MAX_SUPERSAMPLE)
        at_least("camera.blur_px", self.blur_px, 0.0)
        require(self.blur_px <= MAX_BLUR_PX, "camera.blur_px", f"must be {MAX_BLUR_PX:g} or less", self.blur_px)

    def _check_levels(self) -> None:
        full = self.full_scale
        if self.response_table is not None:
            require(self.gamma == 1.0, "camera.gamma", "must not be given together with response_table", self.gamma)
            rows = tuple((float(level), float(radiance)) for level, radiance in self.response_table)
            object.__setattr__(self, "response_table", rows)
            table = np.array(rows).reshape(-1, 2)
            grows = len(table) > 1 and bool(np.isfinite(table).all() and (np.diff(table, axis=0) > 0).all())
            require(grows, "camera.response_table", "must be two or more finite rows that grow", f"{len(table)} rows")
            covers = bool(table[0, 0] == 0 and table[-1, 0] == full)
            span = f"{table[0, 0]:g} to {table[-1, 0]:g}"
            require(covers, "camera.response_table", f"must cover grey levels 0 to {full:g}", span)
        if self.saturation is not None:
            positive("camera.saturation", self.saturation)
            require(self.saturation <= full, "camera.saturation", f"must be {full:g} or less", self.saturation)
        at_least("camera.black_level", self.black_level, 0.0)
        top = full if self.saturation is None else self.saturation
        require(self.black_level < top, "camera.black_level", f"must be below saturation ({top:g})", self.black_level)

    @property
    def full_scale(self) -> float:
        """Largest grey level of the image files."""
        return 255.0 if self.bit_depth == 8 else 65535.0  # noqa: PLR2004 - one byte a pixel

    @property
    def halo_px(self) -> int:
        """Pixels around an image that its blur reaches."""
        return math.ceil(BLUR_REACH * self.blur_px)

    def framed(self, size_um: tuple[float, float]) -> tuple[int, int]:
        """Rows and columns: the camera's own, or what shows `size_um` (width, height).

        Raises
        ------
        InputError
            More than 256 megapixels.
        """
        cols, rows = (max(math.ceil(length / self.pixel_pitch_um - 1e-9), 1) for length in size_um)
        rows, cols = self.shape or (rows, cols)
        megapixels = rows * cols / 1e6
        require(
            megapixels <= MAX_MEGAPIXELS, "camera.shape", f"must be {MAX_MEGAPIXELS:g} megapixels or less", megapixels
        )
        return rows, cols

    def centres_um(self, count: int, *, down: bool) -> NDArray[np.float64]:
        """Coordinates of `count` pixel centres: x to the right, or y down from the top."""
        place = (np.arange(count, dtype=np.float64) + 0.5 - count / 2) * self.pixel_pitch_um
        return -place if down else place
