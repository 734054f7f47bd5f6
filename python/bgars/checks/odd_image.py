"""One image that shows another light than its line of the table, or that is turned: against what the others promise.

The other images fix normal and albedo of every pixel, and so the light that each must show. An image turned back that
fits as well as the others do was turned; a direction of light under which it does is the one that it was taken under.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bgars.checks.evidence import critical_t, paired_t
from bgars.checks.matt_fit import fit_normals, matt_lights, promised
from bgars.checks.view import TILES, tile_sums
from bgars.records.findings import Finding
from bgars.records.light_median import light_median

if TYPE_CHECKING:
    from bgars.checks.view import View

__all__ = ["QUARTERS", "TURNS", "check_odd_image", "matt"]

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

MIN_LIGHTS = 6
"""Of fewer, what is left over does not tell which image is off."""
BETTER = 0.5
"""Of the misfit as it is: most of it must be explained."""
AS_OTHERS = 2.0
"""Times the usual misfit of the other images, from which on an image is odd, and up to which it fits."""
EQUAL = 1e-4
"""Misfit, relative and squared, to which images fit at best: a percent, of rounding and noise."""
MOVED_DEG = 15.0
"""Directions of lights differ by less where only a lamp is off; 30 and more lie between neighbours of a ring."""
SLOPES = 0.1
"""Root mean square of the slopes, along any direction, from which on a surface tells a light's direction."""
MIN_PIXELS = 300
SHADOWED, SHINES = 0.15, 2.0
"""Of the pixel's median: darker is taken as shadow (as `matt_fit.SHADOWED`), brighter as a highlight."""
ROUNDS = 5
ABOVE = np.array([0.0, 0.0, 1.0])
LOW = float(np.sin(np.radians(45.0)))
"""Height of a light below which what balls reflect comes from above it: seen were lights at 27 to 39 degrees."""
REFLECTED = 0.28
"""Of the usual light, root mean square, that light reflected by balls leaves at most: it left 0.15 to 0.25 where images
seemed to be taken under higher lights, and a wrong direction 0.31 to 0.52."""
TURNS: tuple[tuple[str, Callable[[Floats], Floats]], ...] = (
    ("turned by 180 degrees", lambda image: image[::-1, ::-1]),
    ("mirrored left to right", lambda image: image[:, ::-1]),
    ("mirrored top to bottom", lambda image: image[::-1]),
)
QUARTERS: tuple[tuple[str, Callable[[Floats], Floats]], ...] = (
    ("turned by 90 degrees counter-clockwise", lambda image: np.rot90(image, -1)),
    ("turned by 90 degrees clockwise", lambda image: np.rot90(image, 1)),
)


class _Surface(NamedTuple):
    """What the other images say: normals times albedo (3, h, w), pixels where they do, and their usual light."""

    normal: Array
    known: Mask
    middle: Floats
    usual: float
    """Their own misfit."""


def check_odd_image(view: View) -> list[Finding]:
    """Find the image that belongs to its light least, if another light or a turn explains it."""
    if len(view.lights) < MIN_LIGHTS:
        return []
    misfits = _misfits(view)
    index = int(np.argmax(misfits))
    if misfits[index] < AS_OTHERS * max(float(np.median(misfits)), EQUAL):
        return []
    surface = _surface(view.without(index))
    if int(surface.known.sum()) < MIN_PIXELS:
        return []
    image = view.values[index]

    light = view.lights[index]
    turns = TURNS + (QUARTERS if image.shape[0] == image.shape[1] else ())
    turned = [name for name, turn in turns if _explains(view, surface, (image, light), (turn(image), light))]
    seen = _seen_light(image, light, surface)
    if seen is not None and not _explains(view, surface, (image, _lifted(image, light, surface)), (image, seen)):
        seen = None
    return _told(view, index, turned, seen)


def _misfits(view: View) -> Array:
    """(L,) mean square of what each image differs from the promise of the others, over the usual light."""
    promise = promised(view)
    middle = light_median(view.values)
    known = np.isfinite(promise) & view.use & ~view.clipped & matt(view.values, middle)
    left = np.square((view.values - promise) / np.maximum(middle, 1e-6))
    total = np.where(known, np.minimum(left, 1.0), 0.0).sum(axis=(1, 2))
    return np.asarray(total / np.maximum(known.sum(axis=(1, 2)), 1), np.float64)


def _surface(others: View) -> _Surface:
    count, rows, cols = others.values.shape
    keep = matt_lights(others).reshape(count, -1)
    fit = fit_normals(others.values.reshape(count, -1).astype(np.float64), keep, others.lights)
    known = (fit.solved & (fit.normal[2] > 0.0)).reshape(rows, cols) & others.use & ~others.clipped.any(axis=0)
    usual = float(np.median(_misfits(others)))
    return _Surface(fit.normal.reshape(3, rows, cols), known, light_median(others.values), usual)


def matt(values: Floats, middle: Floats) -> Mask:
    """Pixels that are neither in shadow nor in a highlight, of which nothing is promised."""
    matt: Mask = (values > SHADOWED * middle) & (values < SHINES * middle)
    return matt


def _explains(view: View, surface: _Surface, given: tuple[Floats, Array], other: tuple[Floats, Array]) -> bool:
    """Whether most of the misfit is gone, as far as the other images fit, in all parts of the image."""
    known = surface.known & matt(given[0], surface.middle) & matt(other[0], surface.middle)
    if int(known.sum()) < MIN_PIXELS:
        return False
    before, after = (_left(image, light, surface) for image, light in (given, other))
    mean = float(after[known].mean())
    if mean > BETTER * float(before[known].mean()) or mean > AS_OTHERS * max(surface.usual, EQUAL):
        return False
    one, two = tile_sums(view.tiles, before, known), tile_sums(view.tiles, after, known)
    weight = one + two
    there = weight > 0.0
    t, tiles = paired_t((one - two)[there] / weight[there], weight[there])
    return t > critical_t(min(tiles, TILES * TILES), len(view.lights) * (len(TURNS) + len(QUARTERS) + 1))


def _left(image: Floats, light: Array, surface: _Surface) -> Array:
    """(h, w) square of what an image differs from a surface under a light, over the usual light."""
    told = np.einsum("k,khw->hw", light, surface.normal)
    left: Array = np.minimum(np.square((image - told) / surface.middle.clip(1e-6)), 1.0)
    return left


def _lifted(image: Floats, light: Array, surface: _Surface) -> Array:
    """The light of a lamp that stands where it should, of any strength, with what it throws from above.

    A low lamp lights the sides of shiny balls, and these the board and each other.
    """
    known = surface.known & matt(image, surface.middle)
    alone = _fitted(image, surface, known, light[None])
    if light[2] > LOW or float(_left(image, light, surface)[known].mean()) > REFLECTED**2:
        return alone
    both = _fitted(image, surface, known, np.array([light, ABOVE]))
    return both if both[2] * np.hypot(*light[:2]) > light[2] * np.hypot(*both[:2]) else alone


def _seen_light(image: Floats, light: Array, surface: _Surface) -> Array | None:
    """The light that an image was taken under, where the surface tells it and it is another than stated."""
    known = surface.known & matt(image, surface.middle)
    if int(known.sum()) < MIN_PIXELS:
        return None
    normal = surface.normal[:, known]
    slopes = np.cov(normal[:2] / np.maximum(normal[2], 1e-9))
    if float(np.linalg.eigvalsh(slopes)[0]) < SLOPES**2:
        return None
    found = _fitted(image, surface, known, np.eye(3))
    length = float(np.linalg.norm(found))
    if not found[2] > 0.0 or float(found @ light) > np.cos(np.radians(MOVED_DEG)) * length:
        return None
    return found


def _fitted(image: Floats, surface: _Surface, known: Mask, span: Array) -> Array:
    """The light, a sum of the (K, 3) vectors of `span`, that explains an image best; what does not fit counts less."""
    shares, value = span @ surface.normal[:, known], image[known].astype(np.float64)
    weight = 1.0 / np.maximum(surface.middle[known].astype(np.float64), 1e-6) ** 2
    trust = np.ones_like(weight)
    found = np.zeros(len(span))
    for _ in range(ROUNDS):
        both = weight * trust
        product, right = np.einsum("in,n,jn->ij", shares, both, shares), np.einsum("in,n->i", shares, both * value)
        found = np.linalg.lstsq(product, right, rcond=None)[0]
        left = np.square(value - np.einsum("in,i->n", shares, found)) * weight
        trust = 1.0 / (1.0 + left / max(float(np.median(left)), EQUAL)) ** 2
    return np.asarray(found @ span, np.float64)


def _told(view: View, index: int, turned: list[str], seen: Array | None) -> list[Finding]:
    if not turned and seen is None:
        return []
    name = view.names[index]
    line = (
        ""
        if seen is None
        else f"{name} shows light from {_angles(seen)}, but the table says {_angles(view.lights[index])}"
    )
    if not turned:
        advice = "correct its line in the table of lights, or take the image again under its own lamp"
        return [Finding("order", "error", line, advice, image=index)]
    either = f"{name} is {' or '.join(turned)} against the other images" + (
        f", or its line of the table is wrong: {line}" if line else ""
    )
    return [
        Finding(
            "orientation",
            "error",
            either,
            "turn it back" + (", or correct its line in the table of lights" if line else ""),
            image=index,
        )
    ]


def _angles(light: Array) -> str:
    azimuth, elevation = np.degrees(
        [np.arctan2(light[1], light[0]) % (2.0 * np.pi), np.arcsin(light[2] / np.linalg.norm(light))]
    )
    return f"azimuth {azimuth:.0f}, elevation {elevation:.0f} degrees"
