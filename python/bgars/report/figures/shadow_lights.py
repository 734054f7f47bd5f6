"""Which lights the pictures of the shadows show: first those that something is wrong with."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from bgars.files.light_names import named_lights

if TYPE_CHECKING:
    from bgars.records.part_result import PartResult

__all__ = ["flagged_lights", "is_fitted", "panel_lights"]

FAR_DEG = 1.0


def is_fitted(result: PartResult) -> bool:
    """Whether shadows were fitted at all: without a fit no light was looked for, and none moved."""
    return math.isfinite(result.shadow_residual_rms)


def flagged_lights(result: PartResult) -> tuple[int, ...]:
    """Lights that a reason or a warning names, the farthest from the rig first."""
    moved = result.light_change_deg
    texts = (*result.reasons, *result.warnings)
    named = dict.fromkeys(light for text in texts for light in named_lights(text) if light < len(moved))
    # Of lights that all but stayed, the first that is named is the worst.
    return tuple(sorted(named, key=lambda light: -moved[light] if moved[light] > FAR_DEG else 0.0))


def panel_lights(result: PartResult, lights: int, most: int) -> tuple[int, ...]:
    """Lights of `most` panels, in their order: flagged ones, the one that moved most, then others evenly around."""
    chosen = list(flagged_lights(result)[:most])
    if is_fitted(result) and np.nanmax(result.light_change_deg, initial=0.0) > 0:
        chosen.append(int(np.nanargmax(result.light_change_deg)))
    even = np.linspace(0, lights, most, endpoint=False).astype(int)
    chosen += [int(light) for light in (*even, *range(lights))]
    return tuple(sorted(list(dict.fromkeys(chosen))[:most]))
