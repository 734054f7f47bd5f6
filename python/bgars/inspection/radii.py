r"""Radii from shadows and silhouettes together: silhouettes know which ball is larger, shadows how large balls are.

What the model of the rim is wrong by (blur, a dark rim, a coarse pixel) it is wrong by on all balls alike, so that both
radii differ by the same on all. The scatter of their difference is the error of both, ball by ball: measured, not
modelled. With the errors s of a shadow, f of a silhouette, c of all shadows (lights, board), b of all silhouettes,

    d_i = r_i (silhouette) - r_i (shadow) = b + f_i - s_i - c.

Let m be the mean of d, V and F the variances of s and f with V + F that of d, B and C those of b and c, B known as well
as the finder says. The conditional mean of the radius, all errors normal and M the variance of m, is

    r_i (shadow) + w (d_i - m) + k m,   w = V / (V + F),   k = C / (B + C),

m drawn toward 0 by (B + C) / (B + C + M) = h, and its variance w F + (k - w)^2 h M + k B: the Kalman update of a ball
(Kalman 1960). Its height follows by the covariance of both.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from bgars.inspection.bundle import Solution

__all__ = ["MIN_POPULATION", "sharpen_radii"]

Array = NDArray[np.float64]

MIN_POPULATION = 6
OUTLIER = 3.5
ROUNDS = 5
RADIUS = 3
LEAST_SHARE = 0.25
"""Of the silhouettes in the scatter, however uncertain the fit says that shadows are: then the scatter knows better."""
LEAST_ALONE = 0.1
FLOOR_PX = 0.001


def sharpen_radii(solution: Solution, silhouette_px: Array, u_silhouette_px: Array) -> tuple[Array, Array]:
    """Balls (N, 5) and covariances (N, 5, 5) with radii, and heights with them, sharpened by silhouettes.

    Parameters
    ----------
    solution : Solution
        N balls from their shadows.
    silhouette_px, u_silhouette_px : (N,) float64
        Radii of the same balls from their silhouettes and their standard uncertainty, error common to all included.
        A radius that does not fit the others is not used, and its ball stays as it is.

    Notes
    -----
    Fewer than 6 balls that fit say nothing of their scatter: all stay.
    """
    balls, covariance = solution.balls.copy(), solution.covariance.copy()
    by_shadow, by_lights = covariance[:, RADIUS, RADIUS].copy(), float(solution.common_covariance[RADIUS, RADIUS])
    alone = np.maximum(by_shadow - by_lights, LEAST_ALONE * by_shadow)
    apart = silhouette_px - balls[:, RADIUS]
    good = np.ones(len(apart), dtype=np.bool_)
    if len(apart) < MIN_POPULATION:
        return balls, covariance
    usual = float(np.median(alone))
    middle = float(np.median(apart))
    scatter = 1.4826 * float(np.median(np.abs(apart - middle)))
    for _ in range(ROUNDS):
        # Scatter that a ball with usual shadows has; a part of it grows with a ball's own uncertainty.
        total = max(scatter, FLOOR_PX) ** 2
        share = max(1.0 - usual / total, LEAST_SHARE)
        shadow, silhouette = (1.0 - share) * total * alone / usual, share * total
        off = np.square(apart - middle) / (shadow + silhouette)
        good = off < OUTLIER**2
        if good.sum() < MIN_POPULATION:
            return balls, covariance
        weight = good / (shadow + silhouette)
        middle = float((weight * apart).sum() / weight.sum())
        # n - 3: the scatter of few balls is itself uncertain (JCGM 101:2008, 6.4.9.4).
        scatter = float(np.sqrt(total * off[good].sum() / (good.sum() - 3.0)))
    # What all radii are apart by, b - c: the silhouettes' common error less that of the shadows, through the lights.
    u_silhouette = float(np.median(np.square(u_silhouette_px[good])))
    known, prior = 1.0 / float(weight.sum()), u_silhouette + by_lights
    together = middle * prior / (prior + known)
    common, lean = by_lights / prior, shadow / (shadow + silhouette)
    step = lean * (apart - together) + common * together
    variance = lean * silhouette + (common - lean) ** 2 * known * prior / (prior + known) + common * u_silhouette
    lever = covariance[:, :, RADIUS] / by_shadow[:, None]
    change = lever[:, :, None] * lever[:, None, :] * (variance - by_shadow)[:, None, None]
    balls[good] += (lever * step[:, None])[good]
    covariance[good] += change[good]
    return balls, covariance
