"""Where balls are against the ideal grid: true position and pitch."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["GridFit", "fit_grid"]

Array = NDArray[np.float64]
MIN_BALLS = 2
"""Two fix a grid's shift and turn."""


@dataclass(frozen=True, eq=False)
class GridFit:
    """The ideal grid laid through measured centres.

    Attributes
    ----------
    middle_um : (2,) float64
        Where the nominal origin lies in the image.
    angle_rad : float
        Turn of the grid, counter-clockwise.
    scale : float
        Size of the grid that was laid, 1 for the ideal one.
    free_scale : float
        Size of the grid that would fit best.
    u_free_scale : float
        Its standard uncertainty from that of the centres; an error of the pixel pitch adds to it.
    """

    middle_um: Array
    angle_rad: float
    scale: float
    free_scale: float
    u_free_scale: float

    def place(self, nominal_um: Array) -> Array:
        """(n, 2) places in the image of nominal places (n, 2)."""
        cosine, sine = math.cos(self.angle_rad), math.sin(self.angle_rad)
        turn = np.array([[cosine, -sine], [sine, cosine]])
        placed: Array = self.middle_um + self.scale * np.asarray(nominal_um, dtype=np.float64) @ turn.T
        return placed


def fit_grid(nominal_um: Array, centres_um: Array, u_centres_um: Array, *, free_scale: bool = False) -> GridFit | None:
    """Lay the ideal grid through the centres: least squares in shift and turn, every ball with the same weight.

    Parameters
    ----------
    nominal_um : (n, 2) float64
        Nominal places; with `free_scale` in any unit.
    centres_um : (n, 2) float64
        Measured centres of the same balls.
    u_centres_um : (n, 2) float64
        Their standard uncertainties; NaN = unknown.
    free_scale : bool
        Fit the pitch, too: where no nominal one is known.

    Returns
    -------
    GridFit or None
        None with fewer than two places: one ball lies on any grid.

    References
    ----------
    JEITA ED-7304, Measuring method for package dimensions of ball grid array: true position by the axes that fit all
    centres best. Umeyama, IEEE Trans. Pattern Anal. Mach. Intell. 13 (1991) 376, eqs. 40-42: turn, shift and scale.

    Examples
    --------
    >>> nominal = np.array([[-500.0, 0.0], [500.0, 0.0]])
    >>> fit = fit_grid(nominal, nominal * 1.001 + 7.0, np.full((2, 2), 0.2))
    >>> fit.place(nominal)[1].round(6).tolist(), round(fit.free_scale, 6)
    ([507.0, 7.0], 1.001)
    """
    if len(nominal_um) < MIN_BALLS:
        return None
    mean_nominal_um, mean_um = nominal_um.mean(axis=0), centres_um.mean(axis=0)
    p, c = nominal_um - mean_nominal_um, centres_um - mean_um
    power = float((p * p).sum())
    if power <= 0:
        return None
    along = float((p * c).sum())
    across = float((p[:, 0] * c[:, 1] - p[:, 1] * c[:, 0]).sum())
    angle_rad = math.atan2(across, along)
    best = math.hypot(along, across) / power
    # d(scale) = sum of p turned . d(centre) / power: the axes' uncertainties, weighted by how far out a ball is.
    cosine, sine = math.cos(angle_rad), math.sin(angle_rad)
    turned = p @ np.array([[cosine, sine], [-sine, cosine]])
    u_best = math.sqrt(float((turned**2 * u_centres_um**2).sum())) / power
    scale = best if free_scale else 1.0
    shift = scale * np.array(
        [
            cosine * mean_nominal_um[0] - sine * mean_nominal_um[1],
            sine * mean_nominal_um[0] + cosine * mean_nominal_um[1],
        ]
    )
    return GridFit(mean_um - shift, angle_rad, scale, best, u_best)
