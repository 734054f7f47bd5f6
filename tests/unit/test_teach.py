"""Recipes taught from golden parts, ranges of empty places, positions in millimetres."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import bgars
import pytest
from bgars.station.golden import odd_empty_places
from bgars.station.teach import compact_names, teach
from test_calibrate import bgars_command

RECIPE = 'name = "x"\nrows = 11\ncols = 11\npitch_um = 800.0\n'


def test_depopulated_places_are_ranges(tmp_path: Path) -> None:
    path = tmp_path / "part.toml"
    path.write_text(RECIPE + 'depopulated = ["A1", "F6:G8"]\n', encoding="utf-8")
    assert bgars.read_part_recipe(path).layout.depopulated == ("A1", "F6", "F7", "F8", "G6", "G7", "G8")
    assert compact_names(["A1", "F6", "F7", "F8", "G6", "G7", "G8"], 11, 11) == ["A1", "F6:G8"]


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ("G8:F6", "from its first place to its last"),
        ("F6:", "two names such as"),
        ("F6:Y99", "must be on the 11 x 11 lattice"),
    ],
)
def test_a_wrong_range_is_refused(tmp_path: Path, entry: str, words: str) -> None:
    path = tmp_path / "part.toml"
    path.write_text(RECIPE + f'depopulated = ["{entry}"]\n', encoding="utf-8")
    with pytest.raises(bgars.InputError, match=words):
        bgars.read_part_recipe(path)


def test_positions_in_millimetres(tmp_path: Path) -> None:
    (tmp_path / "balls.csv").write_text("X,Y,Diameter\n-0.5,0.25,0.3\n0.5,0.25,0.3\n", encoding="utf-8")
    path = tmp_path / "part.toml"
    path.write_text('name = "x"\npositions = "balls.csv"\n', encoding="utf-8")
    assert bgars.read_part_recipe(path).layout.positions == (("1", -500.0, 250.0), ("2", 500.0, 250.0))
    (tmp_path / "balls.csv").write_text("X,Y,Diameter\n-0.5,0.25,0\n", encoding="utf-8")
    with pytest.raises(bgars.FileFormatError, match="line 2: must be x, y and a diameter above 0 in mm"):
        bgars.read_part_recipe(path)


def test_a_golden_part_teaches_its_recipe(tmp_path: Path) -> None:
    scene = bgars.Scene.ball_array(3, 3)
    rig, material = bgars.LightRig.ring(8), bgars.Material(i_d=0.3, i_s=1.0, hardness=40)
    bgars.write_simulation(*bgars.simulate(scene, rig, material, bgars.Camera()), tmp_path / "golden")
    run = bgars_command("teach", tmp_path / "golden", "-o", tmp_path / "part.toml")
    assert run.code == 0, run.stderr
    header = " ".join(line[2:] for line in (tmp_path / "part.toml").read_text(encoding="utf-8").splitlines()[:3])
    assert "the largest golden reading + 4 u, position 10 % of the pitch at least. Put" in header
    recipe = bgars.read_part_recipe(tmp_path / "part.toml")
    assert recipe.limits.true_position_um == pytest.approx(0.1 * recipe.layout.pitch_um, abs=0.06)
    assert (recipe.layout.rows, recipe.layout.cols) == (3, 3)
    assert recipe.limits.height_um is not None
    result = bgars.inspect(bgars.read_capture(tmp_path / "golden"), recipe)
    assert result.verdict == "pass", result.reasons
    run = bgars_command("teach", tmp_path / "golden", "-o", tmp_path / "part.toml")
    assert run.code == 2
    assert "--force replaces it" in run.stderr
    capture = tmp_path / "golden" / "capture.toml"
    before = capture.read_bytes()
    run = bgars_command("teach", tmp_path / "golden", "-o", capture, "--force")
    assert run.code == 2
    assert "exists and is not a part recipe" in run.stderr
    assert capture.read_bytes() == before


@pytest.fixture(scope="module")
def golden() -> bgars.PartResult:
    scene = bgars.Scene.ball_array(3, 3, jitter=bgars.Jitter(height_um=4.0, radius_um=2.0, position_um=6.0), seed=8)
    rig, material = bgars.LightRig.ring(8), bgars.Material(i_d=0.3, i_s=1.0, hardness=40)
    return bgars.inspect(bgars.simulate(scene, rig, material, bgars.Camera())[0])


ODD: list[tuple[str, dict[str, object], str]] = [
    ("B2", {"top_um": 440.0}, "B2: its height of 440.0 um is unlike that of the others"),
    ("C1", {"diameter_um": 550.0}, "C1: its diameter of 550.0 um is unlike that of the others"),
    ("A2", {"diameter_um": float("nan")}, "A2: its diameter was not measured"),
    ("C3", {"x_um": 1085.0}, r"C3: it is \d+.\d um off its place in the grid"),
    ("B2", {"reasons": ("flat top: 20 um are missing", "no limits given")}, "B2: flat top: 20 um are missing;"),
    ("B3", {"present": False}, "B3: no ball, though its mirror images in the layout have one; give two parts"),
]


@pytest.mark.parametrize(("name", "change", "words"), ODD)
def test_a_ball_unlike_its_fellows_is_no_model(
    golden: bgars.PartResult, name: str, change: dict[str, object], words: str
) -> None:
    balls = tuple(replace(ball, **change) if ball.name == name else ball for ball in golden.balls)  # type: ignore[arg-type]
    odd = replace(golden, balls=balls)
    assert teach([golden], "part").doubts == ()
    with pytest.raises(bgars.CalibrationError, match=words):
        teach([odd], "part")
    assert teach([odd], "part", accept_doubts=True).doubts[0].startswith(f"{name}: ")


def test_a_second_part_settles_an_empty_place(golden: bgars.PartResult) -> None:
    balls = tuple(replace(ball, present=ball.name != "B3") for ball in golden.balls)
    lacking = replace(golden, balls=balls)
    assert teach([lacking, lacking], "part").depopulated == ("B3",)
    with pytest.raises(bgars.InputError, match=r"on other places than .* \(9\): B3: not the same part, or"):
        teach([golden, lacking], "part")


def test_symmetric_empty_places_are_a_layout() -> None:
    full = {(row, col) for row in range(5) for col in range(5)}
    block = {(row, col) for row in (1, 2, 3) for col in (1, 2, 3)}
    assert odd_empty_places(full - block, 5, 5) == []
    assert odd_empty_places(full - {(0, 0), (0, 4), (4, 0), (4, 4)}, 5, 5) == []
    assert odd_empty_places(full - {(2, 2)}, 5, 5) == ["C3"]
    assert odd_empty_places({(0, 0), (0, 1), (0, 3), (0, 4)}, 1, 5) == ["A3"]


def test_the_command_writes_no_recipe_of_a_part_in_doubt(tmp_path: Path) -> None:
    scene = bgars.Scene.ball_array(3, 3, defects={"A1": bgars.Defect.missing()})
    rig, material = bgars.LightRig.ring(8), bgars.Material(i_d=0.3, i_s=1.0, hardness=40)
    bgars.write_simulation(*bgars.simulate(scene, rig, material, bgars.Camera()), tmp_path / "golden")
    run = bgars_command("teach", tmp_path / "golden", "-o", tmp_path / "part.toml")
    assert run.code == 2
    assert "A1: no ball" in run.stderr
    assert re.search(r"warning: .*golden: .*taller than spheres", run.stderr)
    assert not (tmp_path / "part.toml").exists()
    run = bgars_command("teach", tmp_path / "golden", "-o", tmp_path / "part.toml", "--accept-doubts")
    assert run.code == 0, run.stderr
    assert "# Accepted although in doubt: A1: no ball" in (tmp_path / "part.toml").read_text(encoding="utf-8")
    assert bgars.read_part_recipe(tmp_path / "part.toml").layout.depopulated == ("A1",)
