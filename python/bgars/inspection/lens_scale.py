r"""Size of a pixel and distortion of the lens, from the recipe's grid: what every length is multiplied by.

A pixel pitch that is off by a share scales every length; a lens with radial distortion (Brown 1971, first term) puts
what is at x at ``x (1 + k r^2 / r_c^2)``, r_c the distance of the image's corner from its middle. Balls stand on their
grid to some micrometres, so that the grid of a whole part tells both far better than a ruler:

    c_i = t + (1 + a) R n_i + k (r_i / r_c)^2 c_i

with c measured and n nominal centres, R a turn. Robust least squares give a and k; the priors of both are mixtures
(:mod:`bgars.inspection.common_terms`): a pitch that was measured, and one that was typed in; a lens for measuring, and
another.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bgars.inspection.common_terms import Mixture, posterior

__all__ = ["LensScale", "fit_lens_scale"]

Array = NDArray[np.float64]

PIXEL_PITCH = Mixture(0.00017, 0.006, 0.15)
"""Relative error of the declared pixel pitch: calibrated with a grid (its lines 0.01 %, their image 0.1 of 1000 pixels,
focus and temperature of a measuring lens since then 0.01 %), or taken from a data sheet."""
DISTORTION = Mixture(0.0003, 0.004, 0.15)
"""Displacement at the image's corner over its distance from the middle: telecentric or macro lens, and others."""
RECIPE_PITCH = 0.0003
"""Relative standard uncertainty of a recipe's pitch where it is not declared: substrates are etched to that."""
UNKNOWN = 10.0
"""Relative standard deviation of what is not known: ten times the whole."""
MIN_BALLS = 6
"""Fewer say little of two numbers beside shift and turn."""
ROUNDS = 8
OUTLIER = 3.0
"""Scatters of a ball from its place at which its weight is a quarter."""
MEDIAN_LENGTH = 1.1774
"""Median length of a normal vector in the plane, in standard deviations."""
FLOOR_UM = 0.05
"""Least scatter of balls around their grid."""


class LensScale(NamedTuple):
    """Lengths in the image over true ones are ``1 + scale + distortion * (r / corner)^2``; (2, 2) covariance of both.

    `corner_um` is infinite where nothing is known of the image's size.
    """

    scale: float
    distortion: float
    covariance: Array
    corner_um: float

    def factor(self, x_um: Array, y_um: Array) -> Array:
        """What places are multiplied by to become true ones."""
        return 1.0 / (1.0 + self.scale + self.distortion * self._square(x_um, y_um))

    def length_factor(self, x_um: Array, y_um: Array) -> Array:
        """The same of lengths at a place, mean over directions.

        ``d(x (1 + k r^2)) / dx`` is ``1 + 3 k r^2`` outward and ``1 + k r^2`` across.
        """
        return 1.0 / (1.0 + self.scale + 2.0 * self.distortion * self._square(x_um, y_um))

    def u_share(self, x_um: Array, y_um: Array, *, turns: float = 1.0) -> Array:
        """(N, 2) relative change of places (`turns` 1) or lengths (2) by two independent sources of deviation 1.

        They are those of the covariance's triangular root.
        """
        root = np.linalg.cholesky(self.covariance + 1e-18 * np.eye(2))
        design = np.stack([np.ones_like(x_um), turns * self._square(x_um, y_um)], axis=-1)
        share: Array = design @ root
        return share

    def _square(self, x_um: Array, y_um: Array) -> Array:
        square: Array = (np.square(x_um) + np.square(y_um)) / self.corner_um**2
        return square


def fit_lens_scale(
    nominal_um: Array,
    centres_um: Array,
    u_centres_um: Array,
    corner_um: float,
    u_pixel_pitch: float | None,
    u_recipe_pitch: float | None,
) -> LensScale:
    """Scale and distortion of the image.

    Parameters
    ----------
    nominal_um, centres_um, u_centres_um : (n, 2) float64
        Places of the recipe, measured centres from the image's middle, and their standard uncertainties; none without
        a recipe.
    corner_um : float
        Distance of the image's corner from its middle.
    u_pixel_pitch, u_recipe_pitch : float or None
        Relative standard uncertainties where they are declared.
    """
    mean, covariance = np.zeros(2), np.diag([UNKNOWN, UNKNOWN]) ** 2
    if len(nominal_um) >= MIN_BALLS:
        mean, covariance = _by_grid(nominal_um, centres_um, u_centres_um, corner_um)
        covariance[0, 0] += (u_recipe_pitch or RECIPE_PITCH) ** 2
    pitch = PIXEL_PITCH if u_pixel_pitch is None else Mixture(u_pixel_pitch, u_pixel_pitch, 0.0)
    # Least squares know no prior: a normal one of ten times the whole changes nothing.
    prior = np.full(2, UNKNOWN)
    with_prior = np.linalg.inv(np.linalg.inv(covariance) + np.diag(prior**-2.0))
    mean, covariance, _ = posterior(mean, with_prior, prior, [pitch, DISTORTION])
    return LensScale(float(mean[0]), float(mean[1]), covariance, corner_um)


def _by_grid(nominal_um: Array, centres_um: Array, u_centres_um: Array, corner_um: float) -> tuple[Array, Array]:
    """Least-squares scale and distortion (2,) and their covariance (2, 2); robust against balls out of place."""
    n, c = nominal_um - nominal_um.mean(axis=0), centres_um
    square = np.square(c).sum(axis=1) / corner_um**2
    # Unknowns: shift along x and y, (1 + a) cos, (1 + a) sin, k.
    one, zero = np.ones(len(n)), np.zeros(len(n))
    design = np.concatenate(
        [
            np.column_stack([one, zero, n[:, 0], -n[:, 1], square * c[:, 0]]),
            np.column_stack([zero, one, n[:, 1], n[:, 0], square * c[:, 1]]),
        ]
    )
    target = np.concatenate([c[:, 0], c[:, 1]])
    # Columns of like size, for the inverse.
    size = np.linalg.norm(design, axis=0)
    design = design / size
    weight = np.ones(len(n))
    solution, spread_um = np.zeros(5), 1.0
    u_um = float(np.median(np.hypot(u_centres_um[:, 0], u_centres_um[:, 1]))) / np.sqrt(2.0)
    for _ in range(ROUNDS):
        both = np.concatenate([weight, weight])[:, None]
        solution = np.linalg.solve((design * both).T @ design + 1e-12 * np.eye(5), (design * both).T @ target)
        off = np.hypot(*(target - design @ solution).reshape(2, -1))
        spread_um = max(float(np.median(off)) / MEDIAN_LENGTH, u_um, FLOOR_UM)
        weight = 1.0 / (1.0 + np.square(off / (OUTLIER * spread_um))) ** 2
    both = np.concatenate([weight, weight])[:, None]
    freedom = max(2.0 * float(weight.sum()) - 5.0, 1.0)
    # Few balls know their own scatter badly (JCGM 101:2008, 6.4.9.4).
    variance = spread_um**2 * freedom / max(freedom - 2.0, 1.0)
    inverse = np.linalg.inv((design * both).T @ design + 1e-12 * np.eye(5)) * variance / np.outer(size, size)
    solution = solution / size
    length = float(np.hypot(solution[2], solution[3]))
    by = np.zeros((2, 5))
    by[0, 2:4] = solution[2:4] / length
    by[1, 4] = 1.0
    return np.array([length - 1.0, solution[4]]), by @ inverse @ by.T
