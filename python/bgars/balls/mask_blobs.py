"""A mask as silhouette: where one of its blobs is round, the circle is the mask's."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy  # loads its modules when they are used

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bgars.records.pixels import BoolArray

__all__ = ["RoundBlobs", "round_blobs"]

SMALLEST_PX = 4.0
"""Radius of the smallest blob that is looked at."""
ROUND_PX = 0.7
"""RMS distance of the outline from the circle that still is round, in pixels."""
ROUND_FRACTION = 0.015
"""RMS distance of the outline from the circle that still is round: pixels, or of the radius."""
MAX_BLOBS = 1000


class RoundBlobs(NamedTuple):
    """Circles of the round blobs, N each, in array coordinates."""

    row: NDArray[np.float64]
    col: NDArray[np.float64]
    radius_px: NDArray[np.float64]
    rms_px: NDArray[np.float64]


def round_blobs(mask: BoolArray) -> RoundBlobs:
    """Circles of equal area around the centroids of blobs whose outline is a circle (holes filled).

    Parameters
    ----------
    mask : (H, W) bool
        True = use.
    """
    labels, count = scipy.ndimage.label(mask)
    found = []
    for index, box in enumerate(scipy.ndimage.find_objects(labels)[:MAX_BLOBS] if count else [], start=1):
        blob = np.pad(scipy.ndimage.binary_fill_holes(labels[box] == index), 1)
        radius_px = float(np.sqrt(blob.sum() / np.pi))
        if radius_px < SMALLEST_PX:
            continue
        rows, cols = np.nonzero(blob)
        row, col = rows.mean(), cols.mean()
        edge_rows, edge_cols = np.nonzero(blob & ~scipy.ndimage.binary_erosion(blob))
        distance = np.hypot(edge_rows - row, edge_cols - col)
        rms_px = float(np.sqrt(np.mean((distance - distance.mean()) ** 2)))
        if rms_px <= max(ROUND_PX, ROUND_FRACTION * radius_px):
            found.append((row - 1 + box[0].start, col - 1 + box[1].start, radius_px, rms_px))
    return RoundBlobs(*np.array(found).reshape(-1, 4).T)
