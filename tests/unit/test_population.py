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
    u_q = [float(priors_after(-z * 0.037, 0.037, LIMITS[0])[3]) for z in (1.0, 2.0, 2.7, 3.2)]
    # Chances by hand: 1 % beforehand, the normal densities of both kinds at that q; below 5 % it is not in U.
    density = {z: np.exp(-0.5 * z**2 * np.array([1.0, 1.0 / (1.0 + (ODD_SPREAD / 0.037) ** 2)])) for z in (2.7, 3.2)}
    for z, got in zip((2.7, 3.2), u_q[2:], strict=True):
        odd = 0.01 * density[z][1] / np.hypot(1.0, ODD_SPREAD / 0.037)
        assert got == pytest.approx(ODD_SPREAD * np.sqrt(odd / (odd + 0.99 * density[z][0])), rel=0.15)
    assert u_q[0] == u_q[1] < LIMITS[1] < u_q[2] < u_q[3] < FREE


def test_sharp_shadows_leave_nothing_between() -> None:
    assert priors_after(-0.004 * 2.9, 0.004, LIMITS[0])[3] <= LIMITS[1]
    assert priors_after(-0.004 * 8.0, 0.004, LIMITS[0])[3] == FREE
