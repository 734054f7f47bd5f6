"""Reference planes against every triple of apexes, and against a linear program of somebody else."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from bgars.inspection.planes import regression_plane, seating_planes
from scipy.optimize import linprog

TOUCH_UM = 1e-7


def every_triple(apexes: np.ndarray, gravity: np.ndarray) -> list[float]:
    """Coplanarity of each plane through three apexes around the centre of gravity with none above it, worst first."""
    found = []
    for triple in combinations(range(len(apexes)), 3):
        corners = apexes[list(triple)]
        matrix = np.column_stack([corners[:, :2], np.ones(3)])
        if abs(np.linalg.det(matrix)) < 1e-9:
            continue
        shares = np.linalg.solve(matrix.T, [*gravity, 1.0])
        a, b, c = np.linalg.solve(matrix, corners[:, 2])
        below = a * apexes[:, 0] + b * apexes[:, 1] + c - apexes[:, 2]
        if shares.min() >= -1e-9 and below.min() >= -TOUCH_UM:
            found.append(float(below.max() / np.sqrt(1.0 + a * a + b * b)))
    return distinct(sorted(found, reverse=True))


def distinct(values: list[float]) -> list[float]:
    return [value for index, value in enumerate(values) if index == 0 or values[index - 1] - value > 2e-6]


def grid(rows: int, cols: int, pitch: float = 1.0) -> np.ndarray:
    x, y = np.meshgrid((np.arange(cols) - (cols - 1) / 2) * pitch, (np.arange(rows) - (rows - 1) / 2) * pitch)
    return np.column_stack([x.ravel(), y.ravel()])


def random_part(kind: str, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    count = int(random.integers(3, 12))
    middle = np.zeros(2)
    if kind == "scattered":
        return np.column_stack([random.uniform(-5, 5, (count, 2)), random.normal(0, 1, count)]), random.uniform(
            -3, 3, 2
        )
    if kind == "array":
        places = grid(*random.integers(2, 4, 2))
        return np.column_stack([places, random.normal(0, 1, len(places))]), middle
    if kind == "equal heights, tilted":  # ties everywhere, as on a symmetric part with equal corners
        places = grid(*random.integers(2, 5, 2), pitch=1000.0)
        heights = 5.0 * random.integers(0, 3, len(places)) + 500.0 + 0.02 * places[:, 0] - 0.01 * places[:, 1]
        return np.column_stack([places, heights]), middle
    if kind == "high middle":  # rocks in every direction
        heights = 0.1 * random.integers(0, 2, 9).astype(float)
        heights[4] += random.uniform(0.2, 3)
        return np.column_stack([grid(3, 3, 1000.0), heights]), middle
    if kind == "high pair":  # rocks about a line through the centre of gravity
        apexes = np.column_stack([random.uniform(-5, 5, (count, 2)), random.normal(0, 1, count)])
        apexes[0, :2] = -apexes[1, :2]
        apexes[:2, 2] = 4.0
        return apexes, middle
    places = np.unique(random.integers(-2, 3, (count, 2)).astype(float), axis=0)  # "whole numbers": lines and ties
    return np.column_stack([places, np.round(random.normal(0, 1, len(places)))]), random.integers(-1, 2, 2).astype(
        float
    )


@pytest.mark.parametrize(
    "kind", ["scattered", "array", "equal heights, tilted", "high middle", "high pair", "whole numbers"]
)
def test_seating_planes_are_those_of_all_triples(kind: str) -> None:
    random = np.random.default_rng(7)
    rocking = 0
    for _ in range(120):
        apexes, gravity = random_part(kind, random)
        want = every_triple(apexes, gravity)
        planes = seating_planes(apexes, gravity)
        got = distinct([plane.coplanarity_um for plane in planes])
        assert len(got) == len(want)
        np.testing.assert_allclose(got, want, atol=2e-6)
        rocking += len(planes) > 1
        for plane in planes:
            assert plane.deviations_um.min() >= 0
            assert (plane.deviations_um[list(plane.balls)] < 1e-6).all()
    if kind in {"high middle", "high pair"}:
        assert rocking > 20, "the kind must make parts that rock"


def test_the_plane_is_the_optimum_of_the_linear_program() -> None:
    random = np.random.default_rng(3)
    for _ in range(40):
        apexes = np.column_stack([random.uniform(-5000, 5000, (60, 2)), random.normal(500, 10, 60)])
        gravity = random.uniform(-1500, 1500, 2)
        plane = seating_planes(apexes, gravity)[0]
        system = np.column_stack([apexes[:, :2] / 1000, np.ones(60)])
        best = linprog(
            [*gravity / 1000, 1.0], A_ub=-system, b_ub=-apexes[:, 2], bounds=[(None, None)] * 3, method="highs"
        )
        height = plane.slope_x * gravity[0] + plane.slope_y * gravity[1] + plane.offset_um
        assert height == pytest.approx(best.fun, abs=1e-6)


def test_a_square_part_on_equal_corners_touches_all_of_them() -> None:
    apexes = np.column_stack([grid(4, 4, 1000.0), np.full(16, 480.0)])
    corners = [0, 3, 12, 15]
    apexes[corners, 2] = 500.0
    planes = seating_planes(apexes, np.zeros(2))
    assert [plane.balls for plane in planes] == [tuple(corners)]
    assert planes[0].coplanarity_um == pytest.approx(20.0)


def test_a_part_rocks_over_its_higher_diagonal() -> None:
    apexes = np.column_stack([grid(2, 2, 1000.0), [500.0, 490.0, 496.0, 502.0]])
    planes = seating_planes(apexes, np.zeros(2))
    assert [plane.balls for plane in planes] == [(0, 2, 3), (0, 1, 3)] or [plane.balls for plane in planes] == [
        (0, 1, 3),
        (0, 2, 3),
    ]
    for plane in planes:
        assert plane.coplanarity_um == pytest.approx(16.0, rel=1e-3)


def test_three_high_balls_on_one_side_are_not_the_seating_plane() -> None:
    """The three highest balls carry a part only if they surround its centre of gravity."""
    heights = np.full(16, 500.0)
    heights[[0, 1, 4]] = [520.0, 519.0, 518.0]
    apexes = np.column_stack([grid(4, 4, 1000.0), heights])
    (plane,) = seating_planes(apexes, np.zeros(2))
    assert set(plane.balls) != {0, 1, 4}
    assert len(every_triple(apexes, np.zeros(2))) == 1


@pytest.mark.parametrize(
    "apexes",
    [
        np.zeros((0, 3)),
        np.array([[0.0, 0, 5]]),
        np.array([[0.0, 0, 5], [1, 0, 5]]),
        np.array([[0.0, 0, 5], [1000, 1000, 5], [2000, 2000, 5], [-500, -500, 7]]),
        np.array([[3.0, 3, 5]] * 4),
    ],
    ids=["none", "one", "two", "in one line", "at one place"],
)
def test_apexes_that_hold_no_plane(apexes: np.ndarray) -> None:
    assert seating_planes(apexes, np.zeros(2)) == ()
    assert regression_plane(apexes) is None


def test_a_part_that_would_fall_over_has_no_seating_plane_but_a_regression_plane() -> None:
    apexes = np.array([[0.0, 0, 5], [1000, 0, 5], [0, 1000, 5]])
    assert seating_planes(apexes, np.array([900.0, 900.0])) == ()
    assert regression_plane(apexes) is not None
    assert len(seating_planes(apexes, np.array([500.0, 500.0]))) == 1, "on the edge it still stands"


def test_three_balls_are_coplanar() -> None:
    apexes = np.array([[0.0, 0, 5], [1000, 0, 25], [0, 1000, -5]])
    (plane,) = seating_planes(apexes, np.array([300.0, 300.0]))
    assert plane.balls == (0, 1, 2)
    assert plane.coplanarity_um == pytest.approx(0.0, abs=1e-9)


def test_a_perfect_part_has_one_plane_on_all_balls() -> None:
    apexes = np.column_stack([grid(20, 20, 1000.0), np.full(400, 500.0)])
    (plane,) = seating_planes(apexes, np.zeros(2))
    assert len(plane.balls) == 400
    assert plane.coplanarity_um < 1e-9


@pytest.mark.parametrize("planes", ["seating", "regression"])
def test_a_tilt_of_the_part_changes_nothing_but_the_plane(planes: str) -> None:
    random = np.random.default_rng(11)
    apexes = np.column_stack([grid(6, 6, 1000.0), random.normal(500, 5, 36)])
    tilted = apexes + np.column_stack([np.zeros((36, 2)), 3e-3 * apexes[:, 0] - 2e-3 * apexes[:, 1] + 1e4])
    one, two = (
        (seating_planes(each, np.zeros(2))[0] if planes == "seating" else regression_plane(each))
        for each in (apexes, tilted)
    )
    assert one is not None
    assert two is not None
    assert one.balls == two.balls
    assert two.coplanarity_um == pytest.approx(one.coplanarity_um, rel=1e-4)
    assert two.slope_x - one.slope_x == pytest.approx(3e-3, abs=1e-9)


def test_the_regression_plane_is_parallel_to_the_least_squares_plane_through_the_highest_apex() -> None:
    random = np.random.default_rng(5)
    for _ in range(50):
        count = int(random.integers(3, 30))
        apexes = np.column_stack([random.uniform(-5, 5, (count, 2)), random.normal(0, 1, count)])
        plane = regression_plane(apexes)
        assert plane is not None
        system = np.column_stack([apexes[:, :2], np.ones(count)])
        (a, b, _), *_ = np.linalg.lstsq(system, apexes[:, 2], rcond=None)
        assert (plane.slope_x, plane.slope_y) == pytest.approx((a, b), abs=1e-9)
        residuals = apexes[:, 2] - a * apexes[:, 0] - b * apexes[:, 1]
        assert plane.offset_um == pytest.approx(residuals.max(), abs=1e-9)
        assert plane.coplanarity_um == pytest.approx(np.ptp(residuals) / np.sqrt(1 + a * a + b * b), abs=1e-9)
