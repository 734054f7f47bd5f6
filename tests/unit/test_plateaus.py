"""Edges moved by levels that are cut off at zero."""

from __future__ import annotations

import numpy as np
import pytest
from bgars.inspection.plateaus import _lifted


@pytest.mark.parametrize("low", [0.0, 0.7, 3.0])
def test_noise_cut_off_at_zero_lifts_the_mean(low: float) -> None:
    noisy = np.random.default_rng(0).normal(low, 1.0, 400_000)
    # The level that is handed on is the one that was read, lifted already where it is black.
    read = float(np.maximum(noisy, 0.0).mean())
    lifted = read - low
    assert _lifted(read if low == 0.0 else low + 0.4, 1.0, 0.0) == pytest.approx(lifted, abs=0.03)
