"""The line that says trust or not is about the balls, too, which are a small part of the image."""

from __future__ import annotations

from dataclasses import replace

import bgars
import numpy as np
import pytest
from bgars.cli.evaluation import choice_in_words
from bgars.pipelines.reconstruct import summarise_field
from bgars.records.circle_pixels import inside_circles


@pytest.mark.parametrize(("measured", "words"), [(True, "Trust: "), (False, "Trust the surface beside the balls: ")])
def test_balls_that_are_filled_in_are_not_hidden_by_the_board(measured: bool, words: str) -> None:
    field = bgars.estimate_normals(bgars.read_capture(bgars.sample_capture()))
    assert field.reflectance is not None
    circle = field.reflectance.circles_px[0]
    small = replace(field.reflectance, circles_px=(replace_radius(circle, 20.0),))
    balls = inside_circles(small.circles_px, field.mask.shape)
    made = replace(field, reflectance=small, is_measured=np.where(balls, measured, field.mask))
    summary = summarise_field(made)
    assert summary["measured_share_on_balls"] == float(measured)
    assert choice_in_words(summary).startswith(words)
    assert ("only 0.0 % of those on balls" in choice_in_words(summary)) is not measured


def test_without_balls_there_is_no_share_of_theirs() -> None:
    field = bgars.estimate_normals(bgars.read_capture(bgars.sample_capture()), method="lambertian")
    assert summarise_field(field)["measured_share_on_balls"] is None


def replace_radius(circle: tuple[float, float, float], radius_px: float) -> tuple[float, float, float]:
    return (*circle[:2], radius_px)
