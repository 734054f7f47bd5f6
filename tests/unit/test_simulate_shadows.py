"""Attached and cast shadows against closed forms and a slow walk along the ray."""

from __future__ import annotations

import bgars
import numpy as np
import pytest

MATTE = bgars.Material.matte(0.5)
NEAR = bgars.LightRig.from_positions([[9000.0, 1000.0, 7000.0], [-6000.0, 6000.0, 5000.0], [500.0, -8000.0, 9000.0]])


def grid_um(shape: tuple[int, int], pitch_um: float) -> tuple[np.ndarray, np.ndarray]:
    row, col = np.indices(shape)
    return (col + 0.5 - shape[1] / 2) * pitch_um, (shape[0] / 2 - row - 0.5) * pitch_um


@pytest.mark.parametrize("elevation_deg", [20.0, 45.0, 70.0])
@pytest.mark.parametrize("q", [1.0, 0.8])
def test_the_shadow_on_the_board_is_the_ellipse(elevation_deg: float, q: float) -> None:
    """Centre c_xy - c_z l_xy / l_z, semi-axes R across and R / l_z along; a spheroid with c_z / q and l_z / q."""
    radius, centre_z, x0, y0 = 300.0, 200.0, 13.0, -29.0
    rig = bgars.LightRig.ring(5, elevation_deg=elevation_deg, azimuth0_deg=17.0)
    scene = bgars.Scene((bgars.Ball(x0, y0, radius_um=radius, centre_z_um=centre_z, aspect_ratio=q),))
    shape = (400, 410)
    _, truth = bgars.simulate(scene, rig, MATTE, bgars.Camera(pixel_pitch_um=7.0, shape=shape))
    x, y = grid_um(shape, 7.0)
    for light, (lx, ly, lz) in enumerate(rig.directions):
        stretched = np.array([lx, ly, lz / q]) / np.linalg.norm([lx, ly, lz / q])
        flat = np.hypot(stretched[0], stretched[1])
        along = ((x - x0) * stretched[0] + (y - y0) * stretched[1]) / flat + centre_z / q * flat / stretched[2]
        across = (-(x - x0) * stretched[1] + (y - y0) * stretched[0]) / flat
        ellipse = (along * stretched[2] / radius) ** 2 + (across / radius) ** 2 < 1
        # Under a low light the ellipse reaches out on the light's side: there the ray meets the ball below the board.
        ahead = (x0 - x) * stretched[0] + (y0 - y) * stretched[1] + centre_z / q * stretched[2] > 0
        board = truth.ball_ids == 0
        np.testing.assert_array_equal(~truth.lit[light][board], (ellipse & ahead)[board])


def test_attached_shadow_of_a_hemisphere_is_the_terminator() -> None:
    rig = bgars.LightRig.ring(8)
    _, truth = bgars.simulate(bgars.Scene.hemisphere(900.0), rig, MATTE, bgars.Camera())
    ball = truth.ball_ids == 1
    for light, direction in enumerate(rig.directions):
        facing = truth.normals.astype(np.float64) @ direction
        sure = ball & (np.abs(facing) > 1e-6)
        np.testing.assert_array_equal(truth.lit[light][sure], facing[sure] > 0)


def is_inside(scene: bgars.Scene, points: np.ndarray) -> np.ndarray:
    """Whether points (n, 3) are inside any ball (seen as implicit functions) or bridge of a flat scene."""
    inside = np.zeros(len(points), dtype=bool)
    by_name = {ball.name: ball for ball in scene.balls}
    for ball in scene.balls:
        if ball.present:
            square = (points[:, 0] - ball.x_um) ** 2 + (points[:, 1] - ball.y_um) ** 2
            square = square + ((points[:, 2] - ball.centre_z_um) / ball.aspect_ratio) ** 2
            inside |= (square < ball.radius_um**2) & (points[:, 2] < ball.top_um)
    for bridge in scene.bridges:
        first, second = by_name[bridge.first], by_name[bridge.second]
        z = bridge.z_um if bridge.z_um is not None else (first.centre_z_um + second.centre_z_um) / 2
        a, b = np.array([first.x_um, first.y_um, z]), np.array([second.x_um, second.y_um, z])
        axis = (b - a) / np.linalg.norm(b - a)
        place = (points - a) @ axis
        beside = np.linalg.norm(points - a - place[:, None] * axis, axis=1)
        inside |= (beside < bridge.radius_um) & (place > 0) & (place < np.linalg.norm(b - a))
    return inside


@pytest.mark.parametrize(
    "rig", [bgars.LightRig.ring(3, elevation_deg=30.0, azimuth0_deg=8.0), NEAR], ids=["far", "near"]
)
def test_cast_shadows_against_a_walk_along_the_ray(rig: bgars.LightRig) -> None:
    scene = bgars.Scene.ball_array(
        2,
        2,
        pitch_um=750.0,
        defects={"A1": bgars.Defect.flattened(), "B1": bgars.Defect.clipped(60.0)},
        bridges=[bgars.Bridge("A2", "B2", radius_um=90.0)],
    )
    pitch_um, shape = 20.0, (100, 100)
    _, truth = bgars.simulate(scene, rig, MATTE, bgars.Camera(pixel_pitch_um=pitch_um, shape=shape))
    x, y = grid_um(shape, pitch_um)
    random = np.random.default_rng(2)
    rows, cols = random.integers(0, 100, (2, 1500))
    disagreements = 0
    cast = 0
    for light in range(len(rig)):
        for row, col in zip(rows, cols, strict=True):
            point = np.array([x[row, col], y[row, col], float(truth.height_um[row, col])])
            normal = truth.normals[row, col].astype(np.float64)
            if rig.positions_um is None:
                toward = rig.directions[light]
            else:
                toward = rig.positions_um[light] - point
                toward = toward / np.linalg.norm(toward)
            if normal @ toward <= 0:
                assert not truth.lit[light, row, col]
                continue
            # From just above the surface to above the tallest ball, in steps of 2 um.
            length = (520.0 - point[2]) / toward[2]
            steps = np.arange(1.0, max(length, 2.0), 2.0)
            free = not is_inside(scene, point + 0.05 * normal + steps[:, None] * toward).any()
            cast += not free
            disagreements += free != truth.lit[light, row, col]
    assert cast > 300
    # Steps of 2 um miss grazing hits; these are rare.
    assert disagreements <= 0.004 * rows.size * len(rig)


def test_shadows_of_balls_outside_the_image_fall_into_it() -> None:
    scene = bgars.Scene((bgars.Ball(900.0, 0.0, radius_um=300.0, centre_z_um=200.0),))
    rig = bgars.LightRig.from_angles([[0, 20], [120, 45], [240, 45]])
    _, truth = bgars.simulate(scene, rig, MATTE, bgars.Camera(pixel_pitch_um=10.0, shape=(60, 60)))
    assert (truth.ball_ids == 0).all()
    assert 0.2 < (~truth.lit[0]).mean() < 1.0
    assert truth.lit[1:].all()


def test_a_shadow_falls_on_the_neighbour() -> None:
    scene = bgars.Scene.ball_array(1, 2, pitch_um=650.0)
    rig = bgars.LightRig.from_angles([[0, 25], [120, 60], [240, 60]])
    capture, truth = bgars.simulate(scene, rig, MATTE, bgars.Camera(pixel_pitch_um=5.0))
    facing = truth.normals @ rig.directions[0].astype(np.float32)
    cast = (truth.ball_ids == 1) & (facing > 0.01) & ~truth.lit[0]
    assert cast.sum() > 300
    assert capture.images[0][cast].max() == 0
    assert not ((truth.ball_ids == 2) & (facing > 1e-6) & ~truth.lit[0]).any(), "nothing shades the right ball"


def test_a_tilted_board_under_a_low_light_still_has_one_clean_shadow() -> None:
    board = bgars.Board(tilt_x_deg=8.0, bow_um=-30.0, bow_radius_um=1500.0)
    rig = bgars.LightRig.ring(4, elevation_deg=25.0)
    _, truth = bgars.simulate(bgars.Scene.ball(board=board), rig, MATTE, bgars.Camera(shape=(200, 200)))
    centre = np.array([0.0, 0.0, 200.0 - 30.0])
    x, y = grid_um((200, 200), 10.0)
    points = np.stack([x, y, truth.height_um.astype(np.float64)], axis=2)
    for light, toward in enumerate(rig.directions):
        offset = centre - points
        along = offset @ toward
        distance = np.linalg.norm(offset - along[..., None] * toward, axis=2)
        sure = (truth.ball_ids == 0) & (np.abs(distance - 300.0) > 1e-2)
        np.testing.assert_array_equal(truth.lit[light][sure], ((distance >= 300.0) | (along <= 0))[sure])
