"""Noise, of one image against the rest and of all."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bgars.checks.noise_levels import noise_share
from bgars.records.findings import Finding

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from bgars.checks.noise_levels import NoiseCurve

__all__ = ["check_drowned", "check_noise"]

NOISIER = 1.8
"""Ratio of one image's noise to the others': three times their variance."""
LEAST = 0.6 / 255.0
"""Noise below that of rounding to 8 bits, twice, is none."""
NOISY, VERY_NOISY, DROWNED = 0.06, 0.12, 0.4
"""Noise over signal at which normals of single pixels are off by 3, 6 and 20 degrees under eight lights: the standard
error of the normals says the first, too, so that it is a note; the last is more than most surfaces slope."""
WORDS = "expose longer at lower gain, or average several images under each light"


def check_drowned(curve: NoiseCurve | None) -> list[Finding]:
    """Find noise that hides the surface: what is lit and matt cannot be told any more, nor what grey levels mean."""
    share = 0.0 if curve is None else noise_share(curve)
    if share <= VERY_NOISY:
        return []
    lost = share > DROWNED
    return [
        Finding(
            "noise",
            "error" if lost else "warning",
            f"the images are {'noise and little else' if lost else 'noisy'}: neighbouring pixels differ by "
            f"{100 * share:.0f} % of the signal",
            f"look whether the files hold images at all; {WORDS}" if lost else WORDS,
            value=share,
            limit=DROWNED if lost else VERY_NOISY,
            unit="of the signal",
        )
    ]


def check_noise(noise: NDArray[np.float64], level: float, names: Sequence[str]) -> list[Finding]:
    """Find noise."""
    if len(names) < 5 or not noise.any():  # noqa: PLR2004 - three images leave nothing over
        return []
    index = int(np.argmax(noise))
    usual = float(np.median(np.delete(noise, index)))
    value = float(noise[index])
    if value > NOISIER * max(usual, LEAST):
        return [
            Finding(
                "noise",
                "warning",
                f"{names[index]} has {value / max(usual, LEAST / 2):.1f} times the noise of the others",
                "look for another gain or exposure of this image, or for interference, and take it again",
                image=index,
                value=value / max(usual, LEAST / 2),
                limit=NOISIER,
                unit="times",
            )
        ]
    share = usual / max(level, 1e-9)
    if share > NOISY:
        return [
            Finding(
                "noise",
                "warning" if share > VERY_NOISY else "note",
                f"the images are noisy: {100 * share:.0f} % of the signal",
                WORDS,
                value=share,
                limit=NOISY,
                unit="of the signal",
            )
        ]
    return []
