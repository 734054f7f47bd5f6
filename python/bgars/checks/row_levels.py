"""Steps of brightness between the rows of an image that the other images do not show, however small.

Each row counts by the median, over its columns, of the light over what the other images promise: a step of the shutter
runs through all columns, edges of shadows through a few. A step that is one explains most of what the rows of its
image differ in, beside smooth shading; texture, balls and noise leave the best step a smaller share.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["CLEAR_STEP", "RowStep", "clear_step"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

SHADOW = 0.2
"""Of the promised light: less is shadow, which says nothing of the lamp."""
SEEN = 0.3
"""Share of the most columns that tell of any row, from which on a row is judged."""
MIN_COLUMNS = 4
MIN_ROWS = 32
CLEAR_STEP = 0.18
"""Step, natural logarithm, that is told: light on either side of it may be off its promise by a tenth, which highlights
and light from neighbours leave (`geometry.MATT`)."""
EXPLAINS = 0.8
"""Share of the variance of the rows that a step must explain; what shades a curved part leaves explains less."""
EDGE = 0.06
"""Share of the rows, at either end, where no step is looked for: it would be the end of the part."""


class RowStep(NamedTuple):
    """The step of an image: its size (natural logarithm), where it is, its share of the variance of the rows."""

    size: float
    place: float
    share: float


def clear_step(ratio: Array, use: Mask) -> tuple[int, RowStep] | None:
    """Return the image with the largest step that is told, and the step; None where no image has one.

    Parameters
    ----------
    ratio : (L, h, w) float64
        Light over what the other images promise; NaN where they do not tell.
    use : (h, w) bool
    """
    told = [(index, step) for index, step in enumerate(_row_steps(ratio, use)) if step.share > EXPLAINS]
    index, step = max(told, key=lambda each: abs(each[1].size), default=(0, RowStep(0.0, 0.0, 0.0)))
    return (index, step) if abs(step.size) > CLEAR_STEP else None


def _row_steps(ratio: Array, use: Mask) -> list[RowStep]:
    """The step of each image that explains most."""
    rows = _medians(np.log(np.where(use & (ratio > SHADOW), ratio, np.nan)))
    common = np.full(rows.shape[1], np.nan)
    known = np.isfinite(rows).sum(axis=0) > len(rows) / 2
    common[known] = np.nanmedian(rows[:, known], axis=0)
    return [_step(each - common) for each in rows]


def _step(levels: Array) -> RowStep:
    """The step among (rows,) levels, NaN where unknown, that explains most beside a parabola."""
    told = np.flatnonzero(np.isfinite(levels))
    if len(told) < MIN_ROWS:
        return RowStep(0.0, 0.0, 0.0)
    x = np.linspace(-1.0, 1.0, len(levels))[told]
    smooth = np.linalg.qr(np.column_stack([np.ones_like(x), x, x**2]))[0]
    left = levels[told] - smooth @ (smooth.T @ levels[told])
    margin = max(int(EDGE * len(told)), 1)
    places = np.arange(margin, len(told) - margin)
    steps = (np.arange(len(told)) >= places[:, None]).astype(np.float64)
    steps -= (steps @ smooth) @ smooth.T
    power = (steps**2).sum(axis=1)
    sizes = steps @ left / power
    shares = sizes**2 * power / max(float(left @ left), 1e-12)
    best = int(np.argmax(shares))
    return RowStep(float(sizes[best]), float(told[places[best]]) / len(levels), float(shares[best]))


def _medians(values: Array) -> Array:
    """(L, rows) median over the columns of (L, rows, columns), NaN where few of them tell."""
    told = np.isfinite(values).sum(axis=2)
    middle = np.maximum(told - 1, 0)[..., None] // 2
    medians = np.take_along_axis(np.sort(values, axis=2), middle, axis=2)[..., 0]  # NaN are sorted last
    enough = told >= np.maximum(SEEN * told.max(axis=1, keepdims=True), MIN_COLUMNS)
    chosen: Array = np.where(enough, medians, np.nan)
    return chosen
