"""Which board pixels no ball hides, and how many balls shadow them under each light."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bgars.inspection.shadow_model import Balls, Lights, edge_at, rays

if TYPE_CHECKING:
    from bgars.inspection.board import Board
    from bgars.inspection.radiance import Radiance

__all__ = ["ShadowMap"]

Array = NDArray[np.float64]
Index = NDArray[np.intp]
OUTLINE = np.linspace(-np.pi, np.pi, 25)
FULL_DETAIL_RADIUS_PX = 20.0
"""Balls of this radius are drawn pixel by pixel, larger ones on a coarser grid: the maps have margins anyway."""


class ShadowMap:
    """Predicted silhouettes and shadows, widened by margins.

    Parameters
    ----------
    radiance : Radiance
        For the image's size.
    balls : (N, 5) float64
        Balls (all that cast a shadow), in pixels.
    lights : (L, 3) float64
        Directions, or positions in pixels.
    near : bool
        Which.
    board : Board
    silhouette_margin_px, shadow_margin_px : float
        How much wider than predicted both are drawn.
    threads : int
        Lights drawn at once.
    """

    def __init__(
        self,
        radiance: Radiance,
        balls: NDArray[np.float64],
        lights: NDArray[np.float64],
        near: bool,
        board: Board,
        *,
        silhouette_margin_px: float,
        shadow_margin_px: float,
        threads: int,
    ) -> None:
        self.step = max(1, int(float(np.median(balls[:, 3])) / FULL_DETAIL_RADIUS_PX))
        self.rows, self.cols = -(-radiance.height // self.step), -(-radiance.width // self.step)
        self._x = radiance.x(np.arange(self.cols) * self.step + (self.step - 1) / 2.0)
        self._y = radiance.y(np.arange(self.rows) * self.step + (self.step - 1) / 2.0)
        self.hidden = np.zeros((self.rows, self.cols), dtype=np.bool_)
        self.count = np.zeros((len(lights), self.rows, self.cols), dtype=np.uint8)
        for x, y, _, radius, _ in balls:
            reach = radius + silhouette_margin_px
            window = self._window(x - reach, x + reach, y - reach, y + reach)
            self.hidden[window] |= (
                np.square(self._x[window[1]] - x)[None, :] + np.square(self._y[window[0]] - y)[:, None] < reach * reach
            )
        with ThreadPoolExecutor(threads) as pool:
            jobs = [
                pool.submit(self._draw, light, Balls.from_table(balls), lights[light], near, board, shadow_margin_px)
                for light in range(len(lights))
            ]
            for job in jobs:
                job.result()

    def pixels(self, row: Index, col: Index) -> Index:
        """Flat index into a map of image pixels."""
        if self.step == 1:
            index: Index = row * self.cols + col
        else:
            index = (row // self.step) * self.cols + col // self.step
        return index

    def _window(self, x0: float, x1: float, y0: float, y1: float) -> tuple[slice, slice]:
        """Rows and columns of the map between two corners; slices may be empty."""
        first_col, last_col = np.searchsorted(self._x, [x0, x1])
        first_row, last_row = np.searchsorted(-self._y, [-y1, -y0])
        return slice(int(first_row), int(last_row)), slice(int(first_col), int(last_col))

    def _draw(
        self, light: int, balls: Balls, vector: NDArray[np.float64], near: bool, board: Board, margin_px: float
    ) -> None:
        """Count the shadows of all balls under one light."""
        lamp = Lights.from_table(vector[None], near).spread(0, 1)
        edges = edge_at(OUTLINE[None, :], balls.spread(1), lamp, board)
        for index in range(len(balls.x)):
            own = balls.take(np.array([index])).spread(1)
            margin = margin_px + 2.0
            window = self._window(
                float(min(edges.x[index].min(), own.x[0, 0]) - margin),
                float(max(edges.x[index].max(), own.x[0, 0]) + margin),
                float(min(edges.y[index].min(), own.y[0, 0]) - margin),
                float(max(edges.y[index].max(), own.y[0, 0]) + margin),
            )
            x, y = self._x[window[1]][None, :], self._y[window[0]][:, None]
            if x.size and y.size:
                self.count[light][window] += _shadowed(x, y, own, lamp, board, margin_px)


def _shadowed(x: Array, y: Array, ball: Balls, lamp: Lights, board: Board, margin_px: float) -> NDArray[np.bool_]:
    """Board points of a grid whose rays pass a ball closer than its radius and a margin."""
    if lamp.near:
        beam = rays(x, y, ball, lamp, board)
        return (beam.distance < ball.radius + margin_px) & (beam.along > 0.0)
    # The board as its tangent plane under the ball: a map has margins. Everything is linear in x or in y.
    slope_x, slope_y = (part / ball.q for part in board.slopes(ball.x, ball.y))
    to_z = lamp.z / ball.q
    length = np.sqrt(lamp.x**2 + lamp.y**2 + to_z**2)
    to_x, to_y, to_z = lamp.x / length, lamp.y / length, to_z / length
    across_x, across_y, down = x - ball.x, y - ball.y, ball.z / ball.q
    along = (across_x * (to_x + slope_x * to_z) - down * to_z) + across_y * (to_y + slope_y * to_z)
    square = np.square(across_x) + np.square(across_y) + np.square((slope_x * across_x - down) + slope_y * across_y)
    square -= along * along
    return (square < np.square(ball.radius + margin_px)) & (along < 0.0)
