"""Values that no photograph has: pixels that are not finite, and light below 0."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bgars.errors import InputError
from bgars.io.recipe import RECIPE_NAME

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from bgars.records.pixels import BoolArray, FloatArray, PixelArray

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
    if images.dtype.kind != "f":
        return
    found = [(share, path) for image, path in zip(images, paths, strict=True) if (share := _share(image, offset, mask))]
    if found:
        share, path = max(found, key=lambda each: each[0])
        others = f" and {len(found) - 1} others" if len(found) > 1 else ""
        notes.append(
            f"{path.name}{others}: {100.0 * share:.0f} % of the used pixels are below 0 by more than noise; if the "
            "images were centred, or a level was subtracted, add it again, and state what no light reads as "
            f"black_level in {RECIPE_NAME}"
        )


def _share(image: FloatArray, offset: PixelArray | float, mask: BoolArray) -> float:
    """Share of the blocks within the mask that are negative by a relevant amount; 0 where they are but few."""
    rows, cols = (size // BLOCK_PX for size in image.shape)
    light = (image - offset)[: rows * BLOCK_PX, : cols * BLOCK_PX]
    use = mask[: rows * BLOCK_PX, : cols * BLOCK_PX]
    whole = use.reshape(rows, BLOCK_PX, cols, BLOCK_PX).all(axis=(1, 3))
    below = use & (light < 0.0)
    if not (whole.any() and below.any()):
        return 0.0
    means = light.reshape(rows, BLOCK_PX, cols, BLOCK_PX).mean(axis=(1, 3), dtype=np.float64)[whole]
    relevant = RELEVANT_LEVEL * float(np.percentile(np.abs(means), BRIGHT_PERCENT))
    differences = np.abs(np.diff(light, axis=1))[below[:, 1:] & use[:, :-1]]
    noise = float(np.median(differences)) / MEDIAN_OF_DIFFERENCES if differences.size else 0.0
    share = float(np.mean(means < -max(SURE_SIGMA * noise / BLOCK_PX, relevant)))
    return share if share > RELEVANT_SHARE else 0.0
