"""No wrong verdict on rendered parts: what is out of its limits never passes, what is within never fails."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import bgars
import pytest
from bgars.records.ball_layout import BallLayout
from bgars.records.part_recipe import Limits, PartRecipe

pytestmark = pytest.mark.data
LIMITS = Limits(
    true_position_um=50.0, diameter_um=(560.0, 640.0), height_um=(460.0, 540.0), seating_coplanarity_um=60.0
)


def true_balls(folder: Path) -> dict[str, dict[str, float]]:
    """Diameter and height in um of each ball; NaN of a missing one."""
    with (folder / "balls.csv").open(encoding="utf-8", newline="") as file:
        return {
            row["name"]: {
                "present": float(row["present"]),
                "diameter_um": 2000.0 * float(row["radius_mm"]),
                "height_um": 1000.0 * float(row["top_height_mm"]),
                "off_um": 1000.0
                * math.hypot(float(row["x_mm"]) - float(row["x_nom_mm"]), float(row["y_mm"]) - float(row["y_nom_mm"])),
            }
            for row in csv.DictReader(file)
        }


def is_good(ball: dict[str, float]) -> bool:
    return (
        ball["present"] == 1.0
        and 560.0 <= ball["diameter_um"] <= 640.0
        and 460.0 <= ball["height_um"] <= 540.0
        and ball["off_um"] <= 50.0
    )


@pytest.mark.parametrize(
    ("scene", "side"),
    [
        ("C_grid_4x4_paper", 4),
        ("C2_grid_4x4_gamma", 4),
        ("D_grid_5x5_defects", 5),
        ("D2_grid_5x5_defects_bow", 5),
        ("G_grid_10x10_large", 10),
        ("K1_two_lobe", 5),
        ("K2_ball_variation", 5),
        ("K3_realistic", 5),
    ],
)
def test_no_wrong_verdict(data_folder: Path, scene: str, side: int) -> None:
    folder = data_folder / "scenes" / scene
    recipe = PartRecipe(scene, BallLayout(rows=side, cols=side, pitch_um=1000.0), limits=LIMITS)
    result = bgars.inspect(bgars.read_capture(folder), recipe)
    truth = true_balls(folder)
    assert {ball.name for ball in result.balls} == set(truth)
    for ball in result.balls:
        good = is_good(truth[ball.name])
        assert ball.verdict != ("fail" if good else "pass"), (ball.name, ball.reasons)
        assert ball.present == (truth[ball.name]["present"] == 1.0)
    if not all(is_good(ball) for ball in truth.values()):
        assert result.verdict == "fail"
    else:
        assert all(ball.verdict == "pass" for ball in result.balls)
