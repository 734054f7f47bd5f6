"""Ten, twelve or fourteen bits in files of sixteen; images of few grey levels."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bgars.records.bit_depth import find_bit_depth
from bgars.records.findings import Finding

if TYPE_CHECKING:
    from bgars.records.capture import Capture

__all__ = ["check_bit_depth", "check_few_levels"]

FEWEST_LEVELS = 20
"""Steps from black to the brightest level below which rounding alone tilts normals by more than a degree: a step is
rounded by 1 / sqrt(12) of itself, 1 / 20 / sqrt(12) = 0.014 rad a light (as `exposure.DARK`)."""
MIN_PIXELS = 1000
"""Of an image: fewer have few levels anyway."""


def check_bit_depth(capture: Capture) -> list[Finding]:
    """Find a camera of fewer bits than its files, where clipped pixels are not taken as clipped."""
    depth = find_bit_depth(capture.images)
    if depth is None or depth.shift or capture.response is not None:
        return []
    unused = capture.saturation > depth.saturation
    if not unused:
        return []
    return [
        Finding(
            "bit-depth",
            "warning",
            f"the files hold {depth.bits}-bit data: {depth.reason}",
            f"state 'saturation = {depth.saturation}' in capture.toml, so that clipped pixels count as clipped",
            value=float(depth.saturation),
            limit=float(min(capture.saturation, 65535.0)),
            unit="grey levels",
        )
    ]


def check_few_levels(capture: Capture) -> list[Finding]:
    """Find images of so few grey levels, evenly spread over the range, that rounding rules the normals."""
    if capture.images.dtype.kind != "u" or int(capture.mask.sum()) < MIN_PIXELS:
        return []
    seen = np.zeros(2 ** (8 * capture.images.dtype.itemsize), dtype=np.bool_)
    most = 0
    for image in capture.images:
        levels = np.flatnonzero(np.bincount(image[capture.mask], minlength=1))
        most = max(most, len(levels))
        seen[levels] = True
        if most > FEWEST_LEVELS:
            return []
    used = np.flatnonzero(seen)
    # A single level is a blank field; neighbouring levels are a dark image, which is said elsewhere.
    if most < 2 or int(np.diff(used).min()) < 2:  # noqa: PLR2004
        return []
    step = float(np.median(np.diff(used)))
    steps = float(used[-1]) / step
    if steps >= FEWEST_LEVELS:
        return []
    return [
        Finding(
            "bit-depth",
            "warning",
            f"the images have {len(used)} grey levels, {step:.0f} apart: rounding to them tilts normals by "
            f"{np.degrees(1.0 / steps / 12.0**0.5):.0f} degrees or so",
            "take images of 8 bits or more; look for a threshold, a palette, or a program that reduced the grey levels",
            value=steps,
            limit=float(FEWEST_LEVELS),
            unit="steps",
        )
    ]
