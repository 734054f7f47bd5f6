"""The same image twice: bit by bit, or the same light photographed twice."""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bgars.checks.matt_fit import COPLANAR, MIN_LIGHTS, fit_normals, matt_lights
from bgars.records.findings import Finding
from bgars.records.same_images import same_images

if TYPE_CHECKING:
    from bgars.checks.view import View
    from bgars.records.capture import Capture
    from bgars.records.findings import Severity

__all__ = ["alike_images", "check_all_alike", "check_duplicates"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

SAME_LIGHT = 0.02
"""Share of the usual difference between two lights (variance) that is left between two images under one light."""
OF_EXPECTED = 0.1
"""Share, at most, of what the two lights make differ on this surface: lights of a dense dome are alike anyway."""
U_PROMISE = 0.02
"""Relative standard uncertainty of each image that the promise is made from: a direction good to a degree changes the
light on slopes of 45 degrees by so much. What is promised must be more than that leaves."""
MIN_PIXELS = 100
"""Pixels whose surface is known, below which nothing is promised."""
APART = 0.05
"""Distance of two directions, of unit vectors, below which they may be LEDs of one lamp: 3 degrees."""
TRIED = 8
"""Pairs of images, the most alike first, of which the surface is asked: in a dense dome hundreds are alike."""
SHADED = 0.02
"""Relative standard deviation by which lights shade a part that tells them apart."""


def alike_images(view: View) -> list[tuple[int, int]]:
    """Pairs of images under lights far apart that differ by noise only, where the surface makes two lights differ.

    The difference of two images under one light is noise: it has no structure, so its variance in the small copy is
    that of noise. How much two lights differ is up to the surface: those on both sides of a groove, in line with it,
    light it alike. So the other images say what the pair must differ by; where that is little, nothing is told.
    """
    use = view.use & ~view.clipped.any(axis=0)
    if use.sum() < 100:  # noqa: PLR2004 - too few to tell
        return []
    values = view.values[:, use].astype(np.float64)
    values /= np.maximum(values.mean(axis=0), 1e-9)
    pairs = list(combinations(range(len(values)), 2))
    far = [pair for pair in pairs if np.linalg.norm(view.lights[pair[0]] - view.lights[pair[1]]) > APART]
    if not far:
        return []
    everywhere = np.ones(values.shape[1], dtype=bool)
    differs = {(one, two): _apart(values[one], values[two], everywhere) for one, two in far}
    usual = float(np.median(list(differs.values())))
    if usual < SHADED**2:
        return []
    keep = matt_lights(view)[:, use]
    alike = sorted((pair for pair in far if differs[pair] < SAME_LIGHT * usual), key=differs.__getitem__)[:TRIED]
    share = {pair: _of_expected(values, keep, view.lights, pair) for pair in alike}
    # An image that is not what it should be upsets what is expected of the others: the clearest pair first.
    return sorted((pair for pair in alike if share[pair] < OF_EXPECTED), key=share.__getitem__)


def _apart(one: Array, two: Array, known: Mask) -> float:
    """Mean square of the difference of two images, whatever the two lamps' strengths."""
    one, two = (each[known] / max(float(np.median(each[known])), 1e-9) for each in (one, two))
    return float(np.mean(np.minimum((one - two) ** 2, 1.0)))


def _of_expected(values: Array, keep: Mask, lights: Array, pair: tuple[int, int]) -> float:
    """Share of the difference that two lights make, on the surface that the other images show; inf where that is small.

    Where the others do not fix a surface, one of the two helps, and the larger share counts.
    """
    others = np.setdiff1d(np.arange(len(lights)), pair)
    sets = [others] if len(others) >= MIN_LIGHTS else [np.sort(np.append(others, each)) for each in pair]
    shares = []
    for index in sets:
        normal, known = _surface(values[index], keep[index], lights[index])
        if int(known.sum()) < MIN_PIXELS:
            return np.inf
        between = (lights[pair[0]] - lights[pair[1]]) @ np.linalg.pinv(lights[index])
        one, two = (np.maximum(lights[each] @ normal, 0.0) for each in pair)
        expected = _apart(one, two, known)
        if expected < U_PROMISE**2 * (2.0 + float(between @ between)):
            return np.inf
        shares.append(_apart(values[pair[0]], values[pair[1]], known) / expected)
    return max(shares)


def _surface(values: Array, keep: Mask, lights: Array) -> tuple[Array, Mask]:
    """Normals times albedo (3, N), and where they are known."""
    if len(lights) < MIN_LIGHTS:
        if len(lights) < 3 or abs(np.linalg.det(lights)) < COPLANAR**0.5:  # noqa: PLR2004 - three unknowns
            return np.zeros((3, values.shape[1])), np.zeros(values.shape[1], dtype=bool)
        return np.asarray(np.linalg.solve(lights, values), np.float64), np.asarray(keep.all(axis=0))
    fit = fit_normals(values, keep, lights)
    return fit.normal, fit.solved


def check_all_alike(capture: Capture) -> list[Finding]:
    """Find images that are all the same, also where they are blank."""
    images = capture.images
    if len(images) < 2 or not all(np.array_equal(images[0], each) for each in images[1:]):  # noqa: PLR2004
        return []
    is_blank = images[0].min() == images[0].max()
    # A plane without texture is blank, too, where nothing adds noise, as in a simulation: its normals are right.
    severity: Severity = "note" if is_blank else "error"
    return [
        Finding(
            "duplicate",
            severity,
            f"all {len(images)} images are {'one even grey' if is_blank else 'the same picture'}",
            ("a plane looks so, and nothing else can be told" if is_blank else "they hold no shading")
            + ": look for one file under several names, lamps that do not switch, or a camera that repeats one frame",
        )
    ]


def check_duplicates(capture: Capture, view: View) -> list[Finding]:
    """Find images that show the same light."""
    same = same_images(capture.images)
    if same is not None:
        first, second = same
        one, two = view.names[first], view.names[second]
        told = f"{one} and {two}" if one != two else f"images {first} and {second} ({one}, named twice)"
        return [
            Finding(
                "duplicate",
                "error",
                f"{told} are the same picture",
                "each light needs its own image: look for a missed trigger, or for one file copied or named twice",
                image=second,
            )
        ]
    return [
        Finding(
            "duplicate",
            "error",
            f"{view.names[first]} and {view.names[second]} show the same light, though the table names two",
            "look for a missed trigger or a lamp that was fired twice, and take the image again",
            image=second,
        )
        for first, second in alike_images(view)[:1]
    ]
