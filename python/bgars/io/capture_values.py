"""Values that no photograph has: pixels that are not finite, and light below 0."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from bgars.errors import InputError
from bgars.io.recipe import RECIPE_NAME

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from bgars.records.pixels import BoolArray, PixelArray

__all__ = ["note_light_below_zero", "refuse_nan"]

BLOCK_PX = 8
"""Means of blocks have an eighth of the noise of their pixels."""
SURE_SIGMA = 6.0
RELEVANT_LEVEL = 0.01
"""Of the bright blocks (their 99th percentile): an offset of so much turns normals by a degree or so."""
RELEVANT_SHARE = 0.01
"""Of the blocks: fewer are defects of a sensor."""
BRIGHT_PERCENT = 99.0
MEDIAN_OF_DIFFERENCES = 0.954
"""Median of the absolute difference of two values with noise of standard deviation 1: 0.6745 times the root of 2."""


def refuse_nan(images: PixelArray, mask: BoolArray, paths: Sequence[Path]) -> None:
    """Raise where a used pixel is not finite.

    Raises
    ------
    InputError
        One is not; its file and place are named.
    """
    if images.dtype.kind != "f":
        return
    for image, path in zip(images, paths, strict=True):
        bad = ~np.isfinite(image) & mask
        if bad.any():
            row, col = np.argwhere(bad)[0]
            msg = (
                f"{path}: {int(bad.sum())} pixels inside the mask are not finite (first at row {row}, column {col}); "
                "mask them out"
            )
            raise InputError(msg)


def note_light_below_zero(
    images: PixelArray, offset: PixelArray | float, mask: BoolArray, paths: Sequence[Path], notes: list[str]
) -> None:
    """Say where light is negative by more than noise can make it once `offset`, what no light reads, is subtracted."""
    is_dark = isinstance(offset, np.ndarray)
    if images.dtype.kind != "f" and not is_dark and not offset > 0:
        return
    found = [(share, path) for image, path in zip(images, paths, strict=True) if (share := _share(image, offset, mask))]
    if not found:
        return
    share, path = max(found, key=lambda each: each[0])
    others = f" and {len(found) - 1} others" if len(found) > 1 else ""
    said = f"{path.name}{others}: {100.0 * share:.0f} % of the used pixels are"
    if is_dark:
        notes.append(f"{said} darker than the dark frame by more than noise; it must be taken without any of the lamps")
    elif offset > 0:
        notes.append(
            f"{said} below black_level = {offset:g} by more than noise; it must be the grey level that no light reads"
        )
    else:
        notes.append(
            f"{said} below 0 by more than noise; if the images were centred, or a level was subtracted, add it again, "
            f"and state what no light reads as black_level in {RECIPE_NAME}"
        )


def _share(image: PixelArray, offset: PixelArray | float, mask: BoolArray) -> float:
    """Share of the blocks within the mask that are negative by a relevant amount; 0 where they are but few."""
    rows, cols = (size // BLOCK_PX for size in image.shape)
    is_integer = image.dtype.kind != "f"
    if is_integer and not _any_below(image, offset, mask):
        return 0.0
    light = (image.astype(np.float32) - np.float32(offset))[: rows * BLOCK_PX, : cols * BLOCK_PX]
    use = mask[: rows * BLOCK_PX, : cols * BLOCK_PX]
    whole = use.reshape(rows, BLOCK_PX, cols, BLOCK_PX).all(axis=(1, 3))
    below = use & (light < 0.0)
    if not (whole.any() and below.any()):
        return 0.0
    means = light.reshape(rows, BLOCK_PX, cols, BLOCK_PX).mean(axis=(1, 3), dtype=np.float64)[whole]
    relevant = RELEVANT_LEVEL * float(np.percentile(np.abs(means), BRIGHT_PERCENT))
    differences = np.abs(np.diff(light, axis=1))[below[:, 1:] & use[:, :-1]]
    noise = float(np.median(differences)) / MEDIAN_OF_DIFFERENCES if differences.size else 0.0
    rounding = 1.0 if is_integer else 0.0  # half a level of the image and half of the dark frame
    share = float(np.mean(means < -max(SURE_SIGMA * noise / BLOCK_PX, relevant, rounding)))
    return share if share > RELEVANT_SHARE else 0.0


def _any_below(image: PixelArray, offset: PixelArray | float, mask: BoolArray) -> bool:
    """Whether so many pixels are below an offset that blocks of them can be, which takes more than half of each."""
    lowest = offset if isinstance(offset, np.ndarray) else image.dtype.type(math.ceil(offset))
    below = np.count_nonzero((image < lowest) & mask)
    return bool(below > RELEVANT_SHARE / 2.0 * np.count_nonzero(mask))
