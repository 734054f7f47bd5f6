"""Whether the table of lights is the one that the images were taken under.

Three witnesses. *Photometry*: a matt pixel's values are linear in the lights, so what least squares leaves over is
small under the true table (only tables that are no linear map of the true one, such as two swapped lights, show here).
*Integrability*: slopes of a surface have no curl; a mirrored or turned table gives slopes that have (the linear maps
are told apart by this alone). *Saddles*: a mirrored table turns domes and hollows into saddles, which have no curl
either where they are shallow; no part is made of several saddles alone, but one may be a single saddle. All are
compared between tables tile by tile over the image, so that the error of the comparison comes from the images
themselves. A flat field says nothing.

References
----------
R. J. Woodham, Photometric method for determining surface orientation from multiple images, Opt. Eng. 19 (1980).
P. N. Belhumeur, D. J. Kriegman, A. L. Yuille, The bas-relief ambiguity, IJCV 35 (1999) 33-44.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bgars.checks.evidence import critical_t, paired_t
from bgars.checks.hypotheses import Hypothesis, alternatives, reordered
from bgars.checks.matt_fit import MIN_LIGHTS, STEEP, fit_normals, matt_lights
from bgars.checks.moments import lit_everywhere
from bgars.checks.reordered import TRIED, image_order
from bgars.checks.view import TILES, tile_sums

if TYPE_CHECKING:
    from bgars.checks.view import View

__all__ = ["Verdict", "judge_table"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

BETTER = 0.8
"""Ratio of misfits from which down on another table counts as better: a fifth of all that does not fit comes from the
given one. That it is no chance is for the test over tiles to say."""
OVER_NOISE = 3.0
"""Times the variance of noise up to which a misfit is noise: images of other brightness have as much more or less of
it, and a wrong table gives the noisy ones another weight."""
ONE_SHAPE = 0.5
"""Share of the variance of slopes that a single bowl, cap or saddle leaves beside a linear change, at most: slopes that
jump once leave a quarter, those of several bumps nearly all."""
TINY = 1e-9
TURNS = 3
"""Usual mistakes, one after the other, that make any turn or mirror of a ring."""
SUSPECTS = 3
"""Images that are tried as swapped, each with all others."""
MATT = 0.1
"""Misfit, of the mean, of a pixel that counts half: a tenth is what highlights and light from neighbours leave."""
MIN_PIXELS = 60
MOST_PIXELS = 2000
"""Pixels of strongest relief on which every table is tried."""
NOISE_CURL = 3.0
"""Changes of slope smaller than so many times the usual one (of the flattest half) count less and less."""
LINEAR = 0.1
"""Largest distance of two tables, of unit vectors, that count as linear maps of each other: 6 degrees, the largest
error of some tens of directions that are good to one or two."""


class Verdict(NamedTuple):
    """The better table, where there is one, and how sure that is."""

    better: Hypothesis | None
    t: float
    tiles: float
    losses: tuple[float, float]
    """Of the given table: photometric (relative variance), curl (share of the change of slope)."""
    only_saddles: bool = False
    """Whether nothing speaks for the better table but that the part is one saddle under the given one."""


@dataclass(frozen=True, eq=False)
class _Evidence:
    """What every table is judged on."""

    normal: Array
    """(3, h, w) under the given table."""
    solved: Mask
    values: Array
    """(L, N) of the pixels of strongest relief."""
    keep: Mask
    trust: Array
    """(h, w) weight of a pixel: small where light is far from matt."""
    number: NDArray[np.intp]
    """(N,) their tiles."""
    tiles: NDArray[np.intp]
    floor: float
    """Photometric misfit up to which noise explains it, summed over these pixels."""


@dataclass(frozen=True, eq=False)
class _Losses:
    """Misfits of one table by tile, and how many witnesses each tile holds."""

    photometric: Array
    curl: Array
    saddle: Array
    floor: float
    """Photometric misfit, in all, that says nothing."""


def judge_table(view: View) -> Verdict:
    """Compare the given table with the usual mistakes, and with any other order of the lights.

    Parameters
    ----------
    view : View

    Returns
    -------
    Verdict
    """
    usual = _judge_usual(view)
    again = view if usual.better is None else view.with_lights(usual.better.lights)
    order = image_order(again)
    if order is None:
        return usual
    # Right up to a turn or a mirror of the whole table, which the usual mistakes tell apart.
    table = again.lights[order]
    for _ in range(TURNS):
        turned = _judge_usual(view.with_lights(table)).better
        if turned is None:
            break
        table = turned.lights
    return _judge_order(view, table, usual)


def _judge_order(view: View, table: Array, usual: Verdict) -> Verdict:
    """Compare the given order of the lights with any other, which is believed where photometry is sure of it."""
    evidence = _evidence(view)
    if evidence is None:
        return usual
    given, other = _losses(evidence, view.lights, view.lights), _losses(evidence, view.lights, table)
    weight = given.photometric + other.photometric
    there = weight > 0.0
    ratio = float(other.photometric.sum() / max(given.photometric.sum(), TINY))
    t, count = paired_t((given.photometric - other.photometric)[there] / weight[there], weight[there])
    if ratio >= BETTER or t < critical_t(count, TRIED) or given.photometric.sum() <= given.floor:
        return usual
    return Verdict(reordered(view.lights, view.names, table), t, count, usual.losses)


def _judge_usual(view: View) -> Verdict:
    """Compare the given table with the usual mistakes."""
    evidence = _evidence(view)
    if evidence is None:
        return Verdict(None, 0.0, 0.0, (0.0, 0.0))
    given = _losses(evidence, view.lights, view.lights)
    sizes = (float(given.photometric.sum()), float(given.curl.sum()))
    others = alternatives(view.lights, view.names, _suspects(evidence, view.lights))
    tried = [(other, _losses(evidence, view.lights, other.lights)) for other in others]
    scores = [_score(given, losses) for _, losses in tried]
    best = int(np.argmax(scores)) if scores else -1
    if best < 0 or scores[best] <= 0.0:
        return Verdict(None, 0.0, 0.0, sizes)
    t, count, accepted, only_saddles = _compare(given, tried[best][1], len(others))
    only_saddles = only_saddles and _is_one_shape(evidence)
    return Verdict(others[best] if accepted else None, t, count, sizes, only_saddles)


def _evidence(view: View) -> _Evidence | None:
    if len(view.lights) < MIN_LIGHTS:
        return None
    keep = matt_lights(view)
    count, rows, cols = view.values.shape
    values = view.values.reshape(count, -1).astype(np.float64)
    fit = fit_normals(values, keep.reshape(count, -1), view.lights)
    solved = fit.solved & (fit.normal[2] > 0.0)
    if int(solved.sum()) < MIN_PIXELS:
        return None
    misfit = (fit.left**2).sum(axis=0) / np.maximum(keep.reshape(count, -1).sum(axis=0) - 3.0, 1.0)
    trust = 1.0 / (1.0 + misfit / MATT**2)
    spread = np.where(solved, values.std(axis=0) / np.maximum(values.mean(axis=0), 1e-9), -1.0)
    most = min(MOST_PIXELS, int(solved.sum()))
    chosen = np.argpartition(spread, -most)[-most:]
    tiles = view.tiles
    return _Evidence(
        fit.normal.reshape(3, rows, cols),
        solved.reshape(rows, cols),
        values[:, chosen],
        keep.reshape(count, -1)[:, chosen],
        trust.reshape(rows, cols),
        tiles.ravel()[chosen],
        tiles,
        OVER_NOISE * _noise(view) * float(np.maximum(keep.reshape(count, -1)[:, chosen].sum(axis=0) - 3.0, 1.0).sum()),
    )


def _noise(view: View) -> float:
    """Relative variance of noise: what three dimensions leave over of matt pixels, whatever the table."""
    lit = lit_everywhere(view, view.lights, matt=False)
    if int(lit.sum()) < MIN_PIXELS:
        return 0.0
    values = view.values[:, lit].astype(np.float64)
    values = values[:, :: max(values.shape[1] // MOST_PIXELS, 1)]
    left: Array = np.linalg.svd(values / np.maximum(values.mean(axis=0), 1e-9), full_matrices=False)[1][3:]
    return float(np.square(left).sum() / (len(left) * len(values[0])))


def _suspects(evidence: _Evidence, lights: Array) -> list[int]:
    """Images that fit their lights worst, each predicted by the others: the pairs that may be swapped."""
    left = _varying(fit_normals(evidence.values, evidence.keep, lights).left, evidence.keep)
    leverage = np.einsum("li,il->l", lights, np.linalg.pinv(lights))
    size = np.abs(left).sum(axis=1) / np.maximum(evidence.keep.sum(axis=1), 1) / np.maximum(1.0 - leverage, 0.1)
    return [int(index) for index in np.argsort(size)[::-1][:SUSPECTS]]


def _varying(left: Array, keep: Mask) -> Array:
    """What is left over without what all pixels have in common: a flat field, or a lamp's strength, says nothing."""
    common = left.sum(axis=1) / np.maximum(keep.sum(axis=1), 1)
    varying: Array = (left - common[:, None]) * keep
    return varying


def _losses(evidence: _Evidence, given: Array, lights: Array) -> _Losses:
    """Misfits of one table; slopes of a linear map of the given table follow from its slopes."""
    linear = np.linalg.pinv(given) @ lights
    tilted = np.abs(given @ linear - lights).max() < LINEAR
    table = given if tilted else lights
    left = _varying(fit_normals(evidence.values, evidence.keep, table).left, evidence.keep)
    misfit = np.minimum((left**2).sum(axis=0), 1.0)
    count = TILES * TILES
    photometric = np.asarray(np.bincount(evidence.number, weights=misfit, minlength=count), np.float64)
    if not tilted or abs(np.linalg.det(linear)) < 0.2:  # noqa: PLR2004 - no map of one space onto another
        unknown = np.full(count, np.nan)
        return _Losses(photometric, unknown, unknown, evidence.floor)
    normal = np.einsum("ij,j...->i...", np.linalg.inv(linear), evidence.normal)
    return _Losses(photometric, *_bending(normal, evidence), evidence.floor)


def _bending(normal: Array, evidence: _Evidence) -> tuple[Array, Array]:
    """(T,) curl and saddles, each over the squared change of slope, summed over cells of four pixels."""
    solved, tiles = evidence.solved, evidence.tiles
    steep = np.maximum(normal[2], 1e-3 * np.sqrt((normal**2).sum(axis=0)) + 1e-12)
    p, q = (np.clip(-part / steep, -STEEP, STEEP) for part in normal[:2])
    cell = solved[1:, 1:] & solved[1:, :-1] & solved[:-1, 1:] & solved[:-1, :-1]
    # Rows grow downwards, y upwards.
    p_x, p_y = _right(p), -_down(p)
    q_x, q_y = _right(q), -_down(q)
    change = p_x**2 + p_y**2 + q_x**2 + q_y**2
    usual = float(np.percentile(change[cell], 25.0)) if cell.any() else 0.0
    trust = evidence.trust
    weight = np.minimum(np.minimum(trust[1:, 1:], trust[1:, :-1]), np.minimum(trust[:-1, 1:], trust[:-1, :-1]))
    weight = weight / (change + NOISE_CURL**2 * usual + 1e-12)
    curl = tile_sums(tiles[1:, 1:], (p_y - q_x) ** 2 * weight, cell)
    saddle = tile_sums(tiles[1:, 1:], np.maximum(p_y * q_x - p_x * q_y, 0.0) * weight, cell)
    return curl, saddle


def _is_one_shape(evidence: _Evidence) -> bool:
    """Whether slopes change one way over the image, as those of a single saddle do; those of bumps go to and fro."""
    rows, cols = np.nonzero(evidence.solved)
    place = np.column_stack([np.ones(len(rows)), rows, cols])
    normal = evidence.normal[:, evidence.solved]
    slopes = np.clip(-normal[:2] / np.maximum(normal[2], 1e-12), -STEEP, STEEP).T
    slopes = slopes - slopes.mean(axis=0)
    left = slopes - place @ np.linalg.lstsq(place, slopes, rcond=None)[0]
    return bool(np.square(left).sum() < ONE_SHAPE * np.square(slopes).sum())


def _right(values: Array) -> Array:
    step = values[:, 1:] - values[:, :-1]
    return 0.5 * (step[1:] + step[:-1])


def _down(values: Array) -> Array:
    step = values[1:] - values[:-1]
    return 0.5 * (step[:, 1:] + step[:, :-1])


def _score(given: _Losses, other: _Losses) -> float:
    """Log of the ratio of misfits, of all witnesses together: their likelihood ratio with unknown variances."""
    pairs = [(given.photometric, other.photometric)]
    if np.isfinite(other.curl).all():
        pairs += [(given.curl, other.curl), (given.saddle, other.saddle)]
    return sum(float(np.log((one.sum() + TINY) / (two.sum() + TINY))) for one, two in pairs)


def _compare(given: _Losses, other: _Losses, tests: int) -> tuple[float, float, bool, bool]:
    """Student's t of the witness that speaks most clearly, its tiles, whether the other table is the better one.

    Last, whether saddles alone say so.
    """
    best_t, best_count, accepted, proved, refused = 0.0, 0.0, False, False, False
    witnesses = ((given.photometric, other.photometric), (given.curl, other.curl), (given.saddle, other.saddle))
    for one, two in witnesses:
        if not np.isfinite(two).all():
            continue
        weight = one + two
        there = weight > 0.0
        if not there.any():
            continue
        ratio = float(two.sum() / max(one.sum(), TINY))
        t, count = paired_t((one - two)[there] / weight[there], weight[there])
        if one is given.photometric and one.sum() <= given.floor:
            continue
        speaks = ratio < BETTER and t > critical_t(count, tests)
        accepted |= speaks
        proved |= speaks and one is not given.saddle
        refused |= one is not given.saddle and t < -critical_t(count)
        if t > best_t:
            best_t, best_count = t, count
    return best_t, best_count, accepted and not refused, not proved
