"""From an inspected part to known heights: ball tops from their shadows, and the board's plane."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from bgars.errors import InputError
from bgars.records.anchors import Anchors
from bgars.records.circle_pixels import inside_circles

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from bgars.records.part_result import PartResult

__all__ = ["anchors_from_part"]

CAP_FROM, CAP_TO = 0.4, 0.8
"""Part of a ball's radius that anchors it: outside a usual flat on its top, inside the steep rim."""
BOARD_MARGIN = 1.1
"""The board anchors itself from this times the radius of a ball on."""
BOARD_REACH = 0.25
"""The board bends over this times the median radius: well below a shadow, over which its normals err alike."""
RIM_PX = 0.5
"""A pixel that the rim passes through shows ball and board; it is left to the board."""


def anchors_from_part(result: PartResult, shape: tuple[int, int]) -> Anchors:
    """Known heights over an inspected part, for :func:`bgars.integrate_normals`.

    The board (region 0) is bent to its measured shape, details from its normals, and every ball (regions 1, 2, ... in
    the order of the result) to the spheroid that its shadows gave, over a ring around its top. Heights are above the
    board at the centre of the image. Balls that were not measured are cut out; their height is arbitrary.

    Parameters
    ----------
    result : PartResult
        From :func:`bgars.inspect`.
    shape : (H, W)
        Of the capture's images.

    Raises
    ------
    InputError
        No ball has a measured height.

    Notes
    -----
    A pixel's height then rests on the shadows, its shape on the normals. An error of a ball's shadow fit moves the
    whole ball: see its ``u_top_um``.
    """
    height, width = shape
    pitch = result.pixel_pitch_um
    x_um = ((np.arange(width) + 0.5 - width / 2) * pitch)[None, :]
    y_um = ((height / 2 - np.arange(height) - 0.5) * pitch)[:, None]
    c = np.nan_to_num(result.board_coefficients_um)

    def board_um(x: ArrayLike, y: ArrayLike) -> NDArray[np.float64]:
        x, y = np.asarray(x), np.asarray(y)
        return np.asarray(c[0] + c[1] * x + c[2] * y + c[3] * x**2 + c[4] * x * y + c[5] * y**2)

    regions = np.zeros(shape, np.int32)
    height_um = np.broadcast_to(board_um(x_um, y_um), shape).astype(np.float32)
    seen = [ball for ball in result.balls if ball.present and math.isfinite(ball.diameter_um)]
    if not any(math.isfinite(ball.top_um) for ball in seen):
        msg = "result: no ball has a measured height to anchor on"
        raise InputError(msg)
    circles = [(ball.x_um / pitch, ball.y_um / pitch, ball.diameter_um / 2 / pitch) for ball in seen]
    height_um[inside_circles([(x, y, BOARD_MARGIN * radius) for x, y, radius in circles], shape)] = np.nan
    for number, (ball, circle) in enumerate(zip(seen, circles, strict=True), start=1):
        x_px, y_px, radius_px = circle
        # A window around the ball: whole images for each of a thousand balls would take minutes.
        rows, cols = _window(height / 2 - y_px, radius_px, height), _window(width / 2 + x_px, radius_px, width)
        radius_um = ball.diameter_um / 2
        off = ((x_um[:, cols] - ball.x_um) ** 2 + (y_um[rows] - ball.y_um) ** 2) / radius_um**2
        regions[rows, cols][off < (max(radius_px - RIM_PX, 0.0) / radius_px) ** 2] = number
        cap = (off >= CAP_FROM**2) & (off <= CAP_TO**2)
        if math.isfinite(ball.top_um) and math.isfinite(ball.centre_z_um):
            q = ball.aspect_ratio if math.isfinite(ball.aspect_ratio) else 1.0
            base_um = float(board_um(ball.x_um, ball.y_um))
            # A wide flat top reaches into the ring.
            cap_um = np.minimum(ball.centre_z_um + q * radius_um * np.sqrt(1.0 - off[cap]), ball.top_um)
            height_um[rows, cols][cap] = (base_um + cap_um).astype(np.float32)
    reach_px = BOARD_REACH * float(np.median([radius for _, _, radius in circles]))
    return Anchors(height_um=height_um, regions=regions, reach_px={0: reach_px})


def _window(centre_px: float, radius_px: float, size: int) -> slice:
    """Pixels of one axis that a ball covers, and one more on either side."""
    first, last = math.floor(centre_px - radius_px) - 1, math.ceil(centre_px + radius_px) + 1
    return slice(min(max(first, 0), size), min(max(last, 0), size))
