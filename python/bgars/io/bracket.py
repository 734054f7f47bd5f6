"""Exposure brackets: images of each light at several exposure times, merged into one that nothing clips but the sun.

Each pixel is the mean of its exposures, each divided by its time, weighted by one over the variance of that: what the
camera reads out costs short exposures, photons cost all alike (Granados et al. 2010). Both are measured on the bracket
itself. A pixel that clips has no say; it is clipped where it clips in the shortest exposure.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy  # loads its modules when they are used
from numpy.typing import NDArray

from bgars.errors import InputError
from bgars.io.recipe import RECIPE_NAME

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from bgars.io.recipe import CaptureRecipe
    from bgars.records.capture import Capture
    from bgars.records.pixels import FloatArray

__all__ = ["bracket_names", "lights_in_bracket", "merge_exposures", "recipe_of_exposure"]

Array = NDArray[np.float64]

NEAR_CLIP = 0.98
"""Share of the clip level from which on noise may have been clipped."""
WRONG, UNSURE = 1.3, 1.05
"""Ratio of what two exposures show of one light to what their times say: beyond it they are others, or noted."""
LEAST_LEVEL = 0.04
"""Of full scale: levels that tell the ratio of two exposures."""
TOO_DARK = 0.5
"""Share of the level expected of the shorter exposure by which rounding and noise may move it, and nothing is told."""
LEAST_PIXELS = 50
BINS = 12
SAMPLE = 200_000
ROUNDING = 1.0 / 12.0


class _Noise(NamedTuple):
    """Variance of a grey level: `read` + `gain` x level."""

    read: float
    gain: float


def bracket_names(recipe: CaptureRecipe, lights: int) -> list[list[str]]:
    """Return the names of the images: one list per exposure, one name per light.

    Raises
    ------
    InputError
        A list of another length than lights times exposures.
    """
    times = recipe.exposures_ms or []
    if isinstance(recipe.images, str):
        return [[_named(recipe.images, light, place, times) for light in range(lights)] for place in range(len(times))]
    names = recipe.images or []
    if len(names) != lights * len(times):
        msg = (
            f"{RECIPE_NAME}: images: {len(names)} names, but {lights} lights at {len(times)} exposures are "
            f"{lights * len(times)}: all exposures of light 0, then of light 1, and so on"
        )
        raise InputError(msg)
    return [names[place :: len(times)] for place in range(len(times))]


def lights_in_bracket(folder: Path, recipe: CaptureRecipe) -> int:
    """Return how many lights a bracket has whose lights are described nowhere."""
    times = recipe.exposures_ms or []
    if not isinstance(recipe.images, str):
        return len(recipe.images or []) // len(times)
    light = 0
    while any((folder / _named(recipe.images, light, place, times)).exists() for place in range(len(times))):
        light += 1
    if light == 0:
        msg = f"{folder / RECIPE_NAME}: images: no file is called {_named(recipe.images, 0, 0, times)}"
        raise InputError(msg)
    return light


def recipe_of_exposure(recipe: CaptureRecipe, names: list[str], place: int, saturation: float | None) -> CaptureRecipe:
    """Return the recipe of one exposure as a capture of its own."""
    times = recipe.exposures_ms or []
    dark = None if recipe.dark is None else _named(recipe.dark, 0, place, times)
    more = {} if saturation is None or recipe.saturation is not None else {"saturation": saturation}
    return recipe.model_copy(update={"images": names, "exposures_ms": None, "dark": dark, **more})


def _named(pattern: str, light: int, place: int, times: Sequence[float]) -> str:
    try:
        return pattern.format(light=light, exposure=place, ms=f"{times[place]:g}")
    except (KeyError, IndexError, ValueError) as error:
        msg = (
            f"{RECIPE_NAME}: {pattern!r}: may hold {{light}} and {{exposure}}, counted from 0 ({{light:02d}} with two "
            "digits), and {ms}, the exposure time"
        )
        raise InputError(msg) from error


def merge_exposures(captures: Sequence[Capture], exposures_ms: Sequence[float]) -> tuple[Capture, list[str]]:
    """Merge captures of one part, each at another exposure time, and say what had to be noticed.

    Parameters
    ----------
    captures : sequence of Capture
        The same lights, images of one size.
    exposures_ms : sequence of float
        Their exposure times.

    Returns
    -------
    Capture
        Linear float32 images on the scale of the longest exposure, without a dark level. Full scale stays that of one
        image: highlights exceed it, up to `saturation`.
    notes : list of str

    Raises
    ------
    InputError
        Images of different sizes, or exposures whose images are not as bright as their times say.
    """
    order = np.argsort(exposures_ms)
    times = np.array(exposures_ms, dtype=np.float64)[order]
    ordered = [captures[index] for index in order]
    longest = ordered[-1]
    for one in ordered:
        if one.images.shape != longest.images.shape:
            msg = (
                f"{longest.name}: images of a bracket must have one size, got {one.images.shape[1:]} at an exposure "
                f"and {longest.images.shape[1:]} at another (rows, columns)"
            )
            raise InputError(msg)
    share = times / times[-1]
    merged = np.zeros(longest.images.shape, np.float32)
    top = min(_top_of(one) / part for one, part in zip(ordered, share, strict=True) if part == share[0])
    notes: list[str] = []
    noise: _Noise | None = None
    for light in range(len(merged)):
        levels, clipped = zip(*(_linear(one, light) for one in ordered), strict=True)
        notes += _check_order(ordered, times, levels, clipped, light)
        noise = _noise_of(levels, clipped, share, longest.full_scale) if noise is None else noise
        merged[light] = _merged(levels, clipped, share, noise, top)
    found = replace(
        longest, images=merged, dark=None, response=None, black_level=0.0, saturation=float(top),
        mask=np.logical_and.reduce([one.mask for one in ordered]),
    )  # fmt: skip
    return found, sorted(set(notes))


def _linear(capture: Capture, light: int) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Grey levels of one image, linear and without the dark level, and where they clip."""
    values = capture.images[light]
    table = capture.response

    def linear(codes: NDArray[np.generic]) -> FloatArray:
        return (codes if table is None else table[codes.astype(np.intp)]).astype(np.float32)

    dark = linear(np.array([round(capture.black_level)]))[0] if capture.dark is None else linear(capture.dark)
    return linear(values) - dark, np.asarray(values >= NEAR_CLIP * capture.saturation)


def _top_of(capture: Capture) -> float:
    """Clip level, linear and without the dark level."""
    level = min(capture.saturation, capture.full_scale)
    table = capture.response
    linear = level if table is None else float(table[round(level)])
    dark = capture.black_level if capture.dark is None else float(np.median(capture.dark))
    return linear - (dark if table is None else float(table[round(dark)]))


def _check_order(
    captures: Sequence[Capture],
    times: Array,
    levels: Sequence[FloatArray],
    clipped: Sequence[NDArray[np.bool_]],
    light: int,
) -> list[str]:
    """Refuse exposures that are not as bright as their times say; note what is too dark to tell."""
    notes = []
    for place in range(1, len(times)):
        long, short = levels[place], levels[place - 1]
        told = float(times[place] / times[place - 1])
        # Chosen by the brighter image alone: noise that helps to choose a level is in its mean.
        pick, dim = (place, short) if float(long.sum()) >= float(short.sum()) else (place - 1, long)
        use = ~clipped[pick] & (levels[pick] > LEAST_LEVEL * captures[pick].full_scale)
        if int(use.sum()) < LEAST_PIXELS:
            continue
        bright = float(levels[pick][use].mean())
        # Rounding of levels and of the dark level moves a mean by half a step at most, noise by three deviations.
        step = 1.0 if captures[pick].images.dtype.kind == "u" else 0.0
        spread = float(dim[use].std()) / math.sqrt(int(use.sum()))
        unsure = (0.5 * step + 3.0 * spread) / (bright / told)
        if unsure > TOO_DARK:
            notes.append(
                f"images at {times[place - 1]:g} ms are too dark to tell whether they are as bright against those at "
                f"{times[place]:g} ms as the times say"
            )
            continue
        seen = float(long[use].mean()) / max(float(short[use].mean()), 1e-3 * bright / told)
        off = max(seen / told, told / max(seen, 1e-9))
        if off > WRONG * (1.0 + unsure):
            first, second = (_file_of(captures[index], light) for index in (place, place - 1))
            msg = (
                f"{first} is {seen:.2g} times as bright as {second}, but exposures_ms says {told:.2g} times "
                f"({times[place]:g} and {times[place - 1]:g} ms): files in another order, or a camera whose response "
                "is not linear"
            )
            raise InputError(msg)
        if off > UNSURE * (1.0 + unsure):
            notes.append(
                f"images at {times[place]:g} ms are not as bright against those at {times[place - 1]:g} ms as "
                "the times say (by more than 5 %): calibrate the response, or check the times"
            )
    return notes


def _file_of(capture: Capture, light: int) -> str:
    return str(capture.files[light]) if light < len(capture.files) else f"light {light}"


def _noise_of(
    levels: Sequence[FloatArray], clipped: Sequence[NDArray[np.bool_]], share: Array, full_scale: float
) -> _Noise:
    """Variance against level, from differences between neighbouring exposures (photon transfer, Janesick 2007)."""
    rows, seen = [], []
    step = full_scale / 255.0
    for place in range(1, len(share)):
        ratio = float(share[place] / share[place - 1])
        good = ~clipped[place] & ~clipped[place - 1] & (levels[place - 1] > 2.0 * step)
        long, short = levels[place][good].astype(np.float64), levels[place - 1][good].astype(np.float64)
        stride = max(1, len(long) // SAMPLE)
        long, off = long[::stride], (long - ratio * short)[::stride]
        if len(long) < LEAST_PIXELS * BINS:
            continue
        for part in np.array_split(np.argsort(long), BINS):
            spread = 1.4826 * float(np.median(np.abs(off[part] - np.median(off[part]))))
            rows.append([1.0 + ratio**2, float(np.mean(long[part])) * (1.0 + ratio)])
            seen.append(spread**2)
    if not rows:
        return _Noise(step**2 * ROUNDING, step * 0.01)
    matrix, right = np.array(rows), np.array(seen)
    # Variances are known to a share of themselves.
    weight = 1.0 / np.maximum(right, 1e-3 * float(right.max()) + 1e-12)
    read, gain = scipy.optimize.nnls(matrix * weight[:, None], right * weight)[0]
    return _Noise(max(float(read), 1e-9 * full_scale**2), float(gain))


def _merged(
    levels: Sequence[FloatArray], clipped: Sequence[NDArray[np.bool_]], share: Array, noise: _Noise, top: float
) -> FloatArray:
    """One image on the scale of the longest exposure."""
    usable = [~one for one in clipped]
    usable[0] = levels[0] < top * share[0]
    # A first mean by photons tells the level; weights that know a pixel's own noise would be biased by it.
    time = sum(part * use for part, use in zip(share, usable, strict=True))
    light = sum(level * use for level, use in zip(levels, usable, strict=True))
    first = np.maximum(light / np.maximum(time, 1e-12), 0.0)
    total, weights = np.zeros(first.shape), np.zeros(first.shape)
    for level, use, part in zip(levels, usable, share, strict=True):
        weight = use * part**2 / (noise.read + noise.gain * part * first)
        total += weight * level / part
        weights += weight
    merged = np.where(weights > 0, total / np.maximum(weights, 1e-300), top)
    return np.minimum(merged, math.inf if not math.isfinite(top) else top).astype(np.float32)
