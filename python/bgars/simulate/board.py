"""The board under the balls: a plane, tilted and bowed, with an albedo that may vary."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from bgars.simulate.checks import fraction, number, positive, require, whole
from bgars.simulate.material import Material

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Board", "Texture"]

MAX_TILT_DEG = 30.0
LATTICE = 64
OCTAVES = ((1.0, 0.7), (0.29, 0.3))
"""Cell size relative to `scale_um` and weight of each layer of clouds."""


@dataclass(frozen=True)
class Texture:
    """Cloudy albedo of a board: smooth random noise, the same at the same place for any pixel pitch.

    Attributes
    ----------
    contrast : float
        Albedo factor lies within ``1 +- contrast``.
    scale_um : float
        Size of the clouds.
    seed : int
        Another seed, another pattern.
    """

    contrast: float = 0.25
    scale_um: float = 500.0
    seed: int = 0

    def __post_init__(self) -> None:
        fraction("board.texture.contrast", self.contrast)
        positive("board.texture.scale_um", self.scale_um)
        whole("board.texture.seed", self.seed, 0)

    @cached_property
    def _lattices(self) -> list[NDArray[np.float64]]:
        random = np.random.default_rng(self.seed)
        return [random.uniform(-1.0, 1.0, (LATTICE, LATTICE)) for _ in OCTAVES]

    def factor(self, x_um: NDArray[np.float64], y_um: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the (R, C) albedo factor on the grid of `x_um` (C,) and `y_um` (R,).

        Value noise: random numbers on a lattice, blended with ``3 t^2 - 2 t^3`` (Perlin 1985).
        """
        clouds = np.zeros((len(y_um), len(x_um)))
        for (size, weight), lattice in zip(OCTAVES, self._lattices, strict=True):
            left, right, blend_x = _cells(x_um / (size * self.scale_um))
            top, bottom, blend_y = _cells(y_um / (size * self.scale_um))
            upper = lattice[top][:, left] * (1.0 - blend_x) + lattice[top][:, right] * blend_x
            lower = lattice[bottom][:, left] * (1.0 - blend_x) + lattice[bottom][:, right] * blend_x
            clouds += weight * (upper * (1.0 - blend_y)[:, None] + lower * blend_y[:, None])
        return 1.0 + self.contrast * clouds


def _cells(place: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.float64]]:
    cell = np.floor(place)
    part = place - cell
    first = cell.astype(np.intp) % LATTICE
    return first, (first + 1) % LATTICE, part * part * (3.0 - 2.0 * part)


@dataclass(frozen=True, eq=False)
class Board:
    """The board: ``z = x tan(tilt_x) + y tan(tilt_y) + bow (1 - (x^2 + y^2) / bow_radius^2)``.

    Attributes
    ----------
    material : Material
        Matte by default; its variation is not used.
    tilt_x_deg, tilt_y_deg : float
        Positive: the board rises toward +x, +y.
    bow_um : float
        Height of the centre above the circle of `bow_radius_um`; negative: a bowl.
    bow_radius_um : float
        Radius of that circle.
    texture : Texture or None
        Cloudy albedo.
    albedo_map : (H, W) array or None
        Albedo factor of each camera pixel instead, for a measured board.

    Raises
    ------
    InputError
        Tilt beyond 30 degrees, a bow without a radius, a texture together with a map, a negative map.

    Examples
    --------
    >>> import numpy as np
    >>> board = Board(tilt_x_deg=1.0, bow_um=20.0, bow_radius_um=2000.0)
    >>> board.height_um(np.array([0.0, 2000.0]), np.zeros(2)).round(2).tolist()
    [20.0, 34.91]
    """

    material: Material = field(default_factory=lambda: Material.matte(0.12))
    tilt_x_deg: float = 0.0
    tilt_y_deg: float = 0.0
    bow_um: float = 0.0
    bow_radius_um: float = 10_000.0
    texture: Texture | None = None
    albedo_map: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        for name in ("tilt_x_deg", "tilt_y_deg"):
            value = getattr(self, name)
            number(f"board.{name}", value)
            require(abs(value) <= MAX_TILT_DEG, f"board.{name}", f"must lie within +-{MAX_TILT_DEG:g}", value)
        number("board.bow_um", self.bow_um)
        positive("board.bow_radius_um", self.bow_radius_um)
        if self.albedo_map is not None:
            require(self.texture is None, "board.albedo_map", "must not be given together with texture", "both")
            values = np.ascontiguousarray(self.albedo_map, dtype=np.float64)
            require(values.ndim == 2, "board.albedo_map", "must have shape (H, W)", values.shape)  # noqa: PLR2004 - rows, columns
            require(bool((values >= 0).all()), "board.albedo_map", "must be 0 or more everywhere", float(values.min()))
            object.__setattr__(self, "albedo_map", values)

    @property
    def slopes(self) -> tuple[float, float]:
        """Slope along x and y at the origin."""
        return math.tan(math.radians(self.tilt_x_deg)), math.tan(math.radians(self.tilt_y_deg))

    def height_um(self, x_um: NDArray[np.float64], y_um: NDArray[np.float64]) -> NDArray[np.float64]:
        """Height at x, y; arrays that broadcast."""
        slope_x, slope_y = self.slopes
        bow = self.bow_um * (1.0 - (x_um * x_um + y_um * y_um) / self.bow_radius_um**2)
        return np.asarray(slope_x * x_um + slope_y * y_um + bow, dtype=np.float64)

    def normal(
        self, x_um: NDArray[np.float64], y_um: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Unit normal at x, y; arrays that broadcast."""
        slope_x, slope_y = self.slopes
        bend = -2.0 * self.bow_um / self.bow_radius_um**2
        along_x, along_y = slope_x + bend * x_um, slope_y + bend * y_um
        length = np.sqrt(along_x * along_x + along_y * along_y + 1.0)
        return (0.0 - along_x) / length, (0.0 - along_y) / length, 1.0 / length
