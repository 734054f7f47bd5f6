"""How the board brightens across the edge of a shadow: against a lamp of many points, and a pixel of many."""

from __future__ import annotations

import bgars
import numpy as np
import pytest
from bgars.inspection.board import Board
from bgars.inspection.edge_profile import Lamp, edge_bends_px, edge_profiles, pixel_step
from bgars.inspection.shadow_model import Balls, Lights, edge_at, rays
from bgars.inspection.spread import EdgeSpread
from numpy.typing import NDArray

Array = NDArray[np.float64]
BALL = np.array([[0.0, 0.0, 12.0, 25.0, 1.0]])
LIGHT = np.array([[0.5, 0.5, np.sqrt(0.5)]])
LENS_PX = 0.5


def profile(angle_rad: float, lamp: Lamp, at: Array) -> tuple[Array, Array]:
    balls, board = Balls.from_table(BALL).spread(2), Board()
    lights = Lights.from_table(LIGHT, False).spread(1, 1)
    edge = edge_at(np.full((1, 1, 1), angle_rad), balls, lights, board)
    beam = rays(edge.x, edge.y, balls, lights, board)
    share, growth = edge_profiles(edge, beam, balls, LIGHT, False, board, LENS_PX, lamp, at[None, None])
    return share[0, 0], growth[0, 0]


def share_of_many(angle_rad: float, lamp: Lamp, at: Array) -> Array:
    """Share of a lamp's 40,000 points, each as bright as it stands high, that board points see through the lens."""
    random = np.random.default_rng(0)
    radius = np.sort(random.uniform(-1.0, 1.0, (3, 40_000)), axis=0)[1] * np.sqrt(5.0)
    other = np.sort(random.uniform(-1.0, 1.0, (3, 40_000)), axis=0)[1] * np.sqrt(5.0)
    elevation = np.arcsin(LIGHT[0, 2])
    azimuth = np.pi / 4.0 + radius * lamp.azimuth_rad / np.cos(elevation)
    raised = elevation + other * lamp.elevation_rad
    points = Lights(np.cos(raised) * np.cos(azimuth), np.cos(raised) * np.sin(azimuth), np.sin(raised), False)
    balls, board = Balls.from_table(BALL), Board()
    edge = edge_at(np.array([angle_rad]), balls, Lights.from_table(LIGHT, False), board)
    beam = rays(edge.x, edge.y, balls, Lights.from_table(LIGHT, False), board)
    share, blur = [], LENS_PX * random.standard_normal(len(azimuth))
    for d in at:
        x = np.full(len(azimuth), edge.x[0] + d * beam.gradient_x[0] / beam.slope[0])
        y = np.full(len(azimuth), edge.y[0] + d * beam.gradient_y[0] / beam.slope[0])
        ways = rays(x, y, balls, points, board)
        seen = (ways.distance - BALL[0, 3]) / ways.slope + blur > 0.0
        share.append((seen * points.z).sum() / points.z.sum())
    return np.array(share)


@pytest.mark.parametrize(("wide_deg", "high_deg"), [(3.0, 3.0), (6.0, 1.0), (1.0, 3.5), (6.0, 3.0)])
@pytest.mark.parametrize("angle_deg", [0.0, 25.0, 50.0, 80.0])
def test_a_wide_lamp_is_seen_as_that_of_many_points(angle_deg: float, wide_deg: float, high_deg: float) -> None:
    lamp = Lamp(*np.radians([wide_deg, high_deg]))
    at = np.linspace(-12.0, 12.0, 25)
    share, _ = profile(np.radians(angle_deg), lamp, at)
    np.testing.assert_allclose(share, share_of_many(np.radians(angle_deg), lamp, at), atol=0.045)


@pytest.mark.parametrize("angle_deg", [0.0, 25.0, 80.0])
def test_a_small_lamp_leaves_the_edge_where_it_is(angle_deg: float) -> None:
    share, _ = profile(np.radians(angle_deg), Lamp(0.001, 0.001), np.zeros(1))
    assert float(share[0]) == pytest.approx(0.5, abs=0.01)


def test_growth_is_the_slope_of_the_share() -> None:
    at = np.linspace(-6.0, 6.0, 1201)
    share, growth = profile(0.4, Lamp(0.06, 0.03), at)
    np.testing.assert_allclose(growth[1:-1], np.gradient(share, at)[1:-1], atol=0.01 * growth.max())


@pytest.mark.parametrize("turn_deg", [0.0, 20.0, 45.0, 90.0])
def test_a_pixel_is_the_mean_over_its_square(turn_deg: float) -> None:
    normal = np.array([np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))])
    grid = (np.arange(400) + 0.5) / 400 - 0.5
    at = np.array([-0.6, -0.2, 0.0, 0.35])
    blur = np.full(4, 0.06)
    value, _ = pixel_step(at, blur, np.full(4, normal[0]), np.full(4, normal[1]))
    offset = grid[:, None] * normal[0] + grid[None, :] * normal[1]
    # A Gaussian by its own points, each with the same share.
    spread = 0.06 * np.random.default_rng(1).standard_normal((200, 1, 1))
    seen = [float((d + offset[None] + spread > 0).mean()) for d in at]
    np.testing.assert_allclose(value, seen, atol=6e-3)


@pytest.mark.parametrize("elevation_deg", [25.0, 45.0, 65.0])
def test_the_curvature_of_a_shadow_is_that_of_its_ellipse(elevation_deg: float) -> None:
    sine, radius = np.sin(np.radians(elevation_deg)), BALL[0, 3]
    rig, balls, board = bgars.LightRig.ring(3, elevation_deg=elevation_deg), Balls.from_table(BALL).spread(2), Board()
    lights = Lights.from_table(rig.directions, False).spread(1, 1)
    edge = edge_at(np.radians([0.0, 90.0]), balls, lights, board)
    tip, side = np.moveaxis(rays(edge.x, edge.y, balls, lights, board).curvature, -1, 0)
    np.testing.assert_allclose(tip, 1.0 / (radius * sine), rtol=1e-9)
    np.testing.assert_allclose(side, sine**2 / radius, rtol=1e-9)


def test_drawn_out_tips_are_known_less() -> None:
    """Edges of low lights: bent and blunt at the tip alone, so that cosines of all orders are unsure, cos 3 a, too."""
    spread = EdgeSpread(0.5, 0.0075, 0.0075, 0.0075)

    def unsure_px(elevation_deg: float) -> Array:
        vectors = bgars.LightRig.ring(8, elevation_deg=elevation_deg).directions
        return edge_bends_px(BALL[0], vectors, False, Board(), spread)

    low, usual = unsure_px(25.0), unsure_px(45.0)
    assert (low[1:] > 3.0 * usual[1:]).all()
    assert low[3] > 0.5 * low[0] > 4.0 * usual[3]
    # Twice the blur by lens and lamp is four times the bend.
    doubled = edge_bends_px(BALL[0], LIGHT, False, Board(), EdgeSpread(1.0, 0.015, 0.015, 0.015))
    np.testing.assert_allclose(doubled, 4.0 * edge_bends_px(BALL[0], LIGHT, False, Board(), spread), rtol=1e-9)
