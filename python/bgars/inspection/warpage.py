"""Warpage: how far the board under the balls is from a plane."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

__all__ = ["board_height_um", "board_terms", "warpage"]

Array = NDArray[np.float64]
SAMPLES = 41
MIN_BALLS = 3
"""Under fewer there is no area that could be warped."""


def board_terms(x_um: Array, y_um: Array) -> Array:
    """(n, 6) terms 1, x, y, x^2, x y, y^2 of the board's height."""
    return np.column_stack([np.ones_like(x_um), x_um, y_um, x_um**2, x_um * y_um, y_um**2])


def board_height_um(coefficients_um: Array, x_um: Array, y_um: Array) -> Array:
    """(n,) height of the board; a constant that is unknown counts as 0, for only the shape matters."""
    coefficients_um = np.where([math.isnan(coefficients_um[0]), *[False] * 5], 0.0, coefficients_um)
    height_um: Array = board_terms(x_um, y_um) @ coefficients_um
    return height_um


def warpage(coefficients_um: Array, covariance: Array | None, centres_um: Array) -> tuple[float, float]:
    """Highest less lowest point of the board against its least-squares plane, over the rectangle of the balls.

    Parameters
    ----------
    coefficients_um : (6,) float64
        Board height z = c0 + c1 x + c2 y + c3 x^2 + c4 x y + c5 y^2.
    covariance : (6, 6) float64 or None
        Of the coefficients.
    centres_um : (n, 2) float64
        Balls: the rectangle around them is the measured area.

    Returns
    -------
    (float, float)
        Warpage and its standard uncertainty (to first order); NaN where unknown,
        and for fewer than three balls.

    References
    ----------
    JEDEC JESD22-B112, Package warpage measurement of surface-mount integrated circuits at elevated temperature:
    highest less lowest point against the least-squares plane.

    Examples
    --------
    >>> corners = np.array([[-1000.0, -1000.0], [1000.0, -1000.0], [1000.0, 1000.0]])
    >>> round(warpage(np.array([0.0, 0.02, 0.0, -5e-6, 0.0, -5e-6]), None, corners)[0], 6)
    10.0
    """
    if not np.isfinite(coefficients_um[1:]).all() or len(centres_um) < MIN_BALLS:
        return math.nan, math.nan
    low, high = centres_um.min(axis=0), centres_um.max(axis=0)
    x_um, y_um = np.meshgrid(np.linspace(low[0], high[0], SAMPLES), np.linspace(low[1], high[1], SAMPLES))
    size_um = max(float(np.ptp(centres_um, axis=0).max()), 1.0)
    terms = board_terms(x_um.ravel(), y_um.ravel())
    design = np.column_stack([terms[:, 0], *((terms[:, 1:3] - (low + high) / 2) / size_um).T])
    bend = terms[:, 3:] - design @ np.linalg.lstsq(design, terms[:, 3:], rcond=None)[0]
    shape_um = bend @ coefficients_um[3:]
    top, bottom = int(shape_um.argmax()), int(shape_um.argmin())
    if covariance is None:
        return float(np.ptp(shape_um)), math.nan
    gradient = bend[top] - bend[bottom]
    variance = float(gradient @ covariance[3:, 3:] @ gradient)
    return float(np.ptp(shape_um)), math.sqrt(variance) if variance >= 0 else math.nan
