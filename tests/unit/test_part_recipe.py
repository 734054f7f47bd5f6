"""Part recipes: what they give, and one clear message for each mistake."""

from __future__ import annotations

import re
from pathlib import Path

import bgars
import pytest
from bgars.io.part_recipe import recipe_keys

ROOT = Path(__file__).parents[2]
LATTICE = 'name = "p"\nrows = 4\ncols = 5\npitch_um = 1000.0\n'
GRID = "rows = 4\ncols = 5\npitch_um = 1000.0\n"


def write(folder: Path, text: str) -> Path:
    path = folder / "part.toml"
    path.write_text(text, encoding="utf-8")
    return path


def refused(path: Path, *words: str) -> None:
    with pytest.raises(bgars.BgarsError) as caught:
        bgars.read_part_recipe(path)
    message = str(caught.value)
    assert "\n" not in message
    for word in words:
        assert word in message, message


def test_a_whole_recipe(tmp_path: Path) -> None:
    (tmp_path / "solder.json").touch()
    text = LATTICE + (
        'view = "top"\ndepopulated = ["B2", "C3"]\ndiameter_um = 600\nheight_um = 500\ngravity_um = [10, -20.5]\n'
        '[limits]\ndiameter_um = [560, 640]\nseating_coplanarity_um = 80\n[material]\nfile = "solder.json"\n'
    )
    recipe = bgars.read_part_recipe(write(tmp_path, text))
    assert recipe.layout.depopulated == ("B2", "C3")
    assert recipe.image_layout.depopulated == ("B4", "C3")
    assert recipe.gravity_um == (10.0, -20.5)
    assert recipe.limits.diameter_um == (560.0, 640.0)
    assert recipe.limits.range_of("seating_coplanarity_um") == (None, 80.0)
    assert recipe.limits.height_um is None
    assert recipe.material_file == tmp_path / "solder.json"


@pytest.mark.parametrize(
    ("text", "stated"),
    [
        ("", (None, None, None)),
        ("aspect_ratio = 0.95\nu_aspect_ratio = 0.02\npitch_u_um = 0.5\n", (0.95, 0.02, 0.5)),
        ("aspect_ratio = 1\n", (1.0, 0.01, None)),
        ("u_aspect_ratio = 0.003\n", (1.0, 0.003, None)),
    ],
)
def test_what_is_known_of_the_balls_and_the_lattice(
    tmp_path: Path, text: str, stated: tuple[float | None, ...]
) -> None:
    recipe = bgars.read_part_recipe(write(tmp_path, LATTICE + text))
    assert (recipe.aspect_ratio, recipe.u_aspect_ratio, recipe.pitch_u_um) == stated
    values = recipe.to_dict()
    assert (values["aspect_ratio"], values["u_aspect_ratio"], values["pitch_u_um"]) == stated


def test_old_names_of_keys_are_taken_with_a_warning_that_names_the_file(tmp_path: Path) -> None:
    old = "q = 0.95\nu_q = 0.02\n[limits]\nq = [0.9, 1.1]\nflat_um = 10\n"
    path = write(tmp_path, LATTICE + old)
    with pytest.warns(FutureWarning) as told:
        recipe = bgars.read_part_recipe(path)
    assert {str(entry.message).split(";")[0] for entry in told} == {
        f"{path}: {was} is called {now} now"
        for was, now in (("q", "aspect_ratio"), ("u_q", "u_aspect_ratio"), ("flat_um", "flat_top_depth_um"))
    }
    assert (recipe.aspect_ratio, recipe.u_aspect_ratio) == (0.95, 0.02)
    assert recipe.limits == bgars.Limits(aspect_ratio=(0.9, 1.1), flat_top_depth_um=10.0)
    both = write(tmp_path, LATTICE + "q = 0.95\naspect_ratio = 0.95\n")
    with pytest.raises(bgars.InputError, match="unknown key 'q'"):
        bgars.read_part_recipe(both)


def test_a_recipe_made_in_python_obeys_the_same_rules() -> None:
    layout = bgars.BallLayout(rows=2, cols=2, pitch_um=1000.0)
    assert bgars.PartRecipe("p", layout, aspect_ratio=0.9).u_aspect_ratio == 0.01
    assert bgars.PartRecipe("p", layout, u_aspect_ratio=0.02).aspect_ratio == 1.0
    wrong = ({"aspect_ratio": float("nan")}, {"u_aspect_ratio": -1.0}, {"pitch_u_um": float("inf")})
    for values in wrong:
        with pytest.raises(bgars.InputError, match=f"{next(iter(values))}: must be "):
            bgars.PartRecipe("p", layout, **values)


def test_positions_instead_of_a_lattice(tmp_path: Path) -> None:
    (tmp_path / "balls.csv").write_text("name,x_um,y_um\nA1, -500, 0\nA2,500,0\n\nB7,0,800\n", encoding="utf-8")
    recipe = bgars.read_part_recipe(write(tmp_path, 'name = "p"\npositions = "balls.csv"\nview = "top"\n'))
    assert recipe.layout.positions == (("A1", -500.0, 0.0), ("A2", 500.0, 0.0), ("B7", 0.0, 800.0))
    assert recipe.image_layout.positions[0] == ("A1", 500.0, 0.0)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (LATTICE + "pitch = 3\n", ["unknown key 'pitch'", "'pitch_um'"]),
        (LATTICE + "[limits]\ndiameter = [1, 2]\n", ["unknown key 'limits.diameter'", "'diameter_um'"]),
        (LATTICE + "[limits]\ndiameter_mm = [0.5, 0.6]\n", ["unknown key 'limits.diameter_mm'", "'diameter_um'"]),
        (LATTICE + "[limits]\nheight = [1, 2]\n", ["unknown key 'limits.height'", "'height_um'"]),
        (LATTICE + "[limits]\ntrue_position = 50\n", ["limits.true_position", "'true_position_um'"]),
        (LATTICE + "[limits]\nseating_coplanarity = 50\n", ["limits.seating_coplanarity", "'seating_coplanarity_um'"]),
        (LATTICE + "[limits]\nwarpage = 50\n", ["limits.warpage", "'warpage_um'"]),
        (LATTICE + "[limits]\ndiameter_um = [640, 560]\n", ["limits", "diameter_um", "lowest < highest", "[640, 560]"]),
        (LATTICE + "[limits]\ndiameter_um = [600, 600]\n", ["limits", "diameter_um", "lowest < highest"]),
        (LATTICE + "[limits]\ndiameter_um = 600\n", ["limits.diameter_um", "600"]),
        (LATTICE + "[limits]\ndiameter_um = [1, 2, 3]\n", ["limits.diameter_um"]),
        (LATTICE + "[limits]\ndiameter_um = [-5, 640]\n", ["limits.diameter_um", "greater than or equal to 0", "-5"]),
        (LATTICE + "[limits]\nwarpage_um = -5\n", ["limits.warpage_um", "greater than 0", "-5"]),
        (LATTICE + "[limits]\nwarpage_um = [0, 5]\n", ["limits.warpage_um", "number"]),
        (LATTICE + "[limits]\nwarpage_um = nan\n", ["limits.warpage_um", "nan"]),
        (LATTICE + "[limits]\nwarpage_um = inf\n", ["limits.warpage_um", "finite", "inf"]),
        (LATTICE + '[limits]\nwarpage_um = "50 um"\n', ["limits.warpage_um", "number", "50 um"]),
        (LATTICE + "[limits]\nwarpage_um = true\n", ["limits.warpage_um", "True"]),
        (LATTICE + "[limit]\nwarpage_um = 5\n", ["unknown key 'limit'", "'limits'"]),
        ('name = "p"\nrows = 4\ncols = 5\n', ["missing: pitch_um"]),
        (LATTICE + "aspect_ratio = 0.19\n", ["aspect_ratio: must be from 0.2 to 2", "got 0.19"]),
        (LATTICE + "aspect_ratio = 2.1\n", ["aspect_ratio: must be from 0.2 to 2", "got 2.1"]),
        (LATTICE + "aspect_ratio = nan\n", ["aspect_ratio: ", "finite", "nan"]),
        (LATTICE + "aspect_ratio = [0.9, 1.1]\n", ["aspect_ratio: ", "number", "[0.9, 1.1]"]),
        (LATTICE + "aspect_ratio = true\n", ["aspect_ratio: ", "number", "True"]),
        (LATTICE + "u_aspect_ratio = 0\n", ["u_aspect_ratio: ", "greater than 0", "0"]),
        (LATTICE + "u_aspect_ratio = inf\n", ["u_aspect_ratio: ", "finite", "inf"]),
        (LATTICE + 'u_aspect_ratio = "1 %"\n', ["u_aspect_ratio: ", "number", "1 %"]),
        (
            LATTICE + "aspect_ratio = 0.9\n[limits]\naspect_ratio = [0.95, 1.05]\n",
            ["aspect_ratio: ", "within limits.aspect_ratio (0.95 to 1.05)", "got 0.9"],
        ),
        (LATTICE + "pitch_u_um = -1\n", ["pitch_u_um: ", "greater than 0", "-1"]),
        (LATTICE + "u_pitch_um = 1\n", ["unknown key 'u_pitch_um'", "nearest known key is 'pitch_u"]),
        ('name = "p"\n', ["rows, cols and pitch_um, or positions"]),
        (GRID, ["name", "required"]),
        (LATTICE + 'positions = "b.csv"\n', ["contradictory layout", "positions excludes rows, cols, pitch_um"]),
        ('name = "p"\npositions = "b.csv"\ndepopulated = ["A1"]\n', ["positions excludes depopulated"]),
        ('name = "p"\npositions = "b.csv"\n', ["b.csv", "cannot be read"]),
        (LATTICE + 'depopulated = ["E1"]\n', ["depopulated", "4 x 5 lattice (A1 to D5)", "'E1'"]),
        (LATTICE + 'depopulated = ["A6"]\n', ["depopulated", "A1 to D5", "'A6'"]),
        (LATTICE + 'depopulated = ["I1"]\n', ["depopulated", "ABCDEFGH", "'I1'"]),
        (LATTICE + 'depopulated = ["a1"]\n', ["depopulated", "'a1'"]),
        (LATTICE + 'depopulated = ["A1", "A1"]\n', ["depopulated", "once", "'A1' twice"]),
        ('name = "p"\nrows = 1\ncols = 1\npitch_um = 9\ndepopulated = ["A1"]\n', ["must leave a ball"]),
        ('name = "p"\nrows = 0\ncols = 5\npitch_um = 9\n', ["rows", "greater than or equal to 1", "0"]),
        ('name = "p"\nrows = 2.5\ncols = 5\npitch_um = 9\n', ["rows", "integer", "2.5"]),
        ('name = "p"\nrows = 200\ncols = 200\npitch_um = 9\n', ["32767", "200 x 200"]),
        ('name = "p"\nrows = 2\ncols = 5\npitch_um = -9\n', ["pitch_um", "greater than 0", "-9"]),
        (LATTICE + 'view = "side"\n', ["view", "'bottom' or 'top'", "side"]),
        (LATTICE + "diameter_um = 1000\n", ["diameter_um", "below pitch_um", "1000"]),
        (
            LATTICE + "diameter_um = 600\n[limits]\ndiameter_um = [400, 500]\n",
            ["diameter_um", "within limits.diameter_um (400 to 500)", "600"],
        ),
        (LATTICE + "height_um = 600\n[limits]\nheight_um = [400, 500]\n", ["height_um", "400 to 500", "600"]),
        (LATTICE + "[limits]\npitch_um = [990, 999]\n", ["pitch_um", "990 to 999", "1000"]),
        (LATTICE + "gravity_um = [1, 2, 3]\n", ["gravity_um", "[x, y]"]),
        (LATTICE + '[material]\nfile = "none.json"\n', ["material.file", "no such file"]),
        (LATTICE + "[material]\n", ["material.file", "required"]),
        ("rows = \n", ["is not valid TOML"]),
    ],
)
def test_mistakes(tmp_path: Path, text: str, words: list[str]) -> None:
    refused(write(tmp_path, text), "part.toml" if "b.csv" not in words else "b.csv", *words)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ("", ["line 1", "name,x_um,y_um"]),
        ("name,x,y\nA1,0,0\n", ["line 1", "name,x_um,y_um", "name,x,y"]),
        ("name,x_um,y_um\n", ["1 to 32767 positions", "0"]),
        ("name,x_um,y_um\nA1,0\n", ["line 2", "two finite numbers", "A1,0"]),
        ("name,x_um,y_um\nA1,0,0\nA2,left,0\n", ["line 3", "left"]),
        ("name,x_um,y_um\nA1,nan,0\n", ["line 2", "finite"]),
        ("name,x_um,y_um\n,0,0\n", ["line 2", "a name"]),
        ("name,x_um,y_um\nA1,0,0,5\n", ["line 2", "A1,0,0,5"]),
        ("name,x_um,y_um\nA1,0,0\nA1,900,0\n", ["once", "'A1' twice"]),
        ("name,x_um,y_um\nA1,0,0\nA2,0,0\n", ["A1 and A2", "more than 600 um apart", "0 um"]),
        ("name,x_um,y_um\nA1,0,0\nA2,0,599\n", ["A1 and A2", "599"]),
    ],
)
def test_mistakes_in_positions(tmp_path: Path, table: str, words: list[str]) -> None:
    (tmp_path / "b.csv").write_text(table, encoding="utf-8")
    refused(write(tmp_path, 'name = "p"\npositions = "b.csv"\ndiameter_um = 600\n'), "b.csv", *words)


def test_a_pitch_limit_needs_a_pitch(tmp_path: Path) -> None:
    (tmp_path / "b.csv").write_text("name,x_um,y_um\nA1,0,0\n", encoding="utf-8")
    refused(
        write(tmp_path, 'name = "p"\npositions = "b.csv"\n[limits]\npitch_um = [1, 2]\n'),
        "limits.pitch_um",
        "positions",
    )


def test_an_uncertainty_of_the_pitch_needs_a_pitch(tmp_path: Path) -> None:
    (tmp_path / "b.csv").write_text("name,x_um,y_um\nA1,0,0\n", encoding="utf-8")
    path = write(tmp_path, 'name = "p"\npositions = "b.csv"\npitch_u_um = 0.5\n')
    refused(path, "part.toml: pitch_u_um: goes with rows, cols and pitch_um", "got 0.5")


def test_files_that_are_none(tmp_path: Path) -> None:
    refused(tmp_path / "none.toml", "none.toml", "cannot be read")
    refused(tmp_path, "cannot be read")


def test_the_sample_names_every_kind_of_limit() -> None:
    recipe = bgars.read_part_recipe(bgars.sample_part_recipe())
    missing = [name for name, _ in recipe_keys() if name.startswith("limits.") and not recipe.limits.range_of(name[7:])]
    assert missing == []


def test_the_documentation_lists_every_key() -> None:
    page = (ROOT / "docs" / "inspection.md").read_text(encoding="utf-8")
    page = page.partition("## The recipe\n")[2].partition("\n## ")[0]
    rows = dict(re.findall(r"^\| `([a-z_.]+)` \| (.*) \|$", page, re.MULTILINE))
    assert rows == dict(recipe_keys())


def test_the_recipe_of_the_documentation_is_one(tmp_path: Path) -> None:
    page = (ROOT / "docs" / "inspection.md").read_text(encoding="utf-8")
    text, strip = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    recipe = bgars.read_part_recipe(write(tmp_path, text))
    assert bgars.read_part_recipe(write(tmp_path, text + strip)).strip is not None
    assert recipe.limits.seating_coplanarity_um == 80.0
    assert recipe.layout == bgars.read_part_recipe(bgars.sample_part_recipe()).layout, "of the part of its name"
