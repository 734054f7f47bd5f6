"""Stripes over what is a prior: where they lie, and what the legend says."""

from __future__ import annotations

import bgars
import numpy as np
import pytest
from bgars.report.figures.prior import (
    prior_label,
    prior_legend,
    prior_overlay,
    prior_pixels,
    prior_share,
    show_prior,
    stripes,
)
from matplotlib.figure import Figure

SHAPE = (60, 80)
EXTENT = (-40.0, 40.0, -30.0, 30.0)


@pytest.fixture(scope="module")
def metal() -> bgars.NormalField:
    """A ball without diffuse light: near its rim no light says anything."""
    scene = bgars.Scene.ball_array(2, 2, board=bgars.Board(material=bgars.Material.matte(0.12)))
    material = bgars.Material(i_d=0.0, i_s=1.0, hardness=40)
    capture, _ = bgars.simulate(scene, bgars.LightRig.ring(8), material, bgars.Camera(pixel_pitch_um=20.0))
    return bgars.estimate_normals(capture)


def test_stripes_lie_on_prior_pixels_only() -> None:
    prior = np.zeros(SHAPE, np.bool_)
    prior[10:40, 20:70] = True
    opacity = stripes(prior, 8)
    assert (opacity[~prior] == 0).all()
    assert 0.3 < (opacity[prior] > 0).mean() < 0.8
    assert opacity.max() < 1


def test_the_legend_says_where_the_normals_come_from_and_how_many(metal: bgars.NormalField) -> None:
    prior = prior_pixels(metal)
    assert prior.any()
    assert metal.mask[prior].all()
    assert "sphere of its circle" in prior_label(metal)
    axes = Figure().subplots()
    show_prior(axes, prior_overlay(metal), EXTENT, legend=prior_legend(metal))
    assert axes.get_legend().get_texts()[0].get_text() == f"{prior_label(metal)}: {prior_share(metal)}"
    assert prior_share(metal).endswith("of the normals on balls")
    # All priors are on balls, and balls are a part of the image only.
    assert float(prior_share(metal).split()[0]) > 100 * prior.sum() / metal.mask.sum()


def test_nothing_is_drawn_where_everything_is_measured() -> None:
    capture = bgars.read_capture(bgars.sample_capture())
    axes = Figure().subplots()
    field = bgars.estimate_normals(capture, method="lambertian")
    show_prior(axes, prior_overlay(field), EXTENT, legend=prior_legend(field))
    assert not axes.images
    assert axes.get_legend() is None
