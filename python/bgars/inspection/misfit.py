"""How much more than single points whole shadows scatter: relief of the board, and balls that are none.

Points of an edge err together where the board beside the ball is higher or a ball is not round: the residuals of a
shadow then have a mean and a tilt along the edge beyond what independent points explain. Per ball, over its lights,

    chi^2 = sum over shadows of c^T C^-1 c,   c = least squares of the residuals by 1, sin a, cos a,

C the covariance of c for independent points: 3 numbers a shadow, less what the fit takes. Its mean over the degrees of
freedom is the factor that variances are too small by (Birge 1932). Few shadows know their own factor badly: it is drawn
to the usual one as if that had been seen in `PRIOR_FREEDOM` numbers (the scaled inverse chi-squared prior of a
variance; Gelman et al., "Bayesian Data Analysis", 2013, section 2.6).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bgars.inspection.shadow_model import BALL_TERMS

if TYPE_CHECKING:
    from bgars.inspection.bundle_model import EdgeModel

__all__ = ["relief_px", "scatter_factors"]

Array = NDArray[np.float64]
BASIS = 3
MIN_POINTS = 4
"""Of a shadow, to have a mean and two tilts."""
FARTHEST_PX = 3.0
"""Points farther off are no edge of this shadow."""
PRIOR_FREEDOM = 6.0
"""Numbers that the usual factor counts for, against those of a ball: two shadows."""
TURNS_OF_LIGHT = 2


def scatter_factors(model: EdgeModel, weight: Array) -> Array:
    """(N,) factors, at least 1, on the variances of independent points; `weight` (N, L, S) over variances."""
    basis = np.stack([np.ones_like(model.angle_rad), np.sin(model.angle_rad), np.cos(model.angle_rad)], axis=-1)
    weighted = basis * weight[..., None]
    points = (weight > 0).sum(axis=2)
    seen = points >= MIN_POINTS
    information = weighted.swapaxes(-1, -2) @ basis
    right = (weighted * model.residual[..., None]).sum(axis=2)
    # A ridge: on a short piece of edge mean and tilts are nearly one.
    size = np.einsum("nlii->nl", information)[..., None, None] / BASIS
    fitted = np.linalg.solve(information + (1e-3 * size + 1e-12) * np.eye(BASIS), right[..., None])[..., 0]
    square = np.where(seen, (fitted * right).sum(axis=-1), 0.0).sum(axis=1)
    shadows = seen.sum(axis=1)
    # A light's two turns are fitted to all balls together, a ball's five numbers to its own shadows.
    taken = BALL_TERMS + TURNS_OF_LIGHT * shadows / max(len(shadows), 1)
    freedom = np.maximum(BASIS * shadows - taken, 0.0)
    enough = freedom > 0
    if not enough.any():
        return np.ones(len(shadows))
    usual = max(float(np.median(square[enough] / freedom[enough])), 1.0)
    factor: Array = (PRIOR_FREEDOM * usual + np.where(enough, square, 0.0)) / (PRIOR_FREEDOM + freedom)
    return np.maximum(factor, 1.0)


def relief_px(residual: Array) -> Array:
    """(N,) root mean square of what the board's relief puts the points of a ball's shadows off by, rejected ones too.

    The fit goes by the bulk of the points and rejects the others, but where the board is uneven nobody knows which of
    them lie on its plane: a ball whose shadows all fall on a trace or a second layer of mask is measured from there.
    Half of the mean square is the ball's own, half that of the part. Neighbouring stretches of an edge lie on the same
    relief and scatter each for itself: the mean product of neighbours is the mean square of the relief alone.

    Parameters
    ----------
    residual : (N, L, S) float64
        Distances of points to their edges in px, in order along them; NaN where there is none.
    """
    near = np.where(np.abs(residual) < FARTHEST_PX, residual, np.nan)
    product = near[..., 1:] * near[..., :-1]
    count = np.isfinite(product).sum(axis=(1, 2))
    total = np.nansum(product, axis=(1, 2))
    part = total.sum() / max(int(count.sum()), 1)
    own = np.where(count > 0, total / np.maximum(count, 1), part)
    relief: Array = np.sqrt(np.maximum(0.5 * (own + part), 0.0))
    return relief
