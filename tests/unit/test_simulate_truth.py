"""What the simulator says is true, against closed forms."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

import bgars
import numpy as np
import pytest
from bgars.records import ball_names
from bgars.simulate import PlaneTruth, ball_name
from bgars.simulate.coplanarity import regression_plane, seating_plane

RIG = bgars.LightRig.ring(8)
MATTE = bgars.Material.matte(0.5)


def truth_of(
    scene: bgars.Scene, *, pitch_um: float = 10.0, shape: tuple[int, int] | None = None
) -> bgars.SimulatedTruth:
    return bgars.simulate(scene, RIG, MATTE, bgars.Camera(pixel_pitch_um=pitch_um, shape=shape))[1]


def grid_um(shape: tuple[int, int], pitch_um: float) -> tuple[np.ndarray, np.ndarray]:
    """x and y of pixel centres, from the conventions: x = (c + 0.5 - W/2) p, y = (H/2 - r - 0.5) p."""
    row, col = np.indices(shape)
    return (col + 0.5 - shape[1] / 2) * pitch_um, (shape[0] / 2 - row - 0.5) * pitch_um


@pytest.mark.parametrize("height_um", [250.0, 300.0, 420.0, 500.0, 600.0])
def test_a_truncated_sphere(height_um: float) -> None:
    x0, y0, radius = 37.0, -51.0, 300.0
    truth = truth_of(bgars.Scene.ball(600.0, height_um=height_um, x_um=x0, y_um=y0), shape=(120, 131))
    x, y = grid_um((120, 131), 10.0)
    inside = radius**2 - (x - x0) ** 2 - (y - y0) ** 2
    z = height_um - radius + np.sqrt(np.maximum(inside, 0.0))
    ball = (inside > 0) & (z > 0)
    np.testing.assert_array_equal(truth.ball_ids == 1, ball)
    np.testing.assert_allclose(truth.height_um[ball], z[ball], rtol=1e-6)
    np.testing.assert_array_equal(truth.height_um[~ball], 0.0)
    np.testing.assert_allclose(truth.height_px * 10.0, truth.height_um)
    normal = np.stack([x - x0, y - y0, np.sqrt(np.maximum(inside, 0.0))], axis=2) / radius
    np.testing.assert_allclose(truth.normals[ball], normal[ball], atol=1e-6)
    assert (truth.normals[~ball] == [0, 0, 1]).all()
    assert truth.normals.dtype == np.float32
    assert truth.balls[0].top_um == pytest.approx(height_um)


def test_normals_are_the_slope_of_the_height_on_every_kind_of_surface() -> None:
    scene = bgars.Scene.ball_array(
        2,
        2,
        pitch_um=700.0,
        defects={"A1": bgars.Defect.flattened(), "B2": bgars.Defect.clipped(40.0)},
        bridges=[bgars.Bridge("A2", "B2", radius_um=90.0)],
        board=bgars.Board(tilt_x_deg=2.0, tilt_y_deg=-1.0, bow_um=40.0, bow_radius_um=900.0),
    )
    pitch_um = 1.0
    truth = truth_of(scene, pitch_um=pitch_um, shape=(1500, 1500))
    z = truth.height_px.astype(np.float64)
    slope_x = (z[1:-1, 2:] - z[1:-1, :-2]) / 2
    slope_y = (z[:-2, 1:-1] - z[2:, 1:-1]) / 2
    normal = truth.normals[1:-1, 1:-1]
    ids = truth.ball_ids
    smooth = (normal[..., 2] > 0.5) & (np.hypot(slope_x, slope_y) < 3)
    for shift in ((0, 1), (2, 1), (1, 0), (1, 2)):
        smooth &= ids[1:-1, 1:-1] == ids[shift[0] : shift[0] + 1498, shift[1] : shift[1] + 1498]
    # Not across the edge of a flat top either, where the normal jumps.
    for axis in (0, 1):
        jump = np.abs(np.diff(truth.normals[..., :2], axis=axis)).max(axis=2) > 0.02
        smooth &= ~(jump[:-1, 1:-1] | jump[1:, 1:-1] if axis == 0 else jump[1:-1, :-1] | jump[1:-1, 1:])
    assert {-1, 0, 1, 2, 3, 4} <= set(np.unique(ids[1:-1, 1:-1][smooth]))
    error = np.abs(normal[..., 0] + normal[..., 2] * slope_x) + np.abs(normal[..., 1] + normal[..., 2] * slope_y)
    assert error[smooth].max() < 5e-3
    np.testing.assert_allclose(np.linalg.norm(truth.normals, axis=2), 1.0, atol=1e-6)
    assert truth.normals[..., 2].min() > 0


def test_a_spheroid_and_a_flat_top() -> None:
    ball = bgars.Ball(0.0, 0.0, radius_um=300.0, centre_z_um=150.0, aspect_ratio=0.8, flat_top_depth_um=30.0)
    truth = truth_of(bgars.Scene((ball,)), shape=(101, 101))
    x, y = grid_um((101, 101), 10.0)
    inside = np.maximum(1.0 - (x**2 + y**2) / 300.0**2, 0.0)
    z = np.minimum(150.0 + 240.0 * np.sqrt(inside), ball.top_um)
    on_ball = truth.ball_ids == 1
    np.testing.assert_allclose(truth.height_um[on_ball], z[on_ball], rtol=1e-6)
    flat = np.hypot(x, y) < 300.0 * np.sqrt(1 - (210.0 / 240.0) ** 2)
    assert (truth.normals[flat] == [0, 0, 1]).all()
    assert ball.top_um == 360.0
    assert truth.balls[0].aspect_ratio == 0.8
    assert truth.balls[0].flat_top_depth_um == 30.0


def test_the_ball_table_of_an_array() -> None:
    defects = {
        "A2": bgars.Defect.missing(),
        "B1": bgars.Defect.offset(60.0, -20.0),
        "B3": bgars.Defect.size(0.8),
        "C1": bgars.Defect.size(1.1),
        "C3": bgars.Defect.flattened(0.85, 1.08),
    }
    scene = bgars.Scene.ball_array(3, 3, defects=defects, rotation_deg=10.0, centre_um=(50.0, 30.0))
    truth = truth_of(scene)
    table = {ball.name: ball for ball in truth.balls}
    assert list(table) == ["A1", "A2", "A3", "B1", "B2", "B3", "C1", "C2", "C3"]
    assert (table["C2"].row, table["C2"].col) == (3, 2)
    assert [table[name].defect for name in ("A2", "B1", "B2", "B3", "C1", "C3")] == [
        "missing", "offset", "none", "undersized", "oversized", "flattened",
    ]  # fmt: skip
    assert table["A2"].x_um is None
    assert not table["A2"].present
    assert table["B1"].x_um == pytest.approx(table["B1"].x_nominal_um + 60.0)
    assert table["B3"].diameter_um == pytest.approx(480.0)
    assert table["B3"].top_um == pytest.approx(400.0)
    assert table["C3"].top_um == pytest.approx(425.0)
    assert table["C3"].diameter_um == pytest.approx(648.0)
    # Counter-clockwise as seen in the image: A3, at the upper right, moves up.
    angle = np.degrees(np.arctan2(table["B3"].y_nominal_um - 30.0, table["B3"].x_nominal_um - 50.0))
    assert angle == pytest.approx(10.0)
    assert set(np.unique(truth.ball_ids)) == {0, 1, 3, 4, 5, 6, 7, 8, 9}, "a missing ball keeps its number"
    # The label image shows each ball where the table says it is.
    x, y = grid_um(truth.ball_ids.shape, 10.0)
    for number, ball in enumerate(truth.balls, start=1):
        if ball.present:
            shown = truth.ball_ids == number
            assert x[shown].mean() == pytest.approx(ball.x_um, abs=1.0)
            assert y[shown].mean() == pytest.approx(ball.y_um, abs=1.0)


def test_heights_are_above_the_local_board() -> None:
    board = bgars.Board(tilt_x_deg=1.0, bow_um=-20.0, bow_radius_um=2000.0)
    truth = truth_of(bgars.Scene.ball_array(1, 3, board=board))
    for ball in truth.balls:
        assert ball.top_um == pytest.approx(500.0)
        expected = ball.x_um * np.tan(np.radians(1.0)) - 20.0 * (1 - ball.x_um**2 / 2000.0**2)
        assert ball.board_z_um == pytest.approx(expected)


def test_jitter_has_the_spread_it_promises_and_stops_at_two_and_a_half_sigma() -> None:
    scene = bgars.Scene.ball_array(20, 20, jitter=bgars.Jitter(height_um=10.0, radius_um=4.0, position_um=6.0), seed=3)
    tops = np.array([ball.top_um - 500.0 for ball in scene.balls])
    radii = np.array([ball.radius_um - 300.0 for ball in scene.balls])
    offsets = np.array([ball.x_um - ball.x_nominal_um for ball in scene.balls])
    cut = 0.9546  # standard deviation of a normal distribution cut off at 2.5 sigma
    for values, sigma in ((tops, 10.0), (radii, 4.0), (offsets, 6.0)):
        assert np.abs(values).max() <= 2.5 * sigma
        assert values.std() == pytest.approx(cut * sigma, rel=0.12)
        assert abs(values.mean()) < 4 * sigma / 20


def all_triples(apexes: np.ndarray, gravity: np.ndarray) -> float:
    """Slow twin: over every triple whose plane lies above all apexes and whose triangle holds the point, the worst."""
    worst = None
    for triple in combinations(range(len(apexes)), 3):
        corners = apexes[list(triple)]
        system = np.column_stack([corners[:, :2], np.ones(3)])
        if abs(np.linalg.det(system)) < 1e-9:
            continue
        a, b, c = np.linalg.solve(system, corners[:, 2])
        shares = np.linalg.solve(system.T, [*gravity, 1.0])
        below = (apexes[:, :2] @ [a, b] + c - apexes[:, 2]) / np.sqrt(1 + a * a + b * b)
        if below.min() > -1e-7 and shares.min() > -1e-9:
            worst = max(below.max(), worst or 0.0)
    assert worst is not None
    return worst


@pytest.mark.parametrize("seed", range(6))
def test_seating_plane_against_all_triples(seed: int) -> None:
    random = np.random.default_rng(seed)
    apexes = np.column_stack([random.uniform(-3000, 3000, (18, 2)), random.normal(500, 10, 18)])
    plane = seating_plane(apexes, np.zeros(2))
    assert isinstance(plane, PlaneTruth)
    assert plane.deviations_um.min() > -1e-7
    assert plane.coplanarity_um == pytest.approx(all_triples(apexes, np.zeros(2)))
    np.testing.assert_allclose(plane.deviations_um[list(plane.balls)], 0.0, atol=1e-7)


def test_a_part_that_rocks_is_judged_by_its_worse_seating() -> None:
    # Two high apexes on each diagonal of a square: it stands on A-B plus either of two others.
    apexes = np.array([[-1.0, -1, 5], [1, 1, 5], [-1, 1, 4.0], [1, -1, 4.5]])
    plane = seating_plane(apexes, np.zeros(2))
    assert plane is not None
    assert plane.coplanarity_um == pytest.approx(all_triples(apexes, np.zeros(2)))
    assert plane.coplanarity_um > 0.9


def test_planes_that_do_not_exist() -> None:
    assert truth_of(bgars.Scene.ball_array(1, 2)).seating is None
    line = truth_of(bgars.Scene.ball_array(1, 4))
    assert line.seating_coplanarity_um is None
    assert line.regression_coplanarity_um is None
    assert truth_of(bgars.Scene.plane()).summary()["balls"] == 0
    assert seating_plane(np.array([[5.0, 5, 1], [6, 5, 1], [5, 6, 1]]), np.zeros(2)) is None


def test_regression_plane_touches_the_highest_apex() -> None:
    random = np.random.default_rng(1)
    apexes = np.column_stack([random.uniform(-1, 1, (30, 2)), random.normal(0, 0.1, 30)])
    plane = regression_plane(apexes)
    assert plane is not None
    assert plane.deviations_um.min() == pytest.approx(0.0, abs=1e-12)
    residual = apexes[:, 2] - (plane.a * apexes[:, 0] + plane.b * apexes[:, 1])
    expected = np.ptp(residual) / np.sqrt(1 + plane.a**2 + plane.b**2)
    assert plane.coplanarity_um == pytest.approx(expected)


def test_names_follow_jedec() -> None:
    letters = [ball_name(row, 1)[:-1] for row in range(1, 43)]
    assert "".join(letters[:20]) == "ABCDEFGHJKLMNPRTUVWY"
    assert letters[20:22] == ["AA", "AB"]
    assert letters[40:42] == ["BA", "BB"]


@pytest.mark.parametrize("tilt", [0.0, 0.7])
@pytest.mark.parametrize(("rows", "cols"), [(1, 5), (3, 3), (4, 4), (5, 4), (5, 5)])
def test_a_bowed_board_rests_as_every_triple_of_apexes_says(rows: int, cols: int, tilt: float) -> None:
    # Regular arrays have their centre of gravity on lines between apexes: the part rocks, and many triangles tie.
    x, y = np.meshgrid((np.arange(cols) - (cols - 1) / 2) * 1000.0, (np.arange(rows) - (rows - 1) / 2) * 1000.0)
    for bow in (20.0, -20.0, 25.6):
        z = 500 + bow * (1 - (x**2 + y**2) / 2000**2) + tilt * x / 1000
        apexes = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
        found, expected = seating_plane(apexes, np.zeros(2)), rests(apexes)
        assert (found is None) == (not expected)
        if found is not None:
            assert found.deviations_um.min() > -1e-6, "no apex above the plane"
            assert found.coplanarity_um == pytest.approx(max(expected), abs=1e-5)


def rests(apexes: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> list[float]:
    """Coplanarity from every plane of three apexes around the origin that no apex is above."""
    found = []
    for triple in combinations(range(len(apexes)), 3):
        matrix = np.column_stack([apexes[list(triple), :2], np.ones(3)])
        if abs(np.linalg.det(matrix)) < 1e-6 or np.linalg.solve(matrix.T, [0.0, 0.0, 1.0]).min() < -1e-9:
            continue
        a, b, c = np.linalg.solve(matrix, apexes[list(triple), 2])
        below = (a * apexes[:, 0] + b * apexes[:, 1] + c - apexes[:, 2]) / np.sqrt(1 + a * a + b * b)
        if below.min() > -1e-7:
            found.append(float(below.max()))
    return found


def test_tables_of_truth_and_result_join_on_the_name() -> None:
    """The scene counts rows and columns from 1, a result from 0: names are one and the same."""
    rig, camera = bgars.LightRig.ring(4), bgars.Camera(pixel_pitch_um=25.0)
    _, truth = bgars.simulate(bgars.Scene.ball_array(22, 2), rig, bgars.Material(), camera)
    for ball in truth.balls:
        assert ball.name == ball_names.ball_name(ball.row - 1, ball.col - 1)
    page = Path(__file__).parents[2] / "docs"
    for name in ("result.md", "simulator.md"):
        text = (page / name).read_text(encoding="utf-8")
        assert "`name`" in text
        assert "from 1, as names do" in text
