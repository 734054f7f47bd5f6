"""Parts through a station that is wrong in every way that a calibration can find, calibrated on its own pictures."""

from __future__ import annotations

from pathlib import Path

import pytest


@pytest.mark.filterwarnings("ignore::bgars.CaptureWarning")
def test_a_calibrated_station_measures_as_exact_knowledge_does(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "docs"))
    from station_trial import trial  # noqa: PLC0415 - a script of the documentation

    exact, calibrated, uncalibrated = trial(4)
    assert exact.balls == calibrated.balls == 36
    # Height, diameter, x, y.
    assert (calibrated.rms_um < 1.5 * exact.rms_um).all()
    assert (uncalibrated.rms_um > 3.0 * exact.rms_um).all()
