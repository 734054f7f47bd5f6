"""What a renderer hands to the camera."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from balls import BallTruth
    from numpy.typing import NDArray


@dataclass(frozen=True)
class Rendered:
    """A part before it meets the camera.

    Attributes
    ----------
    radiance : (lamps, rows, columns) float32
        For an irradiance of 1 from each lamp, square to its direction.
    normals, z_mm, ball : (rows, columns, 3) float32, (rows, columns) float32, (rows, columns) int16
        What the middle of each pixel sees; `ball` is its number, 0 for the board.
    mixed : (rows, columns) bool
        Pixels on or beside an outline.
    nominal, true : (lamps, 3)
        Directions of the middles of the lamps.
    balls : list of BallTruth
        All of them.
    """

    radiance: NDArray[np.float32]
    normals: NDArray[np.float32]
    z_mm: NDArray[np.float32]
    ball: NDArray[np.int16]
    mixed: NDArray[np.bool_]
    nominal: NDArray[np.float64]
    true: NDArray[np.float64]
    balls: list[BallTruth]
