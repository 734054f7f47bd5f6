"""One image turned or mirrored against the others, by the edges that they share (as in bgars.checks.shifts)."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bgars.checks.evidence import critical_t, paired_t
from bgars.checks.matt_fit import MIN_LIGHTS, promised
from bgars.checks.odd_image import QUARTERS, TURNS, matt
from bgars.checks.shifts import edge_products
from bgars.records.findings import Finding
from bgars.records.light_median import light_median

if TYPE_CHECKING:
    from collections.abc import Callable

    from bgars.checks.view import View

__all__ = ["check_orientation"]

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

AS_OTHERS = 0.8
"""An image turned back must correlate with the others so well, of how well these do among each other."""
AS_IT_IS = 0.5
"""Most that it may correlate as it is, of the same: parts that look the same after a turn prove nothing, and an edge
that moved by its own width still correlates by more than half."""
CLOSER = 0.8
"""Of the misfit to the promise of the others: a fifth of it must come from the turn (as `geometry.BETTER`)."""
MIN_PIXELS = 100
"""Of which something is promised: fewer are no evidence."""
PASSES = 2
TILES = 6
"""Tiles along each axis, whose scatter says how certain the better fit is."""
FEWEST_PX = 30
"""Rows and columns that are needed: a handful of pixels correlates by chance."""
REACH_PX = 2
"""Pixels of the small copy by which a part may have moved: what moved is not turned."""
OTHER_SIGN = np.array([1.0, -1.0, 1.0], dtype=np.float32)[:, None, None, None]
"""What a mirror or a quarter turn does to the products xx, xy and yy of a gradient, beside where they lie."""


def check_orientation(view: View) -> list[Finding]:
    """Find an image that fits the others only after a turn or a mirror."""
    if min(view.use.shape) < FEWEST_PX:
        return []
    edges = edge_products(view.values, PASSES)
    edges -= edges.mean(axis=(-2, -1), keepdims=True)
    turns = _turns(square=edges.shape[2] == edges.shape[3])
    turned = {name: turn(edges) for name, turn in turns}
    use = view.use[PASSES:-PASSES, PASSES:-PASSES]
    good = np.ones(len(view.values), dtype=bool)
    asked = good.copy()
    found = []
    # One that is turned upsets the comparison of the others: the clearest is told, and left out.
    while (worst := _worst(edges, turned, use, good, asked)) is not None:
        index, name, value, limit = worst
        asked[index] = False
        if not _explained(view, good, index, name):
            continue
        good[index] = False
        found.append(
            Finding(
                "orientation",
                "error",
                f"{view.names[index]} is {name} against the other images",
                "turn it back; look for orientation tags that only some of the files carry",
                image=index,
                value=value,
                limit=limit,
                unit="correlation",
            )
        )
        if len(found) > len(good) // 2:
            return []
    return found


def _explained(view: View, good: Mask, index: int, name: str) -> bool:
    """Whether an image turned back is nearer to what the others promise; three promise nothing.

    Shading makes edges, too: a smooth cap under two lights on either side is its own mirror image.
    """
    kept = np.flatnonzero(good)
    if len(kept) < MIN_LIGHTS:
        return True
    known = replace(
        view, values=view.values[kept], clipped=view.clipped[kept], lights=view.lights[kept], names=view.names
    )
    promise = promised(known)[np.searchsorted(kept, index)]
    image, middle = view.values[index], np.maximum(light_median(known.values), np.float32(1e-6))
    back = dict(TURNS + QUARTERS)[name](image)
    told = np.isfinite(promise) & view.use & matt(image, middle) & matt(back, middle)
    if int(told.sum()) < MIN_PIXELS:
        return False
    before, after = (np.minimum(np.square((each - promise) / middle), 1.0)[told].sum() for each in (image, back))
    return bool(after < CLOSER * before)


def _worst(
    edges: Floats, turned: dict[str, Floats], use: Mask, good: Mask, asked: Mask
) -> tuple[int, str, float, float] | None:
    """The image that gains most by a turn, of those that are certain: which, how, its correlation, and the limit."""
    others = (edges[:, good].sum(axis=1, keepdims=True) - edges) * use
    plain = (edges * others).sum(axis=0)
    scale = np.sqrt(np.square(edges).sum(axis=(0, 2, 3)) * np.square(others).sum(axis=(0, 2, 3)))
    fits = {name: (each * others).sum(axis=0) for name, each in turned.items()}
    as_it_is = plain.sum(axis=(1, 2)) / np.maximum(scale, 1e-12)
    tiles = _tiles(plain.shape[1:])
    certain = []
    for index in np.flatnonzero(asked):
        after = {name: float(fit[index].sum() / max(scale[index], 1e-12)) for name, fit in fits.items()}
        best = max(after, key=after.__getitem__)
        usual = float(np.median(as_it_is[good & (np.arange(len(good)) != index)]))
        if not (after[best] > AS_OTHERS * usual and as_it_is[index] < AS_IT_IS * usual):
            continue
        if _shifted(edges[:, index], others[:, index]) > after[best] * scale[index]:
            continue
        gain = np.bincount(tiles, weights=(fits[best][index] - plain[index]).ravel(), minlength=TILES * TILES)
        t, witnesses = paired_t(gain.astype(np.float64), np.ones(TILES * TILES))
        if t > critical_t(witnesses, len(plain) * len(fits)):
            certain.append((after[best] - as_it_is[index], int(index), best, after[best], AS_OTHERS * usual))
    return max(certain)[1:] if certain else None


def _shifted(own: Floats, others: Floats) -> float:
    """The best fit of an image that is not turned but lies elsewhere."""
    reach = range(-REACH_PX, REACH_PX + 1)
    return max(float((np.roll(own, (down, right), axis=(1, 2)) * others).sum()) for down in reach for right in reach)


def _turns(*, square: bool) -> list[tuple[str, Callable[[Floats], Floats]]]:
    """What may have happened to an image, and what undoes it."""
    turns: list[tuple[str, Callable[[Floats], Floats]]] = [
        ("turned by 180 degrees", lambda edges: edges[..., ::-1, ::-1]),
        ("mirrored left to right", lambda edges: edges[..., ::-1] * OTHER_SIGN),
        ("mirrored top to bottom", lambda edges: edges[..., ::-1, :] * OTHER_SIGN),
    ]
    if square:
        turns += [
            ("turned by 90 degrees counter-clockwise", lambda edges: _quarter(edges, -1)),
            ("turned by 90 degrees clockwise", lambda edges: _quarter(edges, 1)),
        ]
    return turns


def _quarter(edges: Floats, quarters: int) -> Floats:
    turned: Floats = np.rot90(edges, quarters, axes=(2, 3))[::-1] * OTHER_SIGN
    return turned


def _tiles(shape: tuple[int, ...]) -> NDArray[np.intp]:
    """Number of the tile of each pixel."""
    rows, cols = shape
    numbers: NDArray[np.intp] = (
        (np.arange(rows) * TILES // rows)[:, None] * TILES + (np.arange(cols) * TILES // cols)[None, :]
    ).ravel()
    return numbers
