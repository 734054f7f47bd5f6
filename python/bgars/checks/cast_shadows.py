"""Bump or hollow: which of two tables that differ by a half turn the cast shadows belong to.

With x and y of every light the wrong way round, shading shows a hollow for every bump, lit from the other side: n.l and
n.h are the same. Cast shadows are not: what casts one, bump or rim of a hollow, stands between the shadow and the
light. So level ground next to something steep is dark where that stands towards the light, and lit where it does not.

References
----------
P. N. Belhumeur, D. J. Kriegman, A. L. Yuille, The bas-relief ambiguity, IJCV 35 (1999) 33-44.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bgars.checks.evidence import critical_t, paired_t
from bgars.checks.matt_fit import MIN_LIGHTS, fit_normals, matt_lights
from bgars.checks.view import TILES, tile_sums

if TYPE_CHECKING:
    from bgars.checks.view import View

__all__ = ["ShadowVerdict", "judge_shadows"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

DARK = 0.3
"""Of what the pixel's normal promises: less is shadow."""
FACES = 0.2
"""Cosine between normal and light from which on a pixel would be lit if nothing stood in the way."""
LEVEL, UPRIGHT = 0.35, 0.6
"""Slopes of level ground, at most, and of what casts shadows, at least: 19 and 31 degrees."""
REACH = 3
"""Pixels of the small copy between a shadow and what casts it."""
MIN_SHADOWS = 20
"""Pixels of shadow beside something steep below which nothing is said."""
OVERHEAD = 0.1
"""Sine of the angle to the axis below which a light casts no shadow to speak of."""
PLAIN = 0.3
"""Share of the balance between dark and lit that must speak for the half turn: chance and one odd shadow leave less."""


class ShadowVerdict(NamedTuple):
    """Whether the half turn explains the cast shadows better, Student's t of that, tiles that speak."""

    turned: bool
    t: float
    tiles: float
    told: bool = False
    """Whether they tell at all: for the half turn or against it."""


class _Ground(NamedTuple):
    """What of a capture may lie in shadow: light of its promise (L, h, w), level ground, what stands upright."""

    share: NDArray[np.float64]
    lit: Mask
    level: Mask
    upright: Mask


def _ground(view: View, lights: Array) -> _Ground | None:
    count, rows, cols = view.values.shape
    if count < MIN_LIGHTS:
        return None
    keep = matt_lights(view).reshape(count, -1)
    fit = fit_normals(view.values.reshape(count, -1).astype(np.float64), keep, lights)
    solved = (fit.solved & (fit.normal[2] > 0)).reshape(rows, cols)
    if int(solved.sum()) < MIN_SHADOWS:
        return None
    length = np.sqrt((fit.normal**2).sum(axis=0))
    unit = (fit.normal / np.maximum(length, 1e-12)).reshape(3, rows, cols)
    facing = np.einsum("lc,c...->l...", lights, unit)
    could_be_lit = solved & (facing > FACES) & ~view.clipped
    share = view.values / np.maximum(facing * length.reshape(rows, cols), 1e-9)
    slope = np.hypot(unit[0], unit[1]) / np.maximum(unit[2], 1e-3)
    return _Ground(share, could_be_lit, solved & (slope < LEVEL), view.use & (~solved | (slope > UPRIGHT)))


def _sides(ground: _Ground, light: Array) -> tuple[Mask, Mask]:
    """Pixels of level ground with something steep only towards a light, and only away from it."""
    across = float(np.hypot(light[0], light[1]))
    if across < OVERHEAD:
        nothing = np.zeros_like(ground.level)
        return nothing, nothing
    towards, away = (_near(ground.upright, side * light[:2] / across) for side in (1.0, -1.0))
    return ground.level & towards & ~away, ground.level & away & ~towards


def judge_shadows(view: View) -> ShadowVerdict:
    """Compare the given table with the same one after half a turn.

    Parameters
    ----------
    view : View

    Returns
    -------
    ShadowVerdict
    """
    silent = ShadowVerdict(turned=False, t=0.0, tiles=0.0)
    ground = _ground(view, view.lights)
    if ground is None:
        return silent
    votes, voters = np.zeros(TILES * TILES), np.zeros(TILES * TILES)
    for index, light in enumerate(view.lights):
        lit = ground.lit[index]
        dark = lit & (ground.share[index] < DARK)
        towards, away = _sides(ground, light)
        counted = (towards | away) & lit
        vote = np.where(dark, 1.0, -1.0) * (away.astype(np.float64) - towards)
        votes += tile_sums(view.tiles, vote, counted)
        voters += tile_sums(view.tiles, dark.astype(np.float64), counted)
    there = voters > 0
    if voters.sum() < MIN_SHADOWS:
        return silent
    t, tiles = paired_t(votes[there] / voters[there], voters[there])
    balance = float(votes[there].sum() / voters[there].sum())
    plain = abs(balance) > PLAIN and abs(t) > critical_t(tiles)
    return ShadowVerdict(turned=plain and balance > 0.0, t=t, tiles=tiles, told=plain)


def _near(upright: Mask, direction: Array) -> Mask:
    """(h, w) pixels with something steep within reach in a direction (x right, y up)."""
    rows, cols = upright.shape
    found = np.zeros_like(upright)
    for step in range(1, REACH + 1):
        right, down = round(step * direction[0]), -round(step * direction[1])
        to_row, from_row = _ranges(rows, down)
        to_col, from_col = _ranges(cols, right)
        found[to_row, to_col] |= upright[from_row, from_col]
    return found


def _ranges(size: int, shift: int) -> tuple[slice, slice]:
    """Slices of the places that look by `shift`, and of the places they look at; empty where that is past the end."""
    shift = max(-size, min(shift, size))
    if shift >= 0:
        return slice(0, size - shift), slice(shift, size)
    return slice(-shift, size), slice(0, size + shift)
