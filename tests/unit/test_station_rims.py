"""Outlines and clipped highlights of balls, where renderers and materials differ from the simplest."""

from __future__ import annotations

import bgars
import numpy as np
import pytest
from bgars.station.board_light import board_light
from bgars.station.levels import Levels
from bgars.station.outline import Outline
from bgars.station.rim import fit_rim, fresnel
from numpy.typing import NDArray
from rendered_spheres import mirrored_share, render, ring

Array = NDArray[np.float64]
BALL = (7.3, -4.6, 100.0)
ROUGH = Outline(7.1, -4.5, 99.6, 0.05, 0.05, 0.6, 1.0)


def levels_of(**more: object) -> Levels:
    images = render(ring(6, 48.0), ball=BALL, size=(260, 260), samples=5, blur_px=0.6, lamp_level=3.0, **more)
    return Levels(images.astype(np.float64), 255.0, 1.0)


def test_fresnel_is_that_of_snells_law() -> None:
    cosine = np.linspace(0.0, 1.0, 50)
    for index in (1.7, complex(3.2, 3.3)):
        np.testing.assert_allclose(fresnel(cosine, index), mirrored_share(cosine, index), atol=1e-12)
    chrome = fresnel(np.array([1.0, 0.0]), complex(3.2, 3.3))
    assert 0.5 < chrome[0] < 0.7
    assert chrome[1] == pytest.approx(1.0)


@pytest.mark.parametrize(("refraction", "most_px"), [(1.9, 0.05), (None, 0.2)])
def test_the_rim_of_a_mirror_is_found_whatever_it_reflects(refraction: float | None, most_px: float) -> None:
    """A black glossy ball is dark inside and as bright as its ground on the outline: the steepest place lies inside.

    A mirror that reflects alike at all angles is none that exists: it is told from a metal to a part of a pixel only.
    """
    found = fit_rim(levels_of(refraction=refraction), ROUGH, matt=False)
    assert found is not None
    off = found.circle_px - BALL
    assert np.abs(off).max() < most_px
    assert (np.abs(off) < 3.0 * found.u_px).all()


def test_the_rim_of_a_matt_ball_is_found() -> None:
    found = fit_rim(levels_of(kind="matt", board=0.05), ROUGH, matt=True)
    assert found is not None
    off = found.circle_px - BALL
    assert np.abs(off).max() < 0.05
    assert (np.abs(off) < 3.0 * found.u_px).all()


def test_a_band_that_no_law_explains_is_none_or_unsure() -> None:
    levels = levels_of()
    rows, cols = np.mgrid[:260, :260]
    striped = levels._replace(images=levels.images + 60.0 * (np.sin(rows / 2.0) > 0) * (np.sin(cols / 3.0) > 0))
    found = fit_rim(striped, ROUGH, matt=False)
    assert found is None or found.u_radius_px > 0.2


def test_highlights_that_clip_far_are_placed_to_a_tenth_of_a_degree() -> None:
    """Twenty times the clip level, filtered after the pixels: black, clipped, and a tail of one pixel."""
    lights = ring(6, 48.0)
    images = render(lights, ball=BALL, size=(260, 260), samples=3, blur_px=0.5, lamp_level=30.0, seed=3)
    capture = bgars.Capture(
        images=images, rig=bgars.LightRig.ring(6), mask=np.ones((260, 260), np.bool_), saturation=255.0,
        camera_distance_mm=np.inf,
    )  # fmt: skip
    found = bgars.calibrate_lights(capture)
    off = np.degrees(2 * np.arcsin(np.linalg.norm(found.rig.directions - lights, axis=1) / 2))
    assert off.mean() < 0.1
    assert (off < 3 * np.sqrt(2) * found.u_deg).all()


def test_a_board_lights_the_side_more_that_its_ball_does_not_shade() -> None:
    lamp = np.array([np.sqrt(0.5), 0.0, np.sqrt(0.5)])
    toward, away = board_light(np.array([[0.95, 0.0, np.sqrt(1 - 0.95**2)], [-0.95, 0.0, np.sqrt(1 - 0.95**2)]]), lamp)
    endless = 0.5 * (1.0 - np.sqrt(1 - 0.95**2))
    assert away < toward < endless * 1.05
