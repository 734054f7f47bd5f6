r"""Flat tops, which no shadow shows: slopes that are missing around the top, against the population.

On a ball the tilt of the normal grows from its centre, n_r = q r / R at first. On a flat top of radius a it is 0:
what is
missing adds up to ``M = sum (q r / R - n_r) = 2 pi q a^3 / (3 R)`` over the disc, in pixels. What an estimator gets
wrong
on every ball alike is the population's median M and is subtracted. The cap that is gone is ``q (R - sqrt(R^2 - a^2))``
high.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from bgars.records.normal_field import NormalField

__all__ = ["FlatTops", "flat_tops"]

Array = NDArray[np.float64]

REACH = 0.8
"""Normals within this share of the radius are looked at: farther out they are worst."""
MIN_KNOWN = 0.6
"""Share of the normals of a top that must be measured."""
MIN_POPULATION = 5
"""Balls whose median shows what the normals get wrong on all."""
WITHOUT_POPULATION = 0.02
"""Standard deviation of M / R^2 that estimators get wrong on all balls alike: only a population takes it off."""
INNER, UPRIGHT = 0.7, 0.5
"""Within this share of a flat top, normals have less than this share of the tilt of a ball's."""
LARGEST = 0.75
"""A flat top wider than this share of the radius cannot be told from a ball that is not measured."""


class FlatTops(NamedTuple):
    """(N,) missing height in pixels and its standard uncertainty; NaN where too few normals are known."""

    height_px: Array
    u_height_px: Array


def flat_tops(field: NormalField, table: Array) -> FlatTops:
    """Measure what is missing from the tops of balls.

    Parameters
    ----------
    field : NormalField
    table : (N, 5) float64
        x, y, z, radius, q in pixels.
    """
    missing = np.array([_missing_slope(field, row) for row in table])
    known = np.isfinite(missing)
    height, u_height = np.full(len(table), np.nan), np.full(len(table), np.nan)
    usual, spread = 0.0, WITHOUT_POPULATION
    if known.sum() >= MIN_POPULATION:
        usual = float(np.median(missing[known]))
        spread = max(1.4826 * float(np.median(np.abs(missing[known] - usual))), 1e-6)
    for index in np.flatnonzero(known):
        radius, q = table[index, 3], table[index, 4]
        height[index] = _cap(missing[index] - usual, radius, q)
        if height[index] > 0 and not _is_flat(field, table[index], _share(missing[index] - usual, q)):
            height[index] = 0.0
        # The cap grows steeply from 0: its uncertainty is that of one spread more.
        u_height[index] = max(
            _cap(missing[index] - usual + spread, radius, q) - height[index], _cap(spread, radius, q) * 0.5
        )
    return FlatTops(height, u_height)


def _cap(missing: float, radius: float, q: float) -> float:
    """Height of the cap of a sphere that would make so much slope missing (missing is in units of R^2)."""
    share = _share(missing, q)
    return float(q * radius * (1.0 - np.sqrt(1.0 - share * share)))


def _share(missing: float, q: float) -> float:
    """Radius of the flat top over the ball's."""
    return float(min(np.cbrt(1.5 * max(missing, 0.0) / (np.pi * q)), LARGEST))


def _missing_slope(field: NormalField, row: Array) -> float:
    """Sum of (expected - found radial slope) over the disc, over R^2; NaN where too little is known."""
    expected, found, inside = _radial_slopes(field, row, REACH)
    known = np.isfinite(found)
    if inside == 0 or known.sum() < MIN_KNOWN * inside:
        return float("nan")
    gap = np.clip(expected[known] - found[known], -1.0, 1.0)
    return float(gap.mean() * inside / row[3] ** 2)


def _is_flat(field: NormalField, row: Array, share: float) -> bool:
    """Whether normals within a supposed flat top stand upright, not only less tilted than they should."""
    expected, found, _ = _radial_slopes(field, row, INNER * share)
    known = np.isfinite(found) & (expected > 0)
    return bool(known.any()) and float(np.median(found[known] / expected[known])) < UPRIGHT


def _radial_slopes(field: NormalField, row: Array, share: float) -> tuple[Array, Array, int]:
    """Expected and found (NaN: unknown) radial parts of the normals within a share of the radius, and how many."""
    height, width = field.mask.shape
    centre_x, centre_y, _, radius, q = row
    reach = share * radius
    col, line = centre_x + width / 2.0 - 0.5, height / 2.0 - 0.5 - centre_y
    cols = np.arange(max(int(np.ceil(col - reach)), 0), min(int(np.floor(col + reach)) + 1, width))
    rows = np.arange(max(int(np.ceil(line - reach)), 0), min(int(np.floor(line + reach)) + 1, height))
    if not cols.size or not rows.size:
        return np.zeros(0), np.zeros(0), 0
    x, y = (cols - col)[None, :], (line - rows)[:, None]
    r = np.hypot(x, y)
    patch = (slice(rows[0], rows[-1] + 1), slice(cols[0], cols[-1] + 1))
    normals = field.normals[patch].astype(np.float64)
    inside = r < reach
    # Spheroid: its profile q sqrt(R^2 - r^2) is q r / sqrt(R^2 - r^2) steep.
    steep = np.where(inside, q * r / np.sqrt(np.maximum(radius**2 - r**2, 1e-9)), 0.0)
    found = np.where(field.mask[patch], (normals[..., 0] * x + normals[..., 1] * y) / np.maximum(r, 1e-9), np.nan)
    return (steep / np.sqrt(1.0 + steep**2))[inside], found[inside], int(inside.sum())
