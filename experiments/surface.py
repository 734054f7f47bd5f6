"""A height map as a picture of a solid."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import colormaps

if TYPE_CHECKING:
    from bgars.records.pixels import FloatArray
    from matplotlib.colors import Normalize
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["COLORS", "draw_surface"]

COLORS = "cividis"
RINGS, ANGLES = 70, 121
RIM_PX = 1.5
"""The last ring that has four pixels around it lies this far inside the rim."""
AMBIENT = 0.35
PICTURE_LIGHT = (-0.62, -0.43, 0.66)


def draw_surface(axes: Any, height_px: FloatArray, heights: Normalize) -> None:  # noqa: ANN401 - 3-D axes have no stub
    """Draw heights of a round part true to scale: colour by height, brightness by a lamp from the left, no axes.

    Parameters
    ----------
    axes : Axes3D
        To draw into.
    height_px : (H, W) float32
        NaN outside the surface.
    heights : Normalize
        Colour scale and z range, the same for all surfaces of a figure.
    """
    x, y, z = _polar(height_px)
    facets = axes.plot_surface(
        x, y, z, rcount=z.shape[0], ccount=z.shape[1], linewidth=0, antialiased=False, shade=False
    )
    # An array at once: as an argument of plot_surface, colours are converted one by one.
    facets.set_facecolor(_shaded(x, y, z, heights)[:-1, :-1].reshape(-1, 4))
    low, high = float(heights.vmin or 0.0), float(heights.vmax or 1.0)
    axes.set_zlim(low, high)
    axes.set_box_aspect((np.ptp(x), np.ptp(y), high - low), zoom=1.5)
    axes.view_init(elev=14, azim=-60)
    axes.set_axis_off()


def _polar(height_px: FloatArray) -> tuple[Array, Array, Array]:
    """Round grids (rings, angles) of x, y, z around the image centre, closed down to the least height at the rim.

    Ends of pixel rows would make the rim of a steep surface ragged.
    """
    rows, cols = height_px.shape
    inside = np.isfinite(height_px)
    radius = 0.5 * float(np.count_nonzero(inside.any(axis=0)))
    rings = np.append(np.linspace(0.0, radius - RIM_PX, RINGS), radius)
    angle = np.linspace(0.0, 2.0 * np.pi, ANGLES)
    x, y = rings[:, None] * np.cos(angle), rings[:, None] * np.sin(angle)
    down, right = rows / 2 - 0.5 - y, cols / 2 - 0.5 + x
    top, left = np.floor(down).astype(np.intp), np.floor(right).astype(np.intp)
    low = float(np.nanmin(height_px))
    filled = np.where(inside, height_px, low).astype(np.float64)
    part_down, part_right = down - top, right - left
    upper = filled[top, left] * (1.0 - part_right) + filled[top, left + 1] * part_right
    lower = filled[top + 1, left] * (1.0 - part_right) + filled[top + 1, left + 1] * part_right
    z = upper * (1.0 - part_down) + lower * part_down
    z[-1] = low
    return x, y, z


def _shaded(x: Array, y: Array, z: Array, heights: Normalize) -> Array:
    """(rings, angles, 4) colours."""
    points = np.stack([x, y, z], axis=2)
    normals = np.cross(np.gradient(points, axis=0), np.gradient(points, axis=1))
    normals /= np.maximum(np.linalg.norm(normals, axis=2, keepdims=True), 1e-12)
    normals[0] = normals[1].mean(axis=0)
    brightness = AMBIENT + (1.0 - AMBIENT) * np.clip(normals @ np.array(PICTURE_LIGHT), 0.0, 1.0)
    colors: Array = colormaps[COLORS](heights(z))
    colors[..., :3] = np.clip(colors[..., :3] * brightness[..., None] * 1.3, 0.0, 1.0)
    return colors
