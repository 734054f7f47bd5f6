"""One image turned or mirrored against the others."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bgars.records.findings import Finding

if TYPE_CHECKING:
    from collections.abc import Callable

    from bgars.checks.view import View

__all__ = ["check_orientation"]

Array = NDArray[np.float64]

AS_OTHERS = 0.7
"""An image turned back must correlate with the others so well, of how well these do among each other."""
ALIKE = 0.4
"""Correlation of an image with the others from which on they share detail that no light moves: shading alone, as that
of a bare ball, is mirrored by a lamp on the other side, too."""
AS_IT_IS = 0.4
"""Most that it may correlate as it is, of the same: parts that look the same after a turn prove nothing."""
BOX = 9


def check_orientation(view: View) -> list[Finding]:
    """Find an image that fits the others only after a turn or a mirror."""
    pictures = np.array([_detail(np.where(view.use, image, 0.0)) for image in view.values])
    total = pictures.sum(axis=0)
    rows, cols = view.use.shape
    turns: dict[str, Callable[[Array], Array]] = {
        "turned by 180 degrees": lambda image: image[::-1, ::-1],
        "mirrored left to right": lambda image: image[:, ::-1],
        "mirrored top to bottom": lambda image: image[::-1],
    }
    if rows == cols:
        turns |= {
            "turned by 90 degrees counter-clockwise": lambda image: np.rot90(image, -1),
            "turned by 90 degrees clockwise": np.rot90,
        }
    plain = np.array([_correlation(picture, total - picture) for picture in pictures])
    found = []
    for index, picture in enumerate(pictures):
        others = total - picture
        usual = float(np.median(np.delete(plain, index)))
        if usual < ALIKE:
            continue
        best = max(turns, key=lambda name: _correlation(turns[name](picture), others))
        value = _correlation(turns[best](picture), others)
        if value > AS_OTHERS * usual and plain[index] < AS_IT_IS * usual:
            found.append(
                Finding(
                    "orientation",
                    "error",
                    f"{view.names[index]} is {best} against the other images",
                    "turn it back; look for orientation tags that only some of the files carry",
                    image=index,
                    value=value,
                    limit=AS_OTHERS * usual,
                    unit="correlation",
                )
            )
    return found if len(found) <= len(view.values) // 2 else []


def _detail(image: Array) -> Array:
    """Image without its low frequencies, scaled to its own brightness."""
    padded = np.pad(image.astype(np.float64), BOX // 2, mode="edge")
    sums = np.cumsum(np.cumsum(np.pad(padded, ((1, 0), (1, 0))), axis=0), axis=1)
    smooth = (sums[BOX:, BOX:] - sums[:-BOX, BOX:] - sums[BOX:, :-BOX] + sums[:-BOX, :-BOX]) / BOX**2
    detail = np.log(np.maximum(image, 1e-3)) - np.log(np.maximum(smooth, 1e-3))
    clipped: Array = np.clip(detail, -1.0, 1.0)
    return clipped


def _correlation(first: Array, second: Array) -> float:
    one, two = first - first.mean(), second - second.mean()
    return float((one * two).sum() / max(float(np.sqrt((one**2).sum() * (two**2).sum())), 1e-12))
