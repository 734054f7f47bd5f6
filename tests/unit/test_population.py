"""Which balls are round, from what their shadows say of q, and how sure that is."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from bgars.inspection.population import FREE, LIMITS, ODD_SPREAD, q_spread
from numpy.typing import NDArray

COUNT = 30


def priors_after(off: float, u_shadow: float, u_prior: float) -> NDArray[np.float64]:
    """Standard deviations of the priors of q, where shadows know each q to `u_shadow` and that of ball 3 is off."""
    random = np.random.default_rng(4)
    by_shadow = u_shadow * random.standard_normal(COUNT)
    by_shadow[3] = off
    information = u_shadow**-2.0 + u_prior**-2.0
    balls = np.zeros((COUNT, 5))
    balls[:, 4] = 1.0 + by_shadow * u_shadow**-2.0 / information
    alone = np.tile(np.eye(5), (COUNT, 1, 1))
    alone[:, 4, 4] = 1.0 / information
    solution = SimpleNamespace(alone=alone, balls=balls, common=np.zeros(8))
    return q_spread(solution, np.full(COUNT, u_prior))  # type: ignore[arg-type]


@pytest.mark.parametrize("u_prior", [3e-4, 0.2])
def test_a_tight_prior_hides_no_flat_ball_from_faint_shadows(u_prior: float) -> None:
    u_q = priors_after(-0.16, 0.037, u_prior)
    assert u_q[3] == FREE
    assert np.delete(u_q, 3).max() < 3.0 * LIMITS[1]


def test_what_shadows_do_not_tell_is_between_and_round_ones_stay_round() -> None:
    u_shadow = 0.037
    u_q = {z: float(priors_after(-z * u_shadow, u_shadow, LIMITS[0])[3]) for z in (1.0, 2.0, 2.9, 3.3)}
    scatter = u_q[1.0]
    for z in (2.9, 3.3):
        # Bayes by hand: one ball in a hundred, both normal densities; what is less likely than 5 % is not in U.
        round_u, odd_u = np.hypot(u_shadow, scatter), np.hypot(u_shadow, ODD_SPREAD)
        as_round = 0.99 / round_u * np.exp(-0.5 * (z * u_shadow / round_u) ** 2)
        as_odd = 0.01 / odd_u * np.exp(-0.5 * (z * u_shadow / odd_u) ** 2)
        chance = as_odd / (as_odd + as_round)
        assert u_q[z] == pytest.approx(np.sqrt(chance * ODD_SPREAD**2 + (1.0 - chance) * scatter**2), rel=0.01)
    assert max(scatter, u_q[2.0]) <= LIMITS[1] < u_q[2.9] < u_q[3.3] < FREE


def test_sharp_shadows_leave_nothing_between() -> None:
    assert priors_after(-0.004 * 2.9, 0.004, LIMITS[0])[3] <= LIMITS[1]
    assert priors_after(-0.004 * 8.0, 0.004, LIMITS[0])[3] == FREE
