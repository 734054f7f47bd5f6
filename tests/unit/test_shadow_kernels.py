"""The kernels of shadows against their slow plain twins."""

from __future__ import annotations

from dataclasses import fields, replace

import bgars
import numpy as np
import pytest
from bgars import _bgars
from bgars.inspection.board import Board
from bgars.inspection.bundle_model import tangents
from bgars.inspection.radiance import Radiance
from bgars.inspection.shadow_edges import EdgeSettings, measure_edges
from bgars.inspection.shadow_map import Casters, ShadowMap
from bgars.inspection.shadow_model import Balls, Lights, edge_at
from numpy.typing import NDArray
from slow_shadows import shadowed, slow_edges

Array = NDArray[np.float64]
PITCH_UM = 11.0
SHARP = EdgeSettings(0.5, 0.02, 0.01, 4.0)
NOTHING_PX = 100.0
COARSE = EdgeSettings(1.0, 0.0, 0.0, 9.0, 2, coarse=True)
BOWED = Board(np.array([2e-3, -1e-3, 2e-5, 1e-5, -3e-5]))
SLIGHTLY = Board(0.1 * BOWED.coefficients)
"""So that the board and its tangent plane under a ball are less apart than a window is wider than its shadow."""
SILHOUETTE_PX, SHADOW_PX = 3.0, 3.0


def part(rig: bgars.LightRig) -> tuple[bgars.Capture, Array, Array]:
    """Six balls: a capture, the balls (N, 5) half a pixel wrong, the lights (L, 3)."""
    scene = bgars.Scene.ball_array(2, 3, jitter=bgars.Jitter(height_um=20.0), seed=5)
    capture, truth = bgars.simulate(
        scene, rig, bgars.Material(i_d=0.5, i_s=1.0, hardness=40), bgars.Camera(pixel_pitch_um=PITCH_UM), seed=3
    )
    rows = [(ball.x_um, ball.y_um, ball.centre_z_um, ball.diameter_um, ball.aspect_ratio) for ball in truth.balls]
    unit = [PITCH_UM, PITCH_UM, PITCH_UM, 2.0 * PITCH_UM, 1.0]
    table = np.array(rows, dtype=np.float64) / unit + [0.4, -0.3, 0.2, 0.1, 0.0]
    vectors = rig.directions if rig.positions_um is None else rig.positions_um / PITCH_UM
    return capture, table, vectors


RIGS = {
    "distant": bgars.LightRig.ring(8, elevation_deg=40.0),
    "near": bgars.LightRig.from_positions(60_000.0 * bgars.LightRig.ring(6, elevation_deg=50.0).directions),
}


def gains(table: Array, lights: int) -> Array:
    return 1.0 + 0.2 * np.random.default_rng(1).random((len(table), lights))


def shadow_map(
    capture: bgars.Capture, table: Array, vectors: Array, near: bool, board: Board, threads: int = 1
) -> ShadowMap:
    return ShadowMap(
        Radiance(capture),
        Casters.of(table, vectors, near, board),
        silhouette_margin_px=SILHOUETTE_PX,
        shadow_margin_px=SHADOW_PX,
        threads=threads,
    )


@pytest.mark.parametrize("name", RIGS)
def test_every_cell_is_counted_as_its_ray_says(name: str) -> None:
    rig = RIGS[name]
    capture, table, vectors = part(rig)
    drawn = shadow_map(capture, table, vectors, rig.is_near, SLIGHTLY)
    radiance = Radiance(capture)
    middle = (drawn.step - 1) / 2.0
    x = radiance.x(np.arange(drawn.hidden.shape[1]) * drawn.step + middle)[None, :]
    y = radiance.y(np.arange(drawn.hidden.shape[0]) * drawn.step + middle)[:, None]
    hidden = np.zeros(drawn.hidden.shape, dtype=np.bool_)
    for light, vector in enumerate(vectors):
        lamp = Lights.from_table(vector[None], rig.is_near).spread(0, 1)
        count = np.zeros(drawn.hidden.shape, dtype=np.uint8)
        for row in table:
            count += shadowed(x, y, Balls.from_table(row[None]).spread(1), lamp, SLIGHTLY, SHADOW_PX)
            hidden |= np.square(x - row[0]) + np.square(y - row[1]) < (row[3] + SILHOUETTE_PX) ** 2
        np.testing.assert_array_equal(drawn.count[light], count)
    np.testing.assert_array_equal(drawn.hidden, hidden)
    assert hidden.any()
    assert drawn.count.any()


@pytest.mark.parametrize("settings", [SHARP, COARSE], ids=["sharp", "coarse"])
@pytest.mark.parametrize("name", RIGS)
def test_edges_are_those_of_the_slow_twin(name: str, settings: EdgeSettings) -> None:
    rig = RIGS[name]
    capture, table, vectors = part(rig)
    mask = np.ones(capture.mask.shape, dtype=np.bool_)
    mask[:, 100:110] = False
    capture = replace(capture, mask=mask, saturation=240.0, black_level=1.0)
    check_edges(capture, table, vectors, rig.is_near, settings)


def test_edges_with_response_and_dark_frame() -> None:
    rig = RIGS["distant"]
    capture, table, vectors = part(rig)
    response = (np.arange(256, dtype=np.float32) / 255.0) ** 1.4 * 255.0
    dark = np.random.default_rng(2).integers(0, 4, capture.mask.shape).astype(np.uint8)
    check_edges(replace(capture, response=response, dark=dark), table, vectors, False, SHARP)


def check_edges(capture: bgars.Capture, table: Array, vectors: Array, near: bool, settings: EdgeSettings) -> None:
    radiance = Radiance(capture)
    shadows = shadow_map(capture, table, vectors, near, BOWED)
    given = gains(table, len(vectors))
    fast = measure_edges(radiance, shadows, table, vectors, near, BOWED, given, settings, threads=1)
    count = int(np.clip(2.0 * np.radians(100.0) * np.median(table[:, 3]) / 1.45, 12, 48))
    slow = slow_edges(radiance, shadows, table, vectors, near, BOWED, given, settings, count)
    assert np.isfinite(fast.u_px).mean() > 0.3
    # A stretch without contrast says nothing, and divides by next to nothing.
    known = ~((fast.u_px > NOTHING_PX) & np.isfinite(fast.u_px))
    for field, expected in zip(fields(fast), slow, strict=True):
        found = getattr(fast, field.name)
        which = known if found.shape == known.shape else ...
        # Texture is a mean of float32, whose order of summation differs.
        np.testing.assert_allclose(found[which], expected[which], rtol=1e-4, atol=1e-4, err_msg=field.name)


def test_threads_do_not_change_a_bit() -> None:
    rig = RIGS["distant"]
    capture, table, vectors = part(rig)
    given = gains(table, len(vectors))
    one, two = (
        measure_edges(
            Radiance(capture),
            shadow_map(capture, table, vectors, False, BOWED, threads),
            table,
            vectors,
            False,
            BOWED,
            given,
            SHARP,
            threads,
        )
        for threads in (1, 2)
    )
    for field in fields(one):
        np.testing.assert_array_equal(getattr(one, field.name), getattr(two, field.name))


def slow_distances(curve: Array, points: Array, middle: Array) -> Array:
    """(P,) distances of points (P, 2) to a closed curve (M, 2) of segments around its middle; outside is positive."""
    ahead = np.roll(curve, -1, axis=0) - curve
    off = points[:, None] - curve
    share = np.clip((off * ahead).sum(axis=-1) / np.maximum(np.square(ahead).sum(axis=-1), 1e-300), 0.0, 1.0)
    left = off - share[..., None] * ahead
    nearest = np.square(left).sum(axis=-1).argmin(axis=1)
    at = points - left[np.arange(len(points)), nearest]
    outside = np.square(points - middle).sum(axis=1) > np.square(at - middle).sum(axis=1)
    return np.where(outside, 1.0, -1.0) * np.linalg.norm(points - at, axis=1)


@pytest.mark.parametrize("name", RIGS)
def test_rows_hold_the_distance_to_the_nearest_point_of_the_edge(name: str) -> None:
    rig = RIGS[name]
    _, table, vectors = part(rig)
    dense = np.linspace(-np.pi, np.pi, 20_000, endpoint=False)
    angles, sizes = np.radians([-70.0, -20.0, 0.0, 35.0, 80.0]), np.array([0.3, -0.3, 0.2, -0.1, 0.25])
    balls, lights = Balls.from_table(table).spread(2), Lights.from_table(vectors, rig.is_near).spread(1, 1)
    whole, some = edge_at(dense, balls, lights, SLIGHTLY), edge_at(angles, balls, lights, SLIGHTLY)
    curves = np.stack(np.broadcast_arrays(whole.x, whole.y), axis=-1)
    middles = curves.mean(axis=2)
    outward = np.stack([some.x, some.y], axis=-1) - middles[:, :, None]
    points = middles[:, :, None] + outward * (1.0 + sizes / np.linalg.norm(outward, axis=-1))[..., None]
    shifts = np.random.default_rng(2).normal(0.0, 0.5, (len(vectors), 2))
    waves_px = [0.1, -0.05, 0.02, 0.03]
    rows = _bgars.edge_rows(
        np.ascontiguousarray(points[..., 0] + shifts[:, None, 0]),
        np.ascontiguousarray(points[..., 1] + shifts[:, None, 1]),
        Casters.of(table, vectors, rig.is_near, SLIGHTLY),
        turns=tangents(vectors).reshape(-1, 6),
        shifts_px=shifts,
        waves_px=waves_px,
    )
    angle = rows[..., -1]
    assert (np.sign(angle[..., [0, 1, 3, 4]]) == np.sign(angles[[0, 1, 3, 4]])).all()
    np.testing.assert_allclose(angle[..., 2], 0.0, atol=0.1)
    waves = np.cos(np.arange(4) * angle[..., None])
    np.testing.assert_allclose(rows[..., -6:-2], -waves, atol=1e-12)
    expected = [
        [slow_distances(curve, near, middle) for curve, near, middle in zip(*of_ball, strict=True)]
        for of_ball in zip(curves, points, middles, strict=True)
    ]
    np.testing.assert_allclose(rows[..., -2] + waves @ waves_px, expected, atol=2e-3)


def test_products_are_those_of_numpy() -> None:
    random = np.random.default_rng(3)
    rows, weights = random.normal(size=(3, 4, 7, 20)), random.random((3, 4, 7))
    terms = rows[..., :-1]
    expected = np.einsum("nlp,nlpi,nlpj->nlij", weights, terms, terms)
    np.testing.assert_allclose(_bgars.edge_products(rows, weights), expected, rtol=1e-12, atol=1e-12)
