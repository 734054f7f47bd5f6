"""Frames that were caught between two lights: rolling shutters, late triggers, lamps that switched on too late."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bgars.checks.matt_fit import MIN_LIGHTS, promised
from bgars.checks.row_levels import CLEAR_STEP, clear_step
from bgars.records.findings import Finding
from bgars.records.light_median import light_median

if TYPE_CHECKING:
    from bgars.checks.row_levels import RowStep
    from bgars.checks.view import View

__all__ = ["check_half_lit"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

STEP = 0.2
"""Step of brightness along the rows, natural logarithm, that is told: light on either side of it may be off its promise
by a tenth, which highlights and light from neighbours leave (`geometry.MATT`)."""
BESIDE = 4
"""Rows of the small copy on either side of a step."""
STANDS_OUT = 8.0
"""Robust standard deviations of such steps over all rows of all images: shading and texture make them, too."""
OF_OTHERS = 1.5
"""Times the largest step of the other images at the same place: edges and highlights of a part are in several, and what
one image lacks is missing in the promise of the others, but by a share of it."""
TRIED = 20
"""Places of an image, of the largest steps, that are looked at."""
LASTS = 0.6
"""Share of a step that is left between all rows above and all below."""
AGREEING = 0.7
"""Share of the columns in which a step of the shutter must be seen for itself: it runs straight across the image."""
LIT = 0.4
"""Of a pixel's usual light, from which on it is lit: shadows show no light that could change."""
SEEN = 0.3
"""Share of the most columns that tell of any row, from which on a row is judged."""
BANDS = 24
MIN_BANDS = 4
"""Bands, of `BANDS`, that must show another light, and that must not."""
SAME_LIGHT = 0.06
"""Share of the usual difference between neighbouring lights (variance) that noise leaves under one light."""
DIFFERS = 0.3
"""Share of the same by which either image must differ from its other neighbour."""
OF_PROMISE = 0.2
"""Share of the promised difference to its neighbour (variance) that is left of an image under the neighbour's light;
noise alone, of image and promise, leaves a half and more."""
DEEP = 1.0
"""Natural logarithm of a step beyond which light from neighbours says how deep it is. Chosen on a few captures: what
highlights made was less deep."""
END = 0.1
"""Share of the rows, at either end, where a single step is not believed: shadows of the last rim lie there, and a frame
that lacks less than a tenth is nearly whole."""
SHADED = 0.03
"""Relative standard deviation by which the lights shade a band that tells them apart."""
BRIGHT = 3.0
"""Of the pixel's mean: highlights beyond do not outweigh all else."""
WORDS = (
    "check trigger, exposure time and the delay between lamps (global shutter, or lamps on before the exposure starts)"
)


class Step(NamedTuple):
    """A step of brightness in an image: its size (natural logarithm), where it is, how far it stands out."""

    size: float
    place: float
    score: float


def check_half_lit(view: View) -> list[Finding]:
    """Find frames with a step along rows or columns, or with rows that belong to the image before or after."""
    ratio = _of_promised(view) if len(view.lights) > MIN_LIGHTS else None
    axes = () if ratio is None else ((ratio, view.use, "row"), (ratio.transpose(0, 2, 1), view.use.T, "column"))
    for along, use, word in axes:
        steps = _steps(along, use)
        index = int(np.argmax([abs(step.size) * (step.score > STANDS_OUT) for step in steps])) if steps else 0
        told = steps and abs(steps[index].size) >= STEP and steps[index].score >= STANDS_OUT
        if told and _stays(view, index, steps[index], word):
            return [_partly_lit(view, index, steps[index], word, STEP)]
    late = _late(view)
    for along, use, word in () if late else axes:
        clear = clear_step(along, use)
        if clear is not None:
            return [_partly_lit(view, *clear, word, CLEAR_STEP)]
    return late


def _stays(view: View, index: int, step: Step, word: str) -> bool:
    """Whether a step is left whichever other image is not asked: a highlight in one promises the others too much."""
    least = LASTS * min(abs(step.size), DEEP)
    for other in range(len(view.lights)):
        if other == index:
            continue
        ratio = _of_promised(view.without(other))[index - (other < index)]
        along = np.where(view.use, ratio, np.nan)
        along = along if word == "row" else along.T
        place = round(step.place * len(along))
        # The rows beside its place hold some of both.
        before = along[max(place - 2 * BESIDE, 0) : max(place - BESIDE // 2, 1)]
        after = along[place + BESIDE // 2 : place + 2 * BESIDE]
        change = np.log(np.maximum(_known_mean(after, 0), 1e-3) / np.maximum(_known_mean(before, 0), 1e-3))
        told = np.isfinite(change)
        if told.any() and float(np.median(change[told])) * np.sign(step.size) < least:
            return False
    return True


def _partly_lit(view: View, index: int, step: Step | RowStep, word: str, least: float) -> Finding:
    share = 1.0 - float(np.exp(-abs(step.size)))
    return Finding(
        "half-lit",
        "error" if share > 0.3 else "warning",  # noqa: PLR2004 - most of the light
        f"{view.names[index]} is partly lit: at {100 * step.place:.0f} % of its {word}s its light changes by "
        f"{100 * share:.0f} %, which the other images do not show",
        WORDS,
        image=index,
        value=share,
        limit=1.0 - float(np.exp(-least)),
        unit="of the light",
    )


def _of_promised(view: View) -> Array:
    """(L, h, w) light over what the other images promise; NaN where that is little.

    Shading and shadows on the side away from the light are in the promise: what steps there is no shutter.
    """
    promise = promised(view)
    usual = light_median(view.values)
    return np.where(promise > LIT * usual, view.values / np.maximum(promise, 1e-6), np.nan)


def _steps(ratio: Array, use: Mask) -> list[Step]:
    """The largest step of each image between its rows."""
    ratio, use = _pooled(ratio, use)
    rows, length = np.flatnonzero(use.any(axis=1)), len(use)
    if len(rows) < 4 * BESIDE:
        return []
    ratio, use = ratio[:, rows[0] : rows[-1] + 1], use[rows[0] : rows[-1] + 1]
    count = len(use)
    if count < 4 * BESIDE:
        return []
    change = _sharp(_changes(ratio, use))
    jump = np.array([_medians(each) for each in change])
    known = np.isfinite(jump).any(axis=0)
    if known.mean() < 0.5:  # noqa: PLR2004 - most rows are empty
        return []
    spread = 1.4826 * float(np.nanmedian(np.abs(jump - np.nanmedian(jump))))
    there = _there(use)
    steps = []
    for index, own in enumerate(jump):
        others = np.abs(np.delete(jump, index, axis=0))
        largest = np.nan_to_num(others).max(axis=0)
        found = Step(0.0, 0.0, 0.0)
        sizes = np.nan_to_num(np.abs(own))
        clear = (sizes >= max(STEP, STANDS_OUT * spread)) & (sizes > OF_OTHERS * largest)
        clear &= np.abs((np.arange(len(clear)) + BESIDE) / count - 0.5) < 0.5 - END
        # Of the clearest first: shading and shadows make steps, too, which do not run through or do not last.
        for place in np.flatnonzero(clear)[np.argsort(-sizes[clear])][:TRIED]:
            size = float(own[place])
            agree = change[index, place] / size
            told = np.isfinite(agree)
            agreeing = float(((agree > 0.5) & (agree < 2.0)).sum() / told.sum()) * there[place]  # noqa: PLR2004 - a factor of two
            overall = _overall(ratio[index], use, int(place) + BESIDE)
            if agreeing >= AGREEING and abs(overall) >= LASTS * abs(size) and overall * size > 0:
                where = float(rows[0] + place + BESIDE) / length
                found = Step(size, where, abs(size) / max(spread, 1e-4))
                break
        steps.append(found)
    return steps


def _there(use: Mask) -> Array:
    """(places,) share of the columns that the part has which it has on both sides of each place."""
    whole = np.array([use[at : at + 2 * BESIDE].all(axis=0).sum() for at in range(len(use) - 2 * BESIDE + 1)])
    share: Array = whole / max(int(use.any(axis=0).sum()), 1)
    return share


def _pooled(ratio: Array, use: Mask) -> tuple[Array, Mask]:
    """Means over `BESIDE` columns, which noise less, where half of them tell."""
    wide = use.shape[1] // BESIDE * BESIDE
    blocks = use[:, :wide].reshape(len(use), -1, BESIDE).all(axis=2)
    return _known_mean(ratio[:, :, :wide].reshape(len(ratio), len(use), -1, BESIDE), 3), np.asarray(blocks)


def _known_mean(values: Array, axis: int) -> Array:
    """Mean over an axis of what is known; NaN where less than half is."""
    known = np.isfinite(values)
    count = known.sum(axis=axis)
    total = np.where(known, values, 0.0).sum(axis=axis)
    mean: Array = np.where(2 * count >= values.shape[axis], total / np.maximum(count, 1), np.nan)
    return mean


def _changes(ratio: Array, use: Mask) -> Array:
    """(L, places, columns) logarithm of what follows on each place over what is before it, NaN where nothing is lit.

    Each column is compared with itself: a step of the shutter runs through all, edges of shadows through a few.
    """
    before, after = (_means(np.where(use, ratio, np.nan), part) for part in (slice(None, -BESIDE), slice(BESIDE, None)))
    lit = np.maximum(before, after) > LIT
    change: Array = np.where(lit, np.log(np.maximum(after, 1e-3) / np.maximum(before, 1e-3)), np.nan)
    return change


def _sharp(change: Array) -> Array:
    """What of a change is abrupt: without what goes on before and after it, as shading of a curved surface does."""
    apart = 2 * BESIDE
    beside = np.full((2, *change.shape), np.nan)
    beside[0, :, apart:] = change[:, :-apart]
    beside[1, :, :-apart] = change[:, apart:]
    known = np.isfinite(beside)
    trend = np.where(known, beside, 0.0).sum(axis=0) / np.where(known.any(axis=0), known.sum(axis=0), np.nan)
    sharp: Array = change - trend
    return sharp


def _means(values: Array, part: slice) -> Array:
    """Means of `BESIDE` rows from each row on."""
    windows = np.lib.stride_tricks.sliding_window_view(values, BESIDE, axis=1)
    return _known_mean(windows, 3)[:, part]


def _medians(change: Array) -> Array:
    """(places,) median over the columns, NaN where few of them tell."""
    told = np.isfinite(change)
    enough = told.sum(axis=1) >= max(SEEN * told.sum(axis=1).max(initial=0), 4)
    medians = np.full(len(change), np.nan)
    if enough.any():
        medians[enough] = np.nanmedian(change[enough], axis=1)
    return medians


def _overall(ratio: Array, use: Mask, place: int) -> float:
    """What is left of a step between all rows above and all below; median over the columns."""
    sides = []
    for part in (slice(None, place), slice(place, None)):
        told = use[part] & np.isfinite(ratio[part])
        total = np.where(told, ratio[part], 0.0).sum(axis=0)
        sides.append(np.where(told.any(axis=0), total / np.maximum(told.sum(axis=0), 1), np.nan))
    above, below = sides
    lit = np.maximum(above, below) > LIT
    return float(np.median(np.log(np.maximum(below[lit], 1e-3) / np.maximum(above[lit], 1e-3)))) if lit.any() else 0.0


def _late(view: View) -> list[Finding]:
    """Find a frame whose upper or lower rows show a neighbour's light instead of their own.

    There the two images differ by noise only, while images under other lights differ by shading and shadows; elsewhere
    they differ as all do.
    """
    use = view.use & ~view.clipped.any(axis=0)
    if use.sum() < BANDS * BANDS:
        return []
    count = len(view.values)
    values = np.minimum(view.values / np.maximum(view.mean, np.float32(1e-6)), np.float32(BRIGHT))[:, use]
    rows = view.values.shape[1]
    bands = np.broadcast_to((np.arange(rows) * BANDS // rows)[:, None], use.shape)
    band, promise = bands[use], promised(view)

    def product(first: int, second: int) -> Array:
        return np.asarray(
            np.bincount(band, weights=(values[first] * values[second]).astype(np.float64), minlength=BANDS), np.float64
        )

    own = [np.maximum(product(index, index), 1e-9) for index in range(count)]

    def differences(first: int, second: int) -> Array:
        """Relative variance of the difference in each band, whatever the two lamps' strengths."""
        left: Array = 1.0 - product(first, second) ** 2 / (own[first] * own[second])
        return left

    pairs = {(index, (index + 1) % count): differences(index, (index + 1) % count) for index in range(count)}
    usual = np.median(list(pairs.values()), axis=0)
    best: tuple[int, int, int] | None = None
    for (first, second), differs in pairs.items():
        # Both images must differ from the next ones there: level ground that both lamps reach looks the same anyway.
        before, after = pairs[(first - 1) % count, first], pairs[second, (second + 1) % count]
        shaded = (usual > SHADED**2) & (np.minimum(before, after) > DIFFERS * usual)
        same = differs < SAME_LIGHT * usual
        # Bands without shading, such as a bare margin, speak for neither.
        for length in (_run(same | ~shaded), -_run((same | ~shaded)[::-1])):
            inside = np.arange(BANDS) < length if length > 0 else np.arange(BANDS) >= BANDS + length
            told, rest = shaded & inside, shaded & ~inside
            if told.sum() < MIN_BANDS or rest.sum() < MIN_BANDS or same[rest].mean() > 1.0 - AGREEING:
                continue
            # Shutters run down the rows: rows read late see the next lamp, rows read early the one before.
            image, neighbour = (second, first) if length > 0 else (first, second)
            if (best is None or abs(length) > abs(best[2])) and _unlike_promise(
                view, promise[image], (image, neighbour), use & np.isin(bands, np.flatnonzero(told))
            ):
                best = (image, neighbour, length)
    if best is None:
        return []
    image, neighbour, length = best
    share = abs(length) / BANDS
    return [
        Finding(
            "half-lit",
            "error",
            f"{100 * share:.0f} % of the rows of {view.names[image]} show the light of {view.names[neighbour]}",
            WORDS,
            image=image,
            value=share,
            limit=MIN_BANDS / BANDS,
            unit="of the rows",
        )
    ]


def _unlike_promise(view: View, promise: Array, pair: tuple[int, int], there: Mask) -> bool:
    """Whether an image is nearer to a neighbour than its own light promises: on smooth parts two lights may look alike.

    `promise`: (h, w) what the other images promise the first of the pair. `there`: where it is like the second.
    """
    middle = light_median(view.values)
    there = there & np.isfinite(promise) & (promise > LIT * middle)
    if int(there.sum()) < BANDS:
        return False
    own, other = (view.values[index][there] / middle[there] for index in pair)
    promised_one = promise[there] / middle[there]
    seen, wanted = (
        1.0 - float(each @ other) ** 2 / float(each @ each * (other @ other)) for each in (own, promised_one)
    )
    return seen < OF_PROMISE * wanted


def _run(same: Mask) -> int:
    """Length of the run of True that a row of bands begins with."""
    return len(same) if same.all() else int(np.argmin(same))
