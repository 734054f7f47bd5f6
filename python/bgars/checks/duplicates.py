"""The same image twice: bit by bit, or the same light photographed twice."""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from bgars.records.findings import Finding
from bgars.records.same_images import same_images

if TYPE_CHECKING:
    from bgars.checks.view import View
    from bgars.records.capture import Capture
    from bgars.records.findings import Severity

__all__ = ["alike_images", "check_all_alike", "check_duplicates"]

SAME_LIGHT = 0.02
"""Share of the usual difference between two lights (variance) that is left between two images under one light."""
OF_EXPECTED = 0.1
"""Share, at most, of what two lights so far apart make differ: lights of a dense dome are alike anyway."""
APART = 0.2
"""Distance of two directions, of unit vectors, from which on their images differ: 12 degrees."""
SHADED = 0.02
"""Relative standard deviation by which lights shade a part that tells them apart."""


def alike_images(view: View) -> list[tuple[int, int]]:
    """Pairs of images under lights far apart that differ by noise only, where the others differ by shading.

    The difference of two images under one light is noise: it has no structure, so its variance in the small copy is
    that of noise; lights far apart shade a part differently. On a flat field all pairs look alike, and none is told.
    """
    use = view.use & ~view.clipped.any(axis=0)
    if use.sum() < 100:  # noqa: PLR2004 - too few to tell
        return []
    values = view.values[:, use].astype(np.float64)
    values /= np.maximum(values.mean(axis=0), 1e-9)
    scale = np.median(values, axis=1)
    values /= np.maximum(scale, 1e-9)[:, None]
    pairs = list(combinations(range(len(values)), 2))
    far = [pair for pair in pairs if np.linalg.norm(view.lights[pair[0]] - view.lights[pair[1]]) > APART]
    if not far:
        return []
    differs = {pair: float(np.mean(np.minimum((values[pair[0]] - values[pair[1]]) ** 2, 1.0))) for pair in far}
    usual = float(np.median(list(differs.values())))
    if usual < SHADED**2:
        return []
    # What a matt part shows differs as the square of the distance of two lights.
    apart = {pair: float(np.square(view.lights[pair[0]] - view.lights[pair[1]]).sum()) for pair in far}
    typical = float(np.median(list(apart.values())))
    limit = {pair: usual * min(SAME_LIGHT, OF_EXPECTED * apart[pair] / typical) for pair in far}
    return [pair for pair in far if differs[pair] < limit[pair]]


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
