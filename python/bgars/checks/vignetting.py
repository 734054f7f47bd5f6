"""Corners darker than the middle in every image alike."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bgars.checks.evidence import critical_t
from bgars.checks.matt_fit import MIN_LIGHTS, fit_normals, matt_lights
from bgars.checks.view import TILES
from bgars.records.findings import Finding

if TYPE_CHECKING:
    from bgars.checks.view import View

__all__ = ["check_vignetting", "corner_loss"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

LOSS, MUCH = 0.20, 0.35
"""Light lost in the corners that is noted, and that costs signal; a factor common to all images bends no normal."""
ROUND = 2.0
"""How much more the loss goes with the distance from the middle than with any other second-order shape."""
INNER = 0.5
LASTS = 0.5
"""Of half a diagonal, and of the loss: beyond, a lens goes on losing light as before, a bright part in the middle of a
darker board does not. It is none if less is left, and two standard errors."""
COVERED = 0.7
"""Share of the tiles that must hold level, lit surface: a dark background is no vignetting."""


def corner_loss(view: View, lit: Mask) -> tuple[float, float, bool]:
    """Share of light lost in the corners, Student's t of it, and whether the loss is round."""
    albedo, tiles = _albedo(view), view.tiles
    lit = lit & (albedo > 0.0)
    level = np.full(TILES * TILES, np.nan)
    for tile in range(TILES * TILES):
        inside = lit & (tiles == tile)
        if inside.sum() >= 8:  # noqa: PLR2004 - a handful of pixels
            level[tile] = np.log(max(float(np.median(albedo[inside])), 1e-6))
    known = np.isfinite(level)
    if known.mean() < COVERED:
        return 0.0, 0.0, False
    rows, cols = view.values.shape[1:]
    half = np.hypot(rows, cols) / 2.0
    down, across = np.divmod(np.arange(TILES * TILES), TILES)
    x = ((across + 0.5) / TILES - 0.5) * cols / half
    y = ((down + 0.5) / TILES - 0.5) * rows / half
    design = np.column_stack([np.ones_like(x), x, y, x**2 + y**2, x**2 - y**2, 2.0 * x * y])
    outside = known & (np.hypot(x, y) > INNER)
    if outside.sum() < 2 * design.shape[1]:
        return 0.0, 0.0, False
    loss, error, is_round = _round_loss(design[known], level[known])
    beyond, error_beyond, _ = _round_loss(design[outside], level[outside])
    if beyond + 2.0 * error_beyond < LASTS * loss:
        return 0.0, 0.0, False
    return 1.0 - float(np.exp(-max(loss, 0.0))), loss / max(error, 1e-9), is_round


def _albedo(view: View) -> Array:
    """(h, w) light of a pixel without its slope, 0 where the lights do not tell it: caps and dishes darken outwards."""
    count, rows, cols = view.values.shape
    if count < MIN_LIGHTS:
        return np.asarray(view.mean, np.float64)
    fit = fit_normals(
        view.values.reshape(count, -1).astype(np.float64), matt_lights(view).reshape(count, -1), view.lights
    )
    return np.asarray((fit.solved * np.sqrt(np.square(fit.normal).sum(axis=0))).reshape(rows, cols), np.float64)


def _round_loss(design: Array, level: Array) -> tuple[float, float, bool]:
    """Loss towards the corners, natural logarithm, its standard error, and whether it is round."""
    weight: Array = np.ones(len(level))
    left: Array = np.zeros(len(level))
    normal: Array = np.eye(design.shape[1])
    solution: Array = np.zeros(design.shape[1])
    for _ in range(5):
        normal = design.T @ (weight[:, None] * design)
        solution = np.asarray(np.linalg.solve(normal, design.T @ (weight * level)), np.float64)
        left = np.asarray(level - design @ solution, np.float64)
        scale = 1.4826 * float(np.median(np.abs(left))) + 1e-6
        weight = 1.0 / (1.0 + (left / (2.0 * scale)) ** 2)
    error = float(np.sqrt(np.linalg.inv(normal)[3, 3] * (weight * left**2).sum() / max(weight.sum() - 6.0, 1.0)))
    loss = -float(solution[3])
    return loss, error, bool(loss > ROUND * float(np.hypot(solution[4], solution[5])))


def check_vignetting(view: View, lit: Mask) -> list[Finding]:
    """Find a lens, or lamps, that light the corners less."""
    loss, t, is_round = corner_loss(view, lit)
    if loss < LOSS or not is_round or t < critical_t(TILES * TILES):
        return []
    return [
        Finding(
            "vignetting",
            "warning" if loss > MUCH else "note",
            f"every image loses {100 * loss:.0f} % of its light towards the corners",
            "take a flat field (a white card under all lamps) and divide by it, stop the lens down, or keep the part "
            "in the middle",
            value=loss,
            limit=LOSS,
            unit="of the light",
        )
    ]
