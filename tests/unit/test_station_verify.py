"""Readings against a part of known sizes: what is said of bias, slope, repeatability and limits."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace

import bgars
import numpy as np
import pytest
from bgars.station import verify
from bgars.station.verify import Known, read_known
from test_calibrate import bgars_command

NAMES = [f"A{index + 1}" for index in range(8)]
SIZES = np.linspace(400.0, 540.0, 8)
KNOWN = {name: Known(float(size), math.nan, 0.1) for name, size in zip(NAMES, SIZES, strict=True)}


def read(errors: np.ndarray) -> SimpleNamespace:
    balls = [
        SimpleNamespace(name=name, top_um=float(size + error), diameter_um=math.nan)
        for name, size, error in zip(NAMES, SIZES, errors, strict=True)
    ]
    return SimpleNamespace(balls=balls)


def test_bias_slope_and_repeatability_come_out() -> None:
    rng = np.random.default_rng(3)
    wrong = 1.5 + 0.01 * (SIZES - SIZES.mean())
    found, said = verify([read(wrong + rng.normal(0, 0.2, 8)) for _ in range(20)], KNOWN)
    assert found.bias_um == pytest.approx(1.5, abs=0.1)
    assert found.slope == pytest.approx(0.01, abs=0.002)
    assert found.repeatability_um == pytest.approx(0.2, abs=0.05)
    assert {one.code for one in said} == {"bias-height", "slope-height"}


@pytest.mark.parametrize(("largest", "code"), [(0.5, "mpe"), (0.9, "mpe-open"), (1.2, "mpe")])
def test_what_the_certificate_leaves_open_counts_against_the_claim(largest: float, code: str) -> None:
    errors = np.array([largest, -largest] * 4)
    _, said = verify([read(errors)], KNOWN, mpe_um=1.0)
    assert [one.code for one in said] == [code]
    assert said[0].severity == ("note" if largest < 0.8 else "fail")


def test_a_part_without_known_balls_is_refused() -> None:
    with pytest.raises(bgars.CalibrationError, match="no ball of the table has a height that was measured"):
        verify([read(np.zeros(8))], {"Z9": Known(500.0, math.nan, 0.0)})


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a,b\n1,2\n", "needs the columns name and height_um or diameter_um, got a, b"),
        ("name,height_um\nA1,tall\n", "line 2: height_um: must be a number above 0, got 'tall'"),
        ("name,height_um\nA1,5\nA1,6\n", "line 3: name must be there once, got 'A1'"),
    ],
)
def test_a_wrong_table_is_refused_in_one_line(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "known.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(bgars.BgarsError, match=words):
        read_known(path)


def test_the_command_keeps_its_result_in_the_station(tmp_path: Path) -> None:
    bgars_command("simulate", "array-4x4", "-o", str(tmp_path / "part"))
    capture = bgars.read_capture(tmp_path / "part")
    truth = bgars.inspect(capture)
    lines = [f"{ball.name},{ball.top_um},0.5" for ball in truth.balls]
    (tmp_path / "known.csv").write_text("name,height_um,u_um\n" + "\n".join(lines) + "\n", encoding="utf-8")
    station = tmp_path / "station.toml"
    bgars.write_station(bgars.Station("line 3"), station)
    done = bgars_command(
        "verify", str(tmp_path / "part"), "--known", str(tmp_path / "known.csv"), "--station", str(station),
        "--mpe-um", "5",
    )  # fmt: skip
    assert done.code == 0, done.stderr
    assert "height: bias +0.00 um" in done.stdout
    kept = bgars.read_station(station)
    assert [(one.quantity, one.balls, one.mpe_um) for one in kept.verified] == [("height", 16, 5.0)]
    assert "Against a part of known sizes" in station.with_suffix(".html").read_text(encoding="utf-8")


def test_each_error_is_judged_by_the_certificate_of_its_own_ball() -> None:
    """The largest uncertainty of the table took the room from all of them."""
    known = {**KNOWN, "A8": Known(540.0, math.nan, 0.4)}
    errors = np.array([0.7, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.1])
    _, said = verify([read(errors)], known, mpe_um=1.0)
    assert [(one.code, one.severity) for one in said] == [("mpe", "note")]
    _, said = verify([read(errors[::-1])], known, mpe_um=1.0)
    assert [(one.code, one.severity) for one in said] == [("mpe-open", "fail")]
    assert "error 0.70 um of A8, permissible 1.00 um, less 0.80 um" in said[0].message


def test_an_uncertainty_that_is_not_stated_is_not_0(tmp_path: Path) -> None:
    table = tmp_path / "known.csv"
    lines = [f"{name},{size}" for name, size in zip(NAMES, SIZES, strict=True)]
    table.write_text("\n".join(["name,height_um,u_um", *(f"{line}," for line in lines)]))
    known = read_known(table)
    _, said = verify([read(np.full(8, 0.2))], known, mpe_um=1.0)
    assert [one.severity for one in said if one.code == "mpe-open"] == ["fail"]
    assert "u_um of 8 balls is not in the table (A1, A2, A3" in said[0].message
    table.write_text("\n".join(["name,height_um", *lines]))
    assert math.isnan(read_known(table)["A1"].u_um)
    _, said = verify([read(np.zeros(8))], read_known(table))
    assert [one.code for one in said] == ["bias-unstated-height"]
