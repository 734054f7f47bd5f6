"""Light that is in every image: daylight, a lamp that stays on, a black level that nobody took away.

In cast shadows only such light is left. They are looked for where they must be: on level ground, with something steep
between it and the lamp (`cast_shadows.py`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bgars.checks.cast_shadows import behind_steep
from bgars.records.findings import Finding

if TYPE_CHECKING:
    from bgars.checks.view import View

__all__ = ["check_ambient", "shadow_floor"]

AMBIENT = 0.20
"""Light in cast shadows, of the light beside them: neighbours give up to 12 percent, and so much tilts
normals by degrees."""
NO_SHADOW = 0.8
"""Of the light beside them: so bright a place is in no shadow at all."""
DARKEST_PERCENT = (5.0, 10.0)
"""Percentiles of the light behind something steep that must both be shadows: not all that is steep casts one."""
MIN_PIXELS = 100


def shadow_floor(view: View, lights: NDArray[np.float64]) -> tuple[float, float] | None:
    """Light that is left in cast shadows, of that beside them, at two percentiles; None where there are none."""
    share = behind_steep(view, lights)
    if share.size < MIN_PIXELS:
        return None
    low, high = np.percentile(share, DARKEST_PERCENT)
    return float(low), float(high)


def check_ambient(view: View, lights: NDArray[np.float64]) -> list[Finding]:
    """Find light common to all images."""
    floor = shadow_floor(view, lights)
    if floor is None or floor[0] < AMBIENT or floor[1] > NO_SHADOW:
        return []
    return [
        Finding(
            "ambient",
            "warning",
            f"cast shadows still have {floor[0]:.0%} of the light beside them: ambient light, or a black level",
            "darken the room, take an image with all lamps off and give it as 'dark' in capture.toml (or black_level)",
            value=floor[0],
            limit=AMBIENT,
            unit="of the light",
        )
    ]
