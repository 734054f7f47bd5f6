"""Lights from shading of which only is known that it grows with the cosine to the light."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

__all__ = ["monotone_law"]

Array = NDArray[np.float64]

POLYNOMIAL, FIRST_TURN = 4, 0.1


def monotone_law(normals: Array, values: Array, used: NDArray[np.bool_], start: Array) -> tuple[Array, float]:
    """Direction under which the level is most nearly a function of n . l alone (a polynomial over the lit side)."""
    normals, values = normals[used], values[used]
    level = np.array([0.0, 0.0, 1.0]) if abs(start[2]) < 0.9 else np.array([1.0, 0.0, 0.0])  # noqa: PLR2004
    one = np.cross(level, start)
    one /= np.linalg.norm(one)
    two = np.cross(start, one)

    def direction(p: Array) -> Array:
        vector: Array = start + p[0] * one + p[1] * two
        return vector / np.linalg.norm(vector)

    def left(p: Array) -> float:
        cosine = normals @ direction(p)
        lit = cosine > 0.15  # noqa: PLR2004 - away from the attached shadow
        rows = np.vander(cosine[lit], POLYNOMIAL + 1)
        law, *_ = np.linalg.lstsq(rows, values[lit], rcond=None)
        off = np.abs(values[lit] - rows @ law)
        return float(np.mean(np.minimum(off, 4.0 * np.median(off)) ** 2))

    # Without a first simplex its steps from 0 are a hundredth of a degree.
    simplex = FIRST_TURN * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    options: Any = {"maxiter": 120, "xatol": 1e-4, "initial_simplex": simplex}
    best = minimize(left, np.zeros(2), method="Nelder-Mead", options=options)
    return direction(best.x), math.sqrt(float(best.fun))
