"""Recipes taught from golden parts, ranges of empty places, positions in millimetres."""

from __future__ import annotations

from pathlib import Path

import bgars
import pytest
from bgars.station.teach import compact_names
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
