"""Coplanarity of measured apexes with its uncertainty and its noise bias."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bgars.inspection.facets import hull_facets
from bgars.inspection.planes import ReferencePlane, off_lines, regression_plane, seating_planes

__all__ = ["Coplanarity", "measure_coplanarity", "quiet_heights", "seating_budget"]

Array = NDArray[np.float64]
DRAWS = 256
DRAWN_APEXES = 1 << 18
"""Noisy apexes in memory at once; the result does not depend on it."""
SEED = 20_240_229
MIN_BALLS = 3
"""Three carry a plane."""
OUTLIER = 4.0
"""Residuals beyond this many standard deviations are defects, not noise."""
MAD_TO_SIGMA = 1.4826
WORTH_TELLING = 0.05
"""Causes of less than this share of an uncertainty are not listed."""
MAX_LOST = 0.01
"""Share of draws in which the part may fall over before its coplanarity has no uncertainty."""


@dataclass(frozen=True, eq=False)
class Coplanarity:
    """Both readings of coplanarity.

    A largest deviation is biased by noise: of many noisy apexes one always sticks out. `bias_um` says by how much the
    reading is too large on average; it is not subtracted from the reading.

    Attributes
    ----------
    seating : tuple of ReferencePlane
        Every plane on which the part comes to rest, the worst first; empty where it does not stand.
    regression : ReferencePlane or None
        Least-squares plane through the highest apex.
    seating_um, u_seating_um, seating_bias_um : float
        Worst coplanarity by seating plane, its standard uncertainty, its noise bias; NaN where unknown.
    regression_um, u_regression_um, regression_bias_um : float
        The same by regression plane.
    """

    seating: tuple[ReferencePlane, ...]
    regression: ReferencePlane | None
    seating_um: float
    u_seating_um: float
    seating_bias_um: float
    regression_um: float
    u_regression_um: float
    regression_bias_um: float


def measure_coplanarity(
    apexes_um: Array,
    u_apexes_um: Array,
    gravity_um: Array,
    shared_um: Array | None = None,
    *,
    draws: int = DRAWS,
    seed: int = SEED,
) -> Coplanarity:
    """Measure coplanarity from apexes and their standard uncertainties.

    Monte Carlo (JCGM 101:2008): noise of the stated size is added to a quiet part (:func:`quiet_heights`) `draws`
    times. The spread of its coplanarity is the standard uncertainty, the mean less the quiet part's own is the bias.
    An error that all apexes share moves no plane against them; one that grows from ball to ball does.

    Parameters
    ----------
    apexes_um : (n, 3) float64
        Tops of the balls in the world.
    u_apexes_um : (n, 3) float64
        Standard uncertainties of each alone; NaN = unknown, which leaves uncertainty and bias NaN.
    gravity_um : (2,) float64
        Centre of gravity.
    shared_um : (n, M) float64, optional
        What M independent sources of standard deviation 1 put the heights off by.
    draws : int
        Number of noisy parts.
    seed : int
        Of the noise: the same numbers give the same result.

    Examples
    --------
    >>> x, y = np.meshgrid(np.arange(16) * 1000.0, np.arange(16) * 1000.0)
    >>> noise = np.random.default_rng(1).normal(0.0, 1.0, 256)
    >>> found = measure_coplanarity(np.column_stack([x.ravel(), y.ravel(), noise]), np.ones((256, 3)), np.full(2, 7500))
    >>> bool(4.5 < found.seating_um < 7.0), bool(4.5 < found.seating_bias_um < 7.0)
    (True, True)
    """
    seating, regression = seating_planes(apexes_um, gravity_um), regression_plane(apexes_um)
    seating_um = seating[0].coplanarity_um if seating else math.nan
    regression_um = regression.coplanarity_um if regression else math.nan
    unknown = (math.nan, math.nan)
    if regression is None or not np.isfinite(u_apexes_um).all():
        return Coplanarity(seating, regression, seating_um, *unknown, regression_um, *unknown)
    quiet_um = apexes_um.copy()
    quiet_um[:, 2] = quiet_heights(apexes_um, u_apexes_um[:, 2])
    random = np.random.default_rng(seed)
    stood_um, leaned_um = [], []
    at_once = max(1, DRAWN_APEXES // len(apexes_um))
    for first in range(0, draws, at_once):
        noise = random.standard_normal((min(at_once, draws - first), *apexes_um.shape))
        noisy_um = quiet_um + noise * u_apexes_um
        if shared_um is not None:
            together = random.standard_normal((len(noise), shared_um.shape[1]))
            noisy_um[:, :, 2] += np.einsum("dm,nm->dn", together, shared_um)
        leaned_um.append(_regression_um(quiet_um, noisy_um[:, :, 2]))
        if seating:
            stood_um.append(_seating_um(noisy_um, gravity_um))
    spread = _spread(np.concatenate(stood_um), _quiet_seating_um(quiet_um, gravity_um)) if seating else unknown
    quiet_regression = regression_plane(quiet_um)
    quiet_regression_um = quiet_regression.coplanarity_um if quiet_regression else math.nan
    return Coplanarity(
        seating,
        regression,
        seating_um,
        *spread,
        regression_um,
        *_spread(np.concatenate(leaned_um), quiet_regression_um),
    )


def seating_budget(
    coplanarity: Coplanarity, apexes_um: Array, gravity_um: Array, shared_um: Array, causes: tuple[str, ...], rest: str
) -> dict[str, float]:
    """Standard uncertainty of the seating coplanarity by cause, um, largest first.

    Each source is moved by its standard deviation alone (JCGM 100:2008, 5.1.3, note 2); `rest` is the name of what
    they leave of the Monte Carlo's.

    Parameters
    ----------
    coplanarity : Coplanarity
        Of these apexes.
    apexes_um, gravity_um, shared_um
        As for :func:`measure_coplanarity`.
    causes : tuple of str
        Names of the M sources.
    rest : str
    """
    u_um = coplanarity.u_seating_um
    if not math.isfinite(u_um) or not shared_um.shape[1]:
        return {}
    moved_um = np.repeat(apexes_um[None], shared_um.shape[1], axis=0)
    moved_um[:, :, 2] += shared_um.T
    change_um = np.nan_to_num(_seating_um(moved_um, gravity_um) - coplanarity.seating_um)
    parts: dict[str, float] = {}
    for name, change in zip(causes, change_um.tolist(), strict=True):
        parts[name] = parts.get(name, 0.0) + change**2
    parts[rest] = max(u_um**2 - sum(parts.values()), 0.0)
    kept = {name: math.sqrt(part) for name, part in parts.items() if part >= (WORTH_TELLING * u_um) ** 2}
    return dict(sorted(kept.items(), key=lambda pair: -pair[1]))


def quiet_heights(apexes_um: Array, u_z_um: Array) -> Array:
    """Heights with the spread that is left when that of the noise is taken off.

    Residuals from the least-squares plane are drawn together by ``sqrt(tau^2 / (tau^2 + u^2))``, with ``tau^2 = s^2 -
    u^2`` the variance that noise does not explain: the constrained estimate of Louis (1984), whose spread is that of
    the true heights, not the smaller one of the best guesses. A ball off by more than four standard deviations is a
    defect and keeps its height.

    Parameters
    ----------
    apexes_um : (n, 3) float64
        Measured tops.
    u_z_um : (n,) float64
        Standard uncertainties of the heights.

    Returns
    -------
    (n,) float64

    References
    ----------
    T. A. Louis, Estimating a population of parameter values using Bayes and empirical Bayes methods, J. Am. Stat.
    Assoc. 79 (1984) 393-398.
    """
    design = np.column_stack([apexes_um[:, :2] - apexes_um[:, :2].mean(axis=0), np.ones(len(apexes_um))])
    plane_um = design @ np.linalg.lstsq(design, apexes_um[:, 2], rcond=None)[0]
    residuals_um = apexes_um[:, 2] - plane_um
    freedom = len(residuals_um) - MIN_BALLS
    if freedom <= 0:
        return apexes_um[:, 2].copy()
    rough_um = MAD_TO_SIGMA * float(np.median(np.abs(residuals_um)))
    ordinary = np.abs(residuals_um) <= OUTLIER * max(rough_um, float(np.sqrt(np.mean(u_z_um**2))))
    variance = float(np.sum(residuals_um[ordinary] ** 2)) / max(int(ordinary.sum()) - MIN_BALLS, 1)
    left = max(variance - float(np.mean(u_z_um[ordinary] ** 2)), 0.0)
    total = left + u_z_um**2
    factor = np.sqrt(np.divide(left, total, out=np.ones_like(total), where=total > 0))
    quiet: Array = plane_um + np.where(ordinary, factor, 1.0) * residuals_um
    return quiet


def _spread(draws_um: Array, quiet_um: float) -> tuple[float, float]:
    """Standard deviation and bias; NaN where the part fell over too often."""
    stands = np.isfinite(draws_um)
    if stands.mean() < 1.0 - MAX_LOST or not math.isfinite(quiet_um):
        return math.nan, math.nan
    return float(draws_um[stands].std(ddof=1)), max(float(draws_um[stands].mean()) - quiet_um, 0.0)


def _quiet_seating_um(quiet_um: Array, gravity_um: Array) -> float:
    planes = seating_planes(quiet_um, gravity_um)
    return planes[0].coplanarity_um if planes else math.nan


def _seating_um(noisy_um: Array, gravity_um: Array) -> Array:
    """(d,) coplanarity by seating plane of d parts; NaN where one does not stand."""
    middle_um = noisy_um.mean(axis=0)
    size_um = float(np.abs(middle_um[:, :2] - gravity_um).max())
    design = np.column_stack([(middle_um[:, :2] - gravity_um) / size_um, np.ones(len(middle_um))])
    tilt = np.linalg.lstsq(design, middle_um[:, 2], rcond=None)[0]
    ground = (noisy_um[:, :, :2] - gravity_um) / size_um
    z_um = noisy_um[:, :, 2] - ground @ tilt[:2] - tilt[2]
    range_um = max(float(np.ptp(z_um)), 1e-9 * size_um)
    z = z_um / range_um
    corners, _ = hull_facets(ground, z, off_lines(design[:, :2]))
    stands = corners.max(axis=1) < z.shape[1]
    corners = np.where(stands[:, None], corners, np.arange(3))
    feet = np.take_along_axis(ground, corners[:, :, None], axis=1)
    tops = np.take_along_axis(z, corners, axis=1)
    one, two = feet[:, 1] - feet[:, 0], feet[:, 2] - feet[:, 0]
    rise = tops[:, 1:] - tops[:, :1]
    area = one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]
    slope_x = (rise[:, 0] * two[:, 1] - rise[:, 1] * one[:, 1]) / area
    slope_y = (one[:, 0] * rise[:, 1] - two[:, 0] * rise[:, 0]) / area
    room = ground[:, :, 0] * slope_x[:, None] + ground[:, :, 1] * slope_y[:, None] - z
    total_x = (slope_x * range_um + tilt[0]) / size_um
    total_y = (slope_y * range_um + tilt[1]) / size_um
    largest = np.ptp(room, axis=1) * range_um / np.sqrt(1.0 + total_x**2 + total_y**2)
    coplanarity_um: Array = np.where(stands, largest, math.nan)
    return coplanarity_um


def _regression_um(quiet_um: Array, z_um: Array) -> Array:
    """(d,) coplanarity by regression plane; (d, n) heights over the same places."""
    design = np.column_stack([quiet_um[:, :2] - quiet_um[:, :2].mean(axis=0), np.ones(len(quiet_um))])
    planes = np.einsum("kn,dn->kd", np.linalg.pinv(design), z_um)
    residuals_um = z_um - np.einsum("nk,kd->dn", design, planes)
    largest: Array = np.ptp(residuals_um, axis=1) / np.sqrt(1.0 + planes[0] ** 2 + planes[1] ** 2)
    return largest
