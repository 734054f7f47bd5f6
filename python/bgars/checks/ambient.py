"""Light that is in every image: daylight, a lamp that stays on, stray light in the lens, a black level left in.

Nothing is darker than such light. Light from neighbours fades into the depth of shadows, so that without it the
darkness of shadows has no lower end but zero. The lower end is extrapolated from three percentiles of what lies in cast
shadow: level - a = C p^k (as for the location of a Weibull distribution).

References
----------
S. D. Dubey, Some percentile estimators for Weibull parameters, Technometrics 9 (1967) 119-129.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bgars.checks.patches import box_blocks, cut_patches
from bgars.records.findings import Finding

if TYPE_CHECKING:
    from bgars.records.capture import Capture

__all__ = ["ShadowFloor", "check_ambient", "shadow_floor"]

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

AMBIENT = 0.02
"""Of the light of the lit surface: so much on a slope of 45 degrees under lamps at 45 degrees tilts it by a degree."""
LEVELS = 1.0
"""Grey levels of 8 bits below which a floor is rounding, of image and dark frame: three standard errors."""
LOW_PERCENT, HIGH_PERCENT = 1.0, 25.0
"""Of shadowed places, sorted; a third between them in equal ratios."""
MOST_LOW_PERCENT = 5.0
LOW_PLACES = 20
"""Places below the lowest percentile, at least: fewer do not fix it."""
SHADOWED = 0.6
"""Of what the other lights promise: less is shadow."""
FACES = 0.3
"""Of the lit level: a promise of less is no evidence."""
AWAY = 0.05
"""Of the lit level: so far below nothing is a promise that is no error of the lights that make it, of which a degree
changes light at 45 degrees by 0.025."""
LIT_QUANTILE = 0.6
"""Of the lights of a pixel: most light it."""
DROPPED = 4
"""One light in so many, the brightest ones, may be a highlight."""
MIN_SHARE = 0.01
"""Shadowed places, of all pairs of place and light: fewer are slips of the promise."""
VEILS = (0.2, 0.35, 0.5, 0.6, 0.7)
"""Of the lit level: under so much ambient light shadows are no longer dark. They are found once it is taken away, and
must hold more than that."""
NEVER_DARK = 0.6
"""Of what is tried as a veil: where one place in a hundred is darker, there is none."""
CASTS = 0.5
"""Sine between the usual light and the axis, at least: where lights stand steeper, nothing need be dark."""
NEARLY = 0.9
"""Of what a veil is taken for: if one place in a hundred is darker, it is none."""
BLOCK_PX = 3
FAINT = 3.0 / 255.0
"""Lit level below which everything is dark."""
SOLVABLE = 1e-3
"""Determinant of three directions, squared: below, they lie in one plane to some degrees."""


class ShadowFloor(NamedTuple):
    """Lower end of shadows and usual lit level, of full scale; shadowed places."""

    floor: float
    lit: float
    places: int


def shadow_floor(capture: Capture, lights: Array, strengths: Array | float = 1.0) -> ShadowFloor | None:
    """Return what is left in the deepest cast shadows; None where there are none.

    `strengths`: of the lamps, times the stated ones.
    """
    gains = (capture.rig.intensities * strengths).astype(np.float32)
    if len(gains) != len(lights):
        return None
    places = []
    for patch in cut_patches(capture):
        if min(patch.inside.shape) < BLOCK_PX:
            continue
        inside = box_blocks(patch.inside.astype(np.float32), BLOCK_PX) > 0.99  # noqa: PLR2004 - all of a block
        levels = box_blocks(patch.levels, BLOCK_PX)[:, inside] / gains[:, None]
        levels[box_blocks(patch.clipped.astype(np.float32), BLOCK_PX)[:, inside] > 0] = np.inf
        usual = np.quantile(levels, LIT_QUANTILE, axis=0, method="lower")
        used = np.isfinite(usual) & (usual > FAINT)
        places.append((levels[:, used], usual[used]))
    if not sum(levels.size for levels, _ in places):
        return None
    found = _floor(places, lights, gains, 0.0)
    darkest = np.percentile(np.concatenate([(levels / usual).ravel() for levels, usual in places]), LOW_PERCENT)
    casts = float(np.median(np.hypot(lights[:, 0], lights[:, 1]))) > CASTS
    for veil in VEILS if casts else ():
        if darkest < NEVER_DARK * veil:
            break
        strong = _floor(places, lights, gains, veil)
        if strong is not None and strong.floor > max(veil * strong.lit, found.floor if found else 0.0):
            return strong
    return found


def _floor(places: list[tuple[Floats, Floats]], lights: Array, gains: Floats, veil: float) -> ShadowFloor | None:
    """Return what is left in shadows that show once a share of the lit level is taken away."""
    shadows, shares, counts = [], [], np.zeros(len(lights))
    for levels, usual in places:
        shadowed = _in_shadow(levels - np.float32(veil) * usual, np.float32(1.0 - veil) * usual, lights)
        shadows.append((levels * gains[:, None])[shadowed])
        shares.append((levels * gains[:, None] / usual)[shadowed])
        counts += shadowed.sum(axis=1)
    dark = np.concatenate(shadows)
    percent = max(LOW_PERCENT, 100.0 * LOW_PLACES / max(dark.size, 1))
    if dark.size < MIN_SHARE * sum(levels.size for levels, _ in places) or percent > MOST_LOW_PERCENT:
        return None
    # A lamp that is weaker than stated is dim everywhere, and looks like shadow once enough is taken away.
    if veil > 0.0 and len(counts) * float(np.median(counts)) < MIN_SHARE * sum(levels.size for levels, _ in places):
        return None
    percents = (percent, (percent * HIGH_PERCENT) ** 0.5, HIGH_PERCENT)
    usual_lit = float(np.median(np.concatenate([usual for _, usual in places])))
    # Light in the lens is the same on all pixels; light on the part goes with what they reflect.
    ends = [_lower_end(dark, percents), usual_lit * _lower_end(np.concatenate(shares), percents)]
    if veil > 0.0:  # of slopes that lamps hardly reach much is darker, of a veil nothing
        lowest = [np.percentile(np.concatenate(each), LOW_PERCENT) for each in _levels_and_shares(places, gains)]
        ends = [end for end, low in zip(ends, (lowest[0], usual_lit * lowest[1]), strict=True) if low > NEARLY * end]
    return ShadowFloor(max(ends), usual_lit, int(dark.size)) if ends else None


def _levels_and_shares(places: list[tuple[Floats, Floats]], gains: Floats) -> tuple[list[Floats], list[Floats]]:
    """Every level, and every share of the lit level."""
    levels = [(levels * gains[:, None]).ravel() for levels, _ in places]
    return levels, [(levels * gains[:, None] / usual).ravel() for levels, usual in places]


def _lower_end(values: Floats, percents: tuple[float, float, float]) -> float:
    """Where a distribution begins, from three of its percentiles."""
    low, middle, high = (float(each) for each in np.percentile(values, percents))
    bend = low + high - 2.0 * middle
    floor = (low * high - middle**2) / bend if bend > 0.0 else low - (high - low)
    return min(floor, low)


def _in_shadow(levels: Floats, usual: Floats, lights: Array) -> Mask:
    """(L, N) places that get far less than the brighter lights, but for the brightest ones, promise."""
    count = len(levels)
    top = count - (count // DROPPED if count > 4 else 0)  # noqa: PLR2004 - three lights are needed
    rank = np.argsort(np.argsort(levels, axis=0), axis=0)
    keep = (rank < top) & (rank >= top - max(3, min(count // 2, top))) & np.isfinite(levels)
    weight = keep.astype(np.float64)
    products = (lights[:, :, None] * lights[:, None, :]).reshape(count, 9)
    matrix = np.einsum("ln,lk->nk", weight, products).reshape(-1, 3, 3)
    right = np.einsum("ln,lk->nk", np.where(keep, levels, 0.0).astype(np.float64), lights)
    solved = np.abs(np.linalg.det(matrix)) > SOLVABLE
    matrix[~solved] = np.eye(3)
    promise = np.einsum("lk,nk->ln", lights, np.linalg.solve(matrix, right[..., None])[..., 0])
    cast = (levels < SHADOWED * promise) & (promise > FACES * usual)
    # What faces away from a lamp is promised less than nothing, and is as dark as a cast shadow.
    away = promise < -AWAY * usual
    shadowed: Mask = solved & ~keep & (cast | away) & (levels < usual)
    return shadowed


def check_ambient(capture: Capture, lights: Array, strengths: Array | float = 1.0) -> list[Finding]:
    """Find light common to all images."""
    found = shadow_floor(capture, lights, strengths)
    if found is None or found.floor < LEVELS / 255.0 or found.floor < AMBIENT * found.lit:
        return []
    share = found.floor / found.lit
    return [
        Finding(
            "ambient",
            "warning",
            f"the deepest shadows still have {100 * share:.0f} % of the light of the lit surface: ambient light, stray "
            "light, or a black level",
            "darken the room, or give an image with all lamps off as 'dark' in capture.toml (or black_level)",
            value=share,
            limit=AMBIENT,
            unit="of the light",
        )
    ]
