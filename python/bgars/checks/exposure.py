"""Lamps that are dead, captures too dark or too bright."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bgars.records.findings import Finding

if TYPE_CHECKING:
    from bgars.checks.view import View

__all__ = ["check_clipped", "check_dark", "dead_lamps"]

DEAD = 0.04
"""Mean of an image, of the median of all: a lamp that gives so little gives nothing, the rest is stray light."""
STRAY = 0.2
"""The same where the image shows no shading of its own: stray light only."""
BRIGHT_PERCENT = 99.0
DARK = 20.0 / 255.0
"""Brightest level, of full scale: below, 8 bits quantise slopes to 1 / 20 / sqrt(12) = 0.014 rad a light, 1 degree.
In files of 16 bits cameras that expose so little are noisy, or have fewer bits: both need a word."""
BLACK = 2.0
"""Grey levels of the file below which the brightest parts are black: with one level no light differs from another."""
MOST_LIGHTS = 0.75
"""A highlight clips a pixel under the lights of one side only; clipped under so many of them, it is overexposed."""
OVEREXPOSED, MUCH_OVEREXPOSED = 0.02, 0.1
"""Share of pixels so overexposed that is noted (more than bright pads and flat tops cover), and that is a fault of the
exposure: clipped pixels are left out of the normals in any case."""
ONE_IMAGE = 0.05
"""Share of clipped pixels by which one image may exceed the median of all: highlights are alike under all lights."""


def dead_lamps(view: View, inside: NDArray[np.bool_]) -> list[Finding]:
    """Find images without light of their own."""
    level = np.array([float(np.percentile(image[inside], 90.0)) for image in view.values])
    usual = float(np.median(level))
    found = []
    for index, value in enumerate(level):
        if value >= STRAY * usual or not usual > 0.0:
            continue
        others = np.delete(view.values, index, axis=0).mean(axis=0)[inside]
        image = view.values[index][inside]
        own = float(np.corrcoef(image, others)[0, 1]) if image.std() > 0 and others.std() > 0 else 0.0
        if value < DEAD * usual or own < 0.5:  # noqa: PLR2004 - less than half of what any lamp shows
            found.append(
                Finding(
                    "lamp-dead",
                    "error",
                    f"{view.names[index]} is black: it has {100 * (value / usual):.1f} % of the light of the others",
                    "the lamp did not light or the trigger came too early: check lamp, cable and trigger, and take the "
                    "image again (or leave the image and its light out)",
                    image=index,
                    value=value / usual,
                    limit=DEAD,
                    unit="of the others' light",
                )
            )
    return found


def check_dark(view: View, inside: NDArray[np.bool_], levels: float) -> list[Finding]:
    """Find underexposure of the whole capture; `levels` is the number of grey levels of the files."""
    brightest = float(np.percentile(view.values.max(axis=0)[inside], BRIGHT_PERCENT)) if inside.any() else 0.0
    brightest *= view.used_scale
    if brightest >= DARK:
        return []
    if brightest * levels < BLACK:
        return [
            Finding(
                "dark",
                "error",
                "all images are black: their brightest parts are less than two grey levels above the black level",
                "look for a closed lens cap, lamps without power, the exposure time, and a black level or dark frame "
                "that takes all light away",
                value=brightest,
                limit=BLACK / levels,
                unit="of full scale",
            )
        ]
    fewer = "" if view.used_scale > 0.5 else " (or, if the camera has fewer than 16 bits, state 'saturation')"  # noqa: PLR2004
    return [
        Finding(
            "dark",
            "warning",
            f"the images are dark: their brightest parts reach {100 * brightest:.1f} % of full scale",
            f"expose about {0.7 / max(brightest, 1e-3):.0f} times longer, so that matt parts come to 40 to 80 % of "
            f"full scale{fewer}",
            value=brightest,
            limit=DARK,
            unit="of full scale",
        )
    ]


def check_clipped(view: View, inside: NDArray[np.bool_]) -> list[Finding]:
    """Find overexposure, of all images or of one."""
    if not inside.any():
        return []
    clipped = view.clipped[:, inside]
    often = clipped.mean(axis=0) >= MOST_LIGHTS
    share = float(often.mean())
    if share > OVEREXPOSED:
        return [
            Finding(
                "clipped",
                "warning" if share > MUCH_OVEREXPOSED else "note",
                f"{100 * share:.0f} % of the image is clipped under three lights of four or more",
                "reduce the exposure, or state 'saturation' if it clips elsewhere: clipped pixels have no normal",
                value=share,
                limit=OVEREXPOSED,
                unit="of the pixels",
            )
        ]
    shares = clipped.mean(axis=1)
    found = []
    for index, value in enumerate(shares):
        usual = float(np.median(np.delete(shares, index)))
        if value > usual + ONE_IMAGE and value > 2.0 * usual:
            found.append(
                Finding(
                    "clipped",
                    "warning",
                    f"{view.names[index]} is overexposed: {100 * value:.0f} % of it is clipped, but only "
                    f"{100 * usual:.0f} % of the others",
                    "lower this lamp, or shorten the exposure",
                    image=index,
                    value=float(value),
                    limit=usual + ONE_IMAGE,
                    unit="of the pixels",
                )
            )
    return found
