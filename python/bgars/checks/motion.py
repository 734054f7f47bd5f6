"""Images shifted against the others."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bgars.checks.evidence import critical_t
from bgars.records.findings import Finding

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bgars.checks.windows import FrameFit

__all__ = ["check_motion", "own_shifts"]

Array = NDArray[np.float64]

MOVED_PX = 0.3
"""Shift that is told: a third of a pixel is what edges of albedo turn into false slopes of some degrees."""
OF_OTHERS = 6.0
"""Times the usual residual shift of the other images, which the shape of highlights and edges makes."""
MIN_LIGHTS = 6
"""Of fewer, what is left over does not tell which image has moved."""


def own_shifts(fit: FrameFit, lights: Array) -> tuple[Array, Array]:
    """(L, 2) shifts without what goes with the direction of the light, and (L,) the usual ones of the other images.

    Gradients of shading are not where those of albedo are: that shifts all images in proportion to their lights.
    """
    design = np.column_stack([np.ones(len(lights)), lights[:, :2]])
    weight = 1.0 / np.maximum((fit.u_shift_px**2).sum(axis=1), 1e-4)
    shifts, usual = np.zeros_like(fit.shift_px), np.zeros(len(lights))
    for index in range(len(lights)):
        others = np.arange(len(lights)) != index
        scaled = design[others] * weight[others, None] ** 0.5
        common = np.linalg.lstsq(scaled, fit.shift_px[others] * weight[others, None] ** 0.5, rcond=None)[0]
        left = fit.shift_px - design @ common
        shifts[index] = left[index]
        usual[index] = float(np.median(np.hypot(*left[others].T)))
    return shifts, usual


def check_motion(fit: FrameFit, lights: Array, names: Sequence[str]) -> list[Finding]:
    """Find images that moved."""
    if len(lights) < MIN_LIGHTS:
        return []
    shifts, usual = own_shifts(fit, lights)
    size = np.hypot(*shifts.T)
    error = np.hypot(*fit.u_shift_px.T)
    index = int(np.argmax(np.where(size > critical_t(fit.tiles, len(lights)) * error, size / (usual + 0.02), 0.0)))
    certain = size[index] > critical_t(fit.tiles, len(lights)) * error[index] and size[index] > OF_OTHERS * usual[index]
    if size[index] < MOVED_PX or not certain:
        return []
    right, up = shifts[index]
    return [
        Finding(
            "motion",
            "warning",
            f"{names[index]} is shifted by {size[index]:.1f} pixels against the others "
            f"({right:+.1f} right, {up:+.1f} up)",
            "fix part and camera, wait until everything stands still, and take the images again",
            image=index,
            value=float(size[index]),
            limit=MOVED_PX,
            unit="px",
        )
    ]
