"""What integration makes of small errors of the lights: one bow or tilt over the whole part.

A degree of error that grows from the middle of the image to its edge (lights near the part, taken as distant; wrong
elevations; a lens) bends a flat part by half of that slope times half of its width. Normals do not show whether a bow
is real; so it is said, and can be taken away.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from bgars.records.height_map import HeightMap

__all__ = ["Bow", "Flatten", "find_bow", "flattened"]

Array = NDArray[np.float64]
Flatten = Literal["plane", "quadratic"]

SAMPLE = 20_000
ROUNDS = 8
SHARE = 0.9
"""Share of the variance of heights, without their plane, that one bow must have: the rest of the part is flat."""
SLOPE_LIMIT_DEG = 25.0
"""Slope at the edge up to which a bow may come from the lights: LEDs at one part's width make 20 degrees."""
U_SLOPE_DEG = 1.0
"""Error of the normals at the edge that nobody can exclude without a calibration: a table of lights is good to that."""
MIN_PIXELS = 100


@dataclass(frozen=True)
class Bow:
    """A bow that may be the lights' doing.

    Attributes
    ----------
    height_px : float
        From the middle to the edge; positive: a dome.
    width_px : float
        Of the part.
    slope_deg : float
        At the edge.
    """

    height_px: float
    width_px: float
    slope_deg: float

    def __str__(self) -> str:
        shape = "dome" if self.height_px > 0 else "bowl"
        return (
            f"nearly all of the height is one {shape} of {abs(self.height_px):.0f} px over {self.width_px:.0f} px, as "
            "near lights, or lights wrong by some degrees, cause on a flat part. If the part is flat, use --flatten "
            "quadratic; to find out, calibrate the lights (positions, or a flat reference)"
        )


def find_bow(height: HeightMap) -> Bow | None:
    """Find a bow that dominates a height map; None where there is none, or it is too steep to be the lights'.

    Parameters
    ----------
    height : HeightMap
    """
    rows, cols, z = _sample(height)
    if len(z) < MIN_PIXELS:
        return None
    design = _terms(rows, cols, "quadratic", height.mask.shape)
    plane = z - design[:, :3] @ _robust(design[:, :3], z)
    coefficients = _robust(design, z)
    left = z - design @ coefficients
    half = max(height.mask.shape) / 2.0
    bow = -float(coefficients[3] + coefficients[4]) / 2.0
    reach = float(np.percentile(np.hypot(design[:, 1], design[:, 2]), 98.0))
    sag, width = bow * reach**2, 2.0 * reach * half
    slope_deg = math.degrees(math.atan(2.0 * abs(bow) * reach / half))
    spread = float(np.var(plane))
    if spread <= 0.0 or 1.0 - float(np.var(left)) / spread < SHARE:
        return None
    if not U_SLOPE_DEG < slope_deg < SLOPE_LIMIT_DEG:
        return None
    return Bow(sag, width, slope_deg)


def flattened(height: HeightMap, form: Flatten) -> HeightMap:
    """Return a height map without its plane, or its quadratic surface; each fitted to all parts together.

    Parameters
    ----------
    height : HeightMap
    form : {"plane", "quadratic"}

    Examples
    --------
    >>> import numpy as np
    >>> from bgars import HeightMap
    >>> y, x = np.mgrid[:60, :80]
    >>> dome = HeightMap.from_array(30.0 - 0.01 * ((x - 40.0) ** 2 + (y - 30.0) ** 2))
    >>> float(np.ptp(flattened(dome, "quadratic").height_px)) < 1e-3
    True
    """
    rows, cols, z = _sample(height)
    coefficients = _robust(_terms(rows, cols, form, height.mask.shape), z)
    result = height.height_px.copy()
    where = np.nonzero(height.mask)
    result[where] -= (_terms(where[0], where[1], form, height.mask.shape) @ coefficients).astype(np.float32)
    return replace(height, height_px=result)


def _sample(height: HeightMap) -> tuple[NDArray[np.intp], NDArray[np.intp], Array]:
    rows, cols = np.nonzero(height.mask)
    step = max(1, len(rows) // SAMPLE)
    rows, cols = rows[::step], cols[::step]
    return rows, cols, height.height_px[rows, cols].astype(np.float64)


def _terms(rows: NDArray[np.intp], cols: NDArray[np.intp], form: Flatten, shape: tuple[int, ...]) -> Array:
    """(N, 3) or (N, 6) terms of the surface, in half widths from the middle."""
    half = max(shape) / 2.0
    x, y = (cols + 0.5 - shape[1] / 2.0) / half, (shape[0] / 2.0 - rows - 0.5) / half
    plane = [np.ones_like(x), x, y]
    return np.column_stack(plane if form == "plane" else [*plane, x**2, y**2, x * y])


def _robust(design: Array, z: Array) -> Array:
    """Least squares that balls, steps and holes do not pull: weights of a Cauchy distribution."""
    weight = np.ones(len(z))
    solution: Array = np.zeros(design.shape[1])
    for _ in range(ROUNDS):
        scaled = design * weight[:, None]
        solution = np.asarray(np.linalg.lstsq(scaled.T @ design, scaled.T @ z, rcond=None)[0], np.float64)
        left = z - design @ solution
        scale = 1.4826 * float(np.median(np.abs(left))) + 1e-9
        weight = 1.0 / (1.0 + (left / (2.0 * scale)) ** 2)
    return solution
