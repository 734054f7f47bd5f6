"""Images blurred against the others."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bgars.checks.evidence import critical_t
from bgars.records.findings import Finding

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bgars.checks.windows import FrameFit

__all__ = ["check_focus"]

BLURRED_PX2 = 0.8
"""Variance of added blur that is told: standard deviation 0.9 px, a little more than a good lens has itself."""
OF_OTHERS = 8.0
"""Times the usual difference of the other images from their median."""


def check_focus(fit: FrameFit, names: Sequence[str]) -> list[Finding]:
    """Find an image that is less sharp than the others."""
    if len(names) < 6:  # noqa: PLR2004 - of fewer, what is left over does not tell which it is
        return []
    middle = float(np.median(fit.blur_px2))
    added = fit.blur_px2 - middle
    index = int(np.argmax(added))
    usual = float(np.median(np.abs(np.delete(added, index))))
    certain = added[index] > critical_t(fit.tiles, len(names)) * fit.u_blur_px2[index]
    if added[index] < BLURRED_PX2 or not certain or added[index] < OF_OTHERS * usual:
        return []
    return [
        Finding(
            "focus",
            "warning",
            f"{names[index]} is blurred against the others (about {added[index] ** 0.5:.1f} px more)",
            "look for vibration, a moved focus ring, or autofocus between the images, and take it again",
            image=index,
            value=float(added[index] ** 0.5),
            limit=BLURRED_PX2**0.5,
            unit="px",
        )
    ]
