"""Whether a second ball is in view, which nobody asked for: it would be left out without a word."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bgars.records.remark import Remark
from bgars.station.highlights import find_spot, glare
from bgars.station.matt_lights import shading_misfit
from bgars.station.outline import PLAIN_ARC, find_outline
from bgars.station.stated_outline import as_option

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from bgars.records.capture import Capture
    from bgars.station.levels import Levels
    from bgars.station.outline import Outline

__all__ = ["another_ball"]

LEAST_SHARE = 0.25
"""Radius of a ball that would help, of the one that is used: a circle that is smaller is a screw, or a hole."""
WORSE = 2.0
"""Misfit of the shading of another matt ball, at most, of the first one's."""


def another_ball(
    capture: Capture,
    levels: Levels,
    pictures: list[NDArray[np.float64]],
    used: Outline,
    steps: tuple[float, ...],
    *,
    matt: bool,
) -> list[Remark]:
    """Return a note on a ball beside the one that is used: a plain circle that shows the lights, as a ball does."""
    height, width = pictures[0].shape
    found = find_outline(pictures, None, steps, used)
    if found is None or found.arc < PLAIN_ARC or found.radius_px < LEAST_SHARE * used.radius_px:
        return []
    if not found.inside(height, width):
        return []
    if matt:
        if shading_misfit(levels, found) > WORSE * shading_misfit(levels, used):
            return []
    else:
        still, usable = glare(levels.images, found.circle_px)
        spots = [find_spot(image, still, usable, levels.clip, levels.noise) for image in levels.images]
        if any(spot is None for spot in spots):
            return []
    both = " ".join(as_option(one.circle_px, height, width) for one in (used, found))
    message = f"{capture.name}: another ball is in view, and not used; to use both, give {both}"
    return [Remark("note", message, "another-ball")]
