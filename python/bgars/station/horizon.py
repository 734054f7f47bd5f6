"""Whether a circle is the horizon that a mirror ball shows, and not its outline.

A mirror ball shows all that lies above the horizon within 1 / sqrt(2) of its radius, and that circle is often plainer
than its own outline, which parts the ground from a picture of it. Then another edge lies around it, at sqrt(2) of its
radius: faint, but seen by many pixels. Smooth changes of the ground, as beside any ball, make no step.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from bgars.station.levels import Levels
    from bgars.station.outline import Outline

__all__ = ["radius_around"]

AROUND = np.linspace(1.36, 1.47, 23)
"""Radii that are looked at: sqrt(2), and 4 % for a ground that ends, or for light that comes from below the horizon."""
BESIDE_PX = 4.0
"""Width of the rings on either side of an edge, and of those next to them."""
SECTORS = 12
SURE = 6.0
"""Steps that their scatter from sector to sector makes uncertain by less than a sixth: by chance one circle in ten
thousand has one (Student's t with 11 degrees of freedom). Texture and shadows of the ground scatter, noise does."""


def radius_around(levels: Levels, outline: Outline) -> float | None:
    """Radius of a fainter edge around a circle, px, where a horizon's ball would have its outline; None without one."""
    mean = levels.images.mean(axis=0)
    height, width = mean.shape
    x, y = np.arange(width) + 0.5 - width / 2.0 - outline.x_px, height / 2.0 - 0.5 - np.arange(height) - outline.y_px
    apart = np.hypot(x[None, :], y[:, None])
    sector = ((np.arctan2(y[:, None], x[None, :]) / (2.0 * math.pi) + 0.5) * SECTORS).astype(int) % SECTORS
    largest, found = 0.0, None
    for radius_px in AROUND * outline.radius_px:
        if not replace(outline, radius_px=radius_px + 2.0 * BESIDE_PX).inside(height, width):
            break  # a ball that is cut off is refused anyway
        ring = np.floor((apart - radius_px) / BESIDE_PX).astype(int) + 2
        use = (ring >= 0) & (ring < 4)  # noqa: PLR2004 - two rings on either side
        place = sector[use] * 4 + ring[use]
        count = np.bincount(place, minlength=4 * SECTORS).reshape(SECTORS, 4)
        total = np.bincount(place, weights=mean[use], minlength=4 * SECTORS).reshape(SECTORS, 4)
        level = total / np.maximum(count, 1)
        # What a slope makes of the middle difference is that of the outer two.
        step = level[:, 2] - level[:, 1] - 0.5 * (level[:, 1] - level[:, 0] + level[:, 3] - level[:, 2])
        size, u = abs(float(step.mean())), float(step.std(ddof=1)) / math.sqrt(SECTORS)
        if size > max(SURE * u, largest):
            largest, found = size, float(radius_px)
    return found
