"""Frames that were caught between two lights: rolling shutters, late triggers, lamps that switched on too late."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bgars.records.findings import Finding

if TYPE_CHECKING:
    from bgars.checks.view import View

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
MIN_BANDS = 4
"""Bands, of `BANDS`, that must show another light, and that must not."""
SAME_LIGHT = 0.06
"""Share of the usual difference between neighbouring lights (variance) that noise leaves under one light."""
DIFFERS = 0.3
"""Share of the same by which either image must differ from its other neighbour."""
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
    return _late(view)


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
    """Share of the columns (of an axis of rows) whose own step at one place is half to twice as large."""
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
    band = np.broadcast_to((np.arange(rows) * BANDS // rows)[:, None], use.shape)[use]

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
            if best is None or abs(length) > abs(best[2]):
                best = (first, second, length)
    if best is None:
        return []
    first, second, length = best
    # Shutters run down the rows: rows read late see the next lamp, rows read early the one before.
    image, neighbour = (second, first) if length > 0 else (first, second)
    share = abs(length) / BANDS
    return [
        Finding(
            "half-lit",
            "error",
            f"{share:.0%} of the rows of {view.names[image]} show the light of {view.names[neighbour]}",
            WORDS,
            image=image,
            value=share,
            limit=MIN_BANDS / BANDS,
            unit="of the rows",
        )
    ]


def _run(same: Mask) -> int:
    """Length of the run of True that a row of bands begins with."""
    return len(same) if same.all() else int(np.argmin(same))
