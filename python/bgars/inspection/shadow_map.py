"""Which board pixels no ball hides, and how many balls shadow them under each light."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bgars import _bgars

if TYPE_CHECKING:
    from bgars.inspection.board import Board
    from bgars.inspection.radiance import Radiance

__all__ = ["Casters", "ShadowMap"]

Array = NDArray[np.float64]
Index = NDArray[np.intp]
FULL_DETAIL_RADIUS_PX = 20.0
"""Balls of this radius are drawn pixel by pixel, larger ones on a coarser grid: the maps have margins anyway."""


@dataclass(frozen=True, eq=False)
class Casters:
    """What throws shadows, as the kernels read it, in pixels.

    Attributes
    ----------
    balls : (N, 5) float64
        x, y, z, radius, q.
    lights : (L, 3) float64
        Directions, or positions where `near`.
    near : bool
    board : list of float
        Coefficients c1 to c5 of :class:`bgars.inspection.board.Board`.
    """

    balls: Array
    lights: Array
    near: bool
    board: list[float]

    @classmethod
    def of(cls, table: Array, vectors: Array, near: bool, board: Board) -> Casters:
        """Make them contiguous."""
        return cls(np.ascontiguousarray(table), np.ascontiguousarray(vectors), near, board.coefficients.tolist())


class ShadowMap:
    """Predicted silhouettes and shadows, widened by margins.

    Parameters
    ----------
    radiance : Radiance
        For the image's size.
    casters : Casters
        All that cast a shadow.
    silhouette_margin_px, shadow_margin_px : float
        How much wider than predicted both are drawn.
    threads : int
        Lights drawn at once.

    Attributes
    ----------
    step : int
        Pixels a cell, in each direction.
    hidden : (rows, cols) bool
    count : (L, rows, cols) uint8
    """

    def __init__(
        self,
        radiance: Radiance,
        casters: Casters,
        *,
        silhouette_margin_px: float,
        shadow_margin_px: float,
        threads: int,
    ) -> None:
        self.step = max(1, int(float(np.median(casters.balls[:, 3])) / FULL_DETAIL_RADIUS_PX))
        self.hidden, self.count = _bgars.draw_shadows(
            casters,
            shape=(radiance.height, radiance.width),
            step=self.step,
            silhouette_margin_px=silhouette_margin_px,
            shadow_margin_px=shadow_margin_px,
            threads=threads,
        )

    def pixels(self, row: Index, col: Index) -> Index:
        """Flat index into a map of image pixels."""
        cols = self.hidden.shape[1]
        if self.step == 1:
            index: Index = row * cols + col
        else:
            index = (row // self.step) * cols + col // self.step
        return index
