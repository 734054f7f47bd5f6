"""Old names of fields work for one release, and say so."""

from __future__ import annotations

from dataclasses import replace

import bgars
import numpy as np
import pytest


@pytest.fixture(scope="module")
def field() -> bgars.NormalField:
    images = np.full((4, 2, 3), 100, np.uint8)
    return bgars.estimate_normals(images, bgars.LightRig.ring(4).directions, method="lambertian")


def test_old_names_are_read_with_a_warning(field: bgars.NormalField) -> None:
    with pytest.warns(DeprecationWarning, match="NormalField.choice is called method_reason now"):
        assert field.choice == field.method_reason  # type: ignore[attr-defined]
    with pytest.warns(DeprecationWarning, match="NormalField.measured is called is_measured now") as told:
        assert field.measured is field.is_measured  # type: ignore[attr-defined]
    assert told[0].filename == __file__, "the warning names the line that is to be changed"


def test_old_names_are_taken_with_a_warning(field: bgars.NormalField) -> None:
    with pytest.warns(DeprecationWarning, match="choice") as told:
        changed = replace(field, choice="mine")  # type: ignore[call-arg]
    assert changed.method_reason == "mine"
    assert len(told) == 1


def test_readings_of_balls_have_their_old_names() -> None:
    ball = bgars.BallResult("A1", 0, 0, True, "pass", (), aspect_ratio=0.9, u_flat_top_depth_um=2.0)
    with pytest.warns(DeprecationWarning, match="BallResult.q is called aspect_ratio now"):
        assert ball.q == 0.9  # type: ignore[attr-defined]
    with pytest.warns(DeprecationWarning, match="BallResult.u_flat_um is called u_flat_top_depth_um now"):
        assert ball.u_flat_um == 2.0  # type: ignore[attr-defined]
    with pytest.warns(DeprecationWarning, match="PartRecipe.u_q"):
        part = bgars.PartRecipe("p", bgars.BallLayout(2, 2, 1000.0), u_q=0.02)  # type: ignore[call-arg]
    assert (part.aspect_ratio, part.u_aspect_ratio) == (1.0, 0.02)
    with pytest.warns(DeprecationWarning, match="Limits.flat_um"):
        assert bgars.Limits(flat_um=3.0) == bgars.Limits(flat_top_depth_um=3.0)  # type: ignore[call-arg]


def test_old_names_are_not_completed(field: bgars.NormalField) -> None:
    ball = bgars.BallResult("A1", 0, 0, True, "pass", ())
    assert not {"measured", "choice"} & set(dir(field))
    assert not {"q", "u_q", "flat_um", "u_flat_um"} & set(dir(ball))
    assert {"is_measured", "method_reason", "normals", "plot"} <= set(dir(field))
    assert "aspect_ratio" in dir(ball)


def test_summaries_hold_both_names() -> None:
    result = bgars.evaluate(bgars.read_capture(bgars.sample_capture()), method="lambertian").to_dict()
    assert result["choice"] == result["method_reason"] == "lambertian, as asked"
