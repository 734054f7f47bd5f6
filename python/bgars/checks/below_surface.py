"""Lights that stand below the surface: no camera in front of a part sees by them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bgars.checks.cast_shadows import judge_shadows
from bgars.records.findings import Finding

if TYPE_CHECKING:
    from bgars.checks.view import View

__all__ = ["check_below", "raised"]

Array = NDArray[np.float64]


def raised(lights: Array) -> Array:
    """Return the lights with z made positive: what the other checks go on with."""
    return lights * np.where(lights[:, 2:] < 0.0, np.array([[1.0, 1.0, -1.0]]), 1.0)


def check_below(view: View) -> list[Finding]:
    """Find lights with z of 0 or less."""
    below = np.flatnonzero(view.lights[:, 2] <= 0.0)
    if not below.size:
        return []
    if len(below) < len(view.lights):
        return [
            Finding(
                "below-surface",
                "error",
                f"the light of {view.names[index]} stands below the surface (z = {view.lights[index, 2]:.3f})",
                "z must point from the surface to the camera: correct its line in the table of lights",
                image=int(index),
                value=float(view.lights[index, 2]),
                limit=0.0,
            )
            for index in below
        ]
    turned = judge_shadows(view.with_lights(raised(view.lights))).turned
    advice = (
        "the directions point from the lights to the surface: change the sign of x, y and z"
        if turned
        else "z must point from the surface to the camera: change the sign of z (of x, y and z if the directions were "
        "taken from the lights to the surface)"
    )
    worst = float(view.lights[:, 2].min())
    return [
        Finding(
            "below-surface",
            "error",
            "every light stands below the surface: its z is negative",
            advice,
            value=worst,
            limit=0.0,
        )
    ]
