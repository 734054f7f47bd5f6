"""Frames that were caught between two lights: rolling shutters, late triggers, lamps that switched on too late."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bgars.check.evidence import critical_t
from bgars.check.moments import loo_weights, moments_by
from bgars.check.records import Finding

if TYPE_CHECKING:
    from bgars.check.view import View

__all__ = ["check_half_lit"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

STEP = 0.08
"""Step of brightness along the rows, natural logarithm, that is told."""
BESIDE = 4
"""Rows of the small copy on either side of a step."""
STANDS_OUT = 8.0
"""Robust standard deviations of such steps over all rows of all images: shading and texture make them, too."""
LASTS = 0.6
"""Share of a step that is left between all rows above and all below."""
AGREEING = 0.7
"""Share of the columns in which a step of the shutter must be seen for itself: it runs straight across the image."""
BANDS = 24
MIXED = 0.3
"""Share of a neighbouring image in part of a frame that is told: it turns the light there by over 10 degrees."""
CLEARER = 2.0
"""How much more clearly it must be seen than in any image that is no neighbour: no surface is matt to the last."""
WORDS = (
    "check trigger, exposure time and the delay between lamps (global shutter, or lamps on before the exposure starts)"
)


class _Mixture(NamedTuple):
    """How much of a neighbour's light an image shows beyond a row, how clearly, from which row on, and before it."""

    image: int
    neighbour: int
    share: float
    t: float
    place: float
    before: float


class Step(NamedTuple):
    """A step of brightness in an image: its size (natural logarithm), where it is, how far it stands out."""

    size: float
    place: float
    score: float


def check_half_lit(view: View, lit: Mask, lights: Array) -> list[Finding]:
    """Find frames with a step along rows or columns, or mixed with the image before or after."""
    found = []
    for axis, word in ((1, "row"), (2, "column")):
        steps = _steps(view, axis)
        if not steps:
            continue
        index = int(np.argmax([abs(step.size) * (step.score > STANDS_OUT) for step in steps]))
        step = steps[index]
        if abs(step.size) < STEP or step.score < STANDS_OUT:
            continue
        share = 1.0 - float(np.exp(-abs(step.size)))
        found.append(
            Finding(
                "half-lit",
                "error" if share > 0.3 else "warning",  # noqa: PLR2004 - most of the light
                f"{view.names[index]} is lit in part: at {step.place:.0%} of its {word}s its light changes by "
                f"{share:.0%}, which the other images do not show",
                WORDS,
                image=index,
                value=share,
                limit=1.0 - float(np.exp(-STEP)),
                unit="of the light",
            )
        )
        return found
    return _mixed(view, lit, lights)


def _steps(view: View, axis: int) -> list[Step]:
    """The largest step of each image along rows (axis 1) or columns (axis 2)."""
    usual = np.median(view.values, axis=0)
    ratio = view.values / np.maximum(usual, np.float32(1e-6))
    profiles = np.array([_profile(image, view.use, axis) for image in ratio])
    if profiles.shape[1] < 4 * BESIDE or np.isnan(profiles).mean() > 0.5:  # noqa: PLR2004 - most rows are empty
        return []
    profiles = np.log(np.maximum(profiles, 1e-3))
    profiles = profiles - np.nanmedian(profiles, axis=1, keepdims=True)
    known = np.isfinite(profiles).all(axis=0)
    profiles = profiles[:, known]
    count = profiles.shape[1]
    if count < 4 * BESIDE:
        return []
    jump = _jumps(profiles, 1)
    at = np.arange(BESIDE, count - BESIDE + 1)
    spread = 1.4826 * np.median(np.abs(jump - np.median(jump)))
    steps = []
    for index in range(len(profiles)):
        best = int(np.argmax(np.abs(jump[index])))
        size, place = float(jump[index, best]), int(at[best])
        overall = float(np.median(profiles[index, place:]) - np.median(profiles[index, :place]))
        lasting = abs(overall) >= LASTS * abs(size) and overall * size > 0
        score = abs(size) / max(float(spread), 1e-4)
        if not lasting or score < STANDS_OUT or _agreeing(ratio[index], view.use, axis, known, place, size) < AGREEING:
            score = 0.0
        steps.append(Step(size, place / count, score))
    return steps


def _jumps(profiles: Array, axis: int) -> Array:
    """Means of `BESIDE` values after each place, less those of as many before it."""
    padded = np.cumsum(np.insert(profiles, 0, 0.0, axis=axis), axis=axis)
    count = profiles.shape[axis]
    at = np.arange(BESIDE, count - BESIDE + 1)
    after, here, before = (np.take(padded, at + offset, axis=axis) for offset in (BESIDE, 0, -BESIDE))
    difference: Array = (after - 2.0 * here + before) / BESIDE
    return difference


def _agreeing(ratio: NDArray[np.float32], use: Mask, axis: int, known: Mask, place: int, size: float) -> float:
    """Share of the columns (of an axis of rows) whose own step at one place is at least half, at most twice as large."""
    turned, used = (ratio, use) if axis == 1 else (ratio.T, use.T)
    turned, used = turned[known], used[known]
    rows = slice(place - BESIDE, place + BESIDE)
    whole = used[rows].all(axis=0)
    if whole.sum() < 2 * BESIDE:
        return 0.0
    logs = np.log(np.maximum(turned[rows][:, whole], 1e-3))
    own = (np.median(logs[BESIDE:], axis=0) - np.median(logs[:BESIDE], axis=0)) / size
    # Columns without anything to see on this side of the part do not count for it either.
    return float(((own > 0.5) & (own < 2.0)).sum() / max(used.any(axis=0).sum(), 1))  # noqa: PLR2004 - a factor of two


def _profile(image: NDArray[np.float32], use: Mask, axis: int) -> Array:
    """Median of each row (axis 1) or column (axis 2), NaN where hardly anything is used."""
    across = 1 if axis == 1 else 0
    enough = use.mean(axis=across) > 0.3  # noqa: PLR2004 - a third of the row
    profile = np.full(len(enough), np.nan)
    if enough.any():
        masked = np.where(use, image, np.nan)
        chosen = masked[enough] if axis == 1 else masked[:, enough]
        profile[enough] = np.nanmedian(chosen, axis=across)
    return profile


def _mixed(view: View, lit: Mask, lights: Array) -> list[Finding]:
    """Find a frame whose upper or lower rows show a neighbour's light as well as, or instead of, their own."""
    count, rows = len(lights), view.values.shape[1]
    if count < 6:  # noqa: PLR2004 - too few others to predict from
        return []
    bands = np.broadcast_to((np.arange(rows) * BANDS // rows)[:, None], lit.shape)
    moments = moments_by(view, lit, bands, BANDS)
    weights = loo_weights(lights)
    seen: list[_Mixture] = []
    for image in range(count):
        for neighbour in ((image - 1) % count, (image + 1) % count):
            others = _without(weights, lights, image, neighbour)
            # Residual of the image on its prediction without the neighbour, against what the neighbour adds to it.
            shown, added = -others, -others
            shown[image] += 1.0
            added[neighbour] += 1.0
            top = np.einsum("l,blm,m->b", shown, moments, added)
            bottom = np.einsum("l,blm,m->b", added, moments, added)
            seen.append(_Mixture(image, neighbour, *_best_split(top, bottom)))
    best = max(seen, key=lambda each: each.t * (each.share > MIXED and each.before < MIXED))
    near = {(best.image + step) % count for step in (-1, 0, 1)}
    elsewhere = max((each.t for each in seen if each.image not in near), default=0.0)
    clear = best.t > critical_t(BANDS, 2 * count * BANDS) and best.t > CLEARER * elsewhere
    if best.share < MIXED or best.before > MIXED or not clear:
        return []
    share = min(best.share, 1.0)
    return [
        Finding(
            "half-lit",
            "error" if share > 0.5 else "warning",  # noqa: PLR2004 - more the neighbour's than its own
            f"from {best.place:.0%} of its rows on, {view.names[best.image]} shows {share:.0%} of the light of "
            f"{view.names[best.neighbour]}",
            WORDS,
            image=best.image,
            value=share,
            limit=MIXED,
            unit="of the neighbour's light",
        )
    ]


def _without(weights: Array, lights: Array, image: int, neighbour: int) -> Array:
    """Weights that predict an image from all but itself and one neighbour."""
    chosen = np.setdiff1d(np.arange(len(lights)), [image, neighbour])
    row = np.zeros_like(weights[image])
    row[chosen] = lights[image] @ np.linalg.pinv(lights[chosen])
    return row


def _best_split(top: Array, bottom: Array) -> tuple[float, float, float, float]:
    """Mixed share beyond the row that splits best, Student's t of it against the rest, that row, the share before."""
    best = (0.0, 0.0, 0.0, 0.0)
    for split in range(3, len(top) - 2):
        for late in (slice(split, None), slice(None, split)):
            early = slice(None, split) if late.start is not None else slice(split, None)
            if bottom[late].sum() <= 0 or bottom[early].sum() <= 0:
                continue
            there, here = (float(top[part].sum() / bottom[part].sum()) for part in (late, early))
            error = 0.0
            for part, mean in ((late, there), (early, here)):
                left = top[part] - mean * bottom[part]
                error += float((left**2).sum()) / float(bottom[part].sum()) ** 2
            t = (there - here) / max(error**0.5, 1e-9)
            if t > best[1]:
                best = (there, t, split / len(top), abs(here))
    return best
