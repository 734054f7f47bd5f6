"""Ten, twelve or fourteen bits in files of sixteen."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bgars.records.bit_depth import find_bit_depth
from bgars.records.findings import Finding

if TYPE_CHECKING:
    from bgars.records.capture import Capture

__all__ = ["check_bit_depth"]


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
