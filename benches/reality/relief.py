"""Relief of the board: openings of the solder mask, traces and vias under it, a second layer of mask."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np
from scipy.interpolate import RectBivariateSpline

if TYPE_CHECKING:
    from balls import Ball
    from numpy.typing import NDArray
    from setup_records import Setup

RASTER_MM = 0.005
FRACTION_BITS = 4
"""Sub-pixel bits of the coordinates that OpenCV draws at."""


class Relief:
    """Height of the relief at any place: a raster with blurred edges, then a bicubic spline, which is the truth."""

    def __init__(self, setup: Setup, balls: list[Ball]) -> None:
        sizes = setup.board.relief
        if sizes is None:
            msg = "the board of this setup has no relief"
            raise ValueError(msg)
        half_mm = np.array((setup.view.width, setup.view.height)) * setup.view.pixel_mm / 2
        self.edge_mm = 1.5 * float(max(half_mm)) * 1.00237
        count = int(np.ceil(2 * self.edge_mm / RASTER_MM)) | 1
        grid = np.linspace(-self.edge_mm, self.edge_mm, count)
        self.step_mm = float(grid[1] - grid[0])
        traces, steps, openings = (
            cv2.GaussianBlur(mask.astype(np.float64) / 255, (0, 0), sizes.edge_mm / self.step_mm)
            for mask in self._masks(setup, balls, count)
        )
        height = (1 - openings) * (sizes.trace_mm * traces + sizes.step_mm * steps) - openings * sizes.opening_mm
        self.spline = RectBivariateSpline(grid, grid, height.T, kx=3, ky=3)

    def __call__(self, x_mm: NDArray[np.float64], y_mm: NDArray[np.float64]) -> NDArray[np.float64]:
        """Height (mm) at places of any one shape; beyond the raster that of its edge."""
        x, y = (np.clip(np.ravel(axis), -self.edge_mm, self.edge_mm) for axis in (x_mm, y_mm))
        return np.asarray(self.spline.ev(x, y)).reshape(np.shape(x_mm))

    def _masks(self, setup: Setup, balls: list[Ball], count: int) -> tuple[NDArray[np.uint8], ...]:
        """Images (count, count) of traces, second layer and openings; rows grow with y."""
        sizes, part = setup.board.relief, setup.part
        assert sizes is not None
        random = np.random.default_rng([setup.seed, 31])
        traces, steps, openings = (np.zeros((count, count), np.uint8) for _ in range(3))
        turn, pitch = np.deg2rad(part.rotation_deg), part.pitch_mm
        along, across = np.array([np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), np.cos(turn)])
        for ball in balls:  # Dog bones: pad, neck at 45 degrees, via, and perhaps a trace from there.
            pad = np.array([ball.x_nominal_mm, ball.y_nominal_mm])
            if random.random() < 0.75:
                one, other = random.choice([-1, 1], 2)
                via = pad + pitch / 2 * (one * along + other * across)
                self._line(traces, pad, via, sizes.trace_width_mm)
                self._disc(traces, via, 1.3 * sizes.trace_width_mm)
                if random.random() < 0.6:
                    way = random.choice([-1, 1]) * pitch * random.uniform(1, 4)
                    end = via + way * (along if random.random() < 0.5 else across)
                    self._line(traces, via, end, sizes.trace_width_mm)
            self._disc(openings, pad, sizes.pad_radius_mm)
        centre = np.array(part.centre_mm)
        for _ in range(4):
            first, second = random.uniform(-2.6, 2.6), random.uniform(-2.6, 2.6)
            corner = centre + first * pitch * along + second * pitch * across
            width, height = random.uniform(0.5, 2.0, 2) * pitch
            corners = [corner, corner + width * along, corner + width * along + height * across]
            corners.append(corner + height * across)
            outline = np.array([self._place(point) for point in corners], np.int32)
            cv2.fillConvexPoly(steps, outline, 255, cv2.LINE_AA, FRACTION_BITS)
        return traces, steps, openings

    def _place(self, point_mm: NDArray[np.float64]) -> tuple[int, int]:
        column, row = (round(float((value + self.edge_mm) / self.step_mm * 2**FRACTION_BITS)) for value in point_mm)
        return column, row

    def _line(
        self, mask: NDArray[np.uint8], start: NDArray[np.float64], end: NDArray[np.float64], width_mm: float
    ) -> None:
        width = max(1, round(width_mm / self.step_mm))
        cv2.line(mask, self._place(start), self._place(end), 255, width, cv2.LINE_AA, FRACTION_BITS)

    def _disc(self, mask: NDArray[np.uint8], middle: NDArray[np.float64], radius_mm: float) -> None:
        radius = round(radius_mm / self.step_mm * 2**FRACTION_BITS)
        cv2.circle(mask, self._place(middle), radius, 255, -1, cv2.LINE_AA, FRACTION_BITS)
