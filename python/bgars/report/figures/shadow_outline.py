"""The outline of a ball's shadow on its board, from what was measured."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

__all__ = ["shadow_outline_um"]

Array = NDArray[np.float64]
POINTS = 181
UPRIGHT = 1e-9


def shadow_outline_um(
    centre_um: Array, radius_um: float, q: float, light: Array, board_um: Array, *, is_position: bool = False
) -> Array | None:
    """Cast the outline of a spheroid on its tangent plane of the board.

    Along the light, a sphere throws the circle where the rays touch it; a spheroid is a sphere in space that is
    stretched along z by 1 / q, and straight rays stay straight there. The outline is that of a floating ball: near
    the ball, where it meets its board, the real shadow is cut off.

    Parameters
    ----------
    centre_um : (3,) float64
        Centre; z above the board under it.
    radius_um : float
        Horizontal radius.
    q : float
        Vertical over horizontal radius.
    light : (3,) float64
        Unit direction to the light, or its position in um (z above the board under the ball).
    board_um : (2,) float64
        Slopes of the board under the ball, dz/dx and dz/dy.
    is_position : bool
        The light is a point at `light`.

    Returns
    -------
    (n, 2) float64 or None
        Closed outline in the image; None where the ball is not above the board's plane along the light.

    Examples
    --------
    Under a light at 45 degrees a sphere's shadow is an ellipse, centred one centre height away:

    >>> light = np.array([1.0, 0.0, 1.0]) / np.sqrt(2.0)
    >>> outline = shadow_outline_um(np.array([0.0, 0, 200]), 300.0, 1.0, light, np.zeros(2))
    >>> outline.min(axis=0).round(1).tolist(), outline.max(axis=0).round(1).tolist()
    ([-624.3, -300.0], [224.3, 300.0])
    """
    stretch = np.array([1.0, 1.0, 1.0 / q])
    centre = centre_um * stretch
    toward = light * stretch - centre if is_position else light * stretch
    distance = float(np.linalg.norm(toward))
    axis = toward / distance
    # Rays from a point touch nearer than the widest circle, rays from far away exactly there.
    ahead = radius_um**2 / distance if is_position else 0.0
    if ahead >= radius_um:
        return None
    circle_radius = math.sqrt(radius_um**2 - ahead**2)
    side = np.cross(axis, [0.0, 0.0, 1.0])
    side = np.array([1.0, 0.0, 0.0]) if np.linalg.norm(side) < UPRIGHT else side / np.linalg.norm(side)
    angles = np.linspace(0.0, 2.0 * np.pi, POINTS)
    rim = (
        centre
        + ahead * axis
        + circle_radius * (np.outer(np.cos(angles), side) + np.outer(np.sin(angles), np.cross(axis, side)))
    )
    rays = rim - light * stretch if is_position else np.broadcast_to(-axis, rim.shape)
    # The board under the ball: z = board . (x - centre_x, y - centre_y), stretched as well.
    slopes = board_um / q
    above = rim[:, 2] - (rim[:, :2] - centre[:2]) @ slopes
    falling = rays[:, :2] @ slopes - rays[:, 2]
    if (falling <= 0).any():
        return None
    outline: Array = rim[:, :2] + rays[:, :2] * (above / falling)[:, None]
    return outline
