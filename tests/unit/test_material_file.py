"""Material files: what is written comes back, and each mistake is one clear line."""

from __future__ import annotations

import re
from pathlib import Path

import bgars
import pytest
from bgars.cli.app import app
from typer.testing import CliRunner

ONE_LOBE = bgars.SurfaceMaterial(
    diffuse_level=127.3,
    grazing=0.0,
    ambient_level=-0.1,
    lobes=(bgars.SurfaceLobe(strength_level=255.0, roughness=1 / 3, tail=0.25),),
    masking="cook-torrance",
    gains=(1.0, 0.97, 1.0, 1.0, 1.01, 1.0),
    standard_errors={"diffuse": 0.02, "ambient": 0.01, "strength_1": 0.3, "roughness_1": 1e-4, "gain_5": 0.001},
)
TWO_LOBES = bgars.SurfaceMaterial(
    12.0, -0.3, 0.0, (bgars.SurfaceLobe(200.0, 0.1, 1.0), bgars.SurfaceLobe(20.0, 0.6, 0.0)), "smith", (1.0,) * 8
)


@pytest.mark.parametrize("material", [ONE_LOBE, TWO_LOBES], ids=["one lobe", "two lobes"])
def test_what_is_written_is_read_back_bit_by_bit(tmp_path: Path, material: bgars.SurfaceMaterial) -> None:
    path = tmp_path / "solder.toml"
    bgars.write_material(material, path, capture='bo"ard\n\x7fü', balls=16, loss=0.031)
    assert bgars.read_material(path) == material
    assert [child.name for child in tmp_path.iterdir()] == ["solder.toml"], "nothing half-written stays"


def test_the_file_names_units_and_where_the_material_comes_from(tmp_path: Path) -> None:
    path = tmp_path / "solder.toml"
    bgars.write_material(ONE_LOBE, path, capture="board_7", balls=16, loss=0.031)
    text = path.read_text(encoding="utf-8")
    for words in (
        "diffuse_level = 127.3",
        "strength_1_level = 0.3",
        'capture = "board_7"',
        "balls = 16",
        "loss = 0.031",
    ):
        assert words in text


def test_the_documented_file_is_read(tmp_path: Path) -> None:
    page = (Path(__file__).parents[2] / "docs" / "conventions.md").read_text(encoding="utf-8")
    path = tmp_path / "solder.toml"
    path.write_text(page.split("## Material files")[1].split("```toml")[1].split("```")[0], encoding="utf-8")
    material = bgars.read_material(path)
    assert (material.diffuse_level, len(material.gains), len(material.lobes)) == (76.5, 8, 1)
    assert material.standard_errors == {"diffuse": 0.5, "strength_1": 2.1, "roughness_1": 0.0012, "gain_0": 0.003}


BROKEN = [
    ("diffuse_level = 127.3", "", "diffuse_level: Field required"),
    ("diffuse_level = 127.3", "diffuse_level = -1.0", "diffuse_level: .*greater than or equal to 0, got -1.0"),
    ("diffuse_level = 127.3", "diffuse = 127.3", "unknown key 'diffuse'; the nearest known key is 'diffuse_level'"),
    ("grazing = 0.0", "grazing = nan", "grazing: .*finite number, got nan"),
    ("roughness = 0.3333333333333333", "roughness = 1.5", "lobes.0.roughness: .*less than or equal to 1, got 1.5"),
    ("tail = 0.25", "tail = -0.5", "lobes.0.tail: .*greater than or equal to 0, got -0.5"),
    ("tail = 0.25", "tails = 0.25", "unknown key 'lobes.0.tails'; the nearest known key is 'tail'"),
    ('"cook-torrance"', '"phong"', "masking: .*'smith' or 'cook-torrance', got 'phong'"),
    ("gains = [1.0,", "gains = [0.0,", "gains.0: .*greater than 0, got 0.0"),
    ("gains = [", "gains = [] # [", "gains: .*at least 1 item"),
    ("roughness_1 =", "roughness_2 =", "'roughness_2' is no parameter of this material"),
    ("gain_5 =", "gain_6 =", "'gain_6' is no parameter of this material"),
    ("balls = 16", "balls = -1", "fit.balls: .*greater than or equal to 0, got -1"),
    ("grazing = 0.0", "grazing = ", "is not valid TOML"),
]


@pytest.mark.parametrize(("old", "new", "words"), BROKEN)
def test_a_mistake_is_one_line_with_file_key_rule_and_value(tmp_path: Path, old: str, new: str, words: str) -> None:
    path = tmp_path / "solder.toml"
    bgars.write_material(ONE_LOBE, path, balls=16)
    text = path.read_text(encoding="utf-8")
    assert text.count(old) == 1
    path.write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(bgars.BgarsError, match=words) as caught:
        bgars.read_material(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_a_third_lobe_and_a_missing_file_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "solder.toml"
    bgars.write_material(TWO_LOBES, path)
    text = path.read_text(encoding="utf-8")
    lobe = "[[lobes]]\nstrength_level = 1.0\nroughness = 0.1\ntail = 0.0\n\n"
    path.write_text(text.replace("[fit]", f"{lobe}[fit]"), encoding="utf-8")
    with pytest.raises(bgars.InputError, match=r"lobes: .*at most 2 items"):
        bgars.read_material(path)
    with pytest.raises(bgars.FileFormatError, match=r"none\.toml: cannot be read"):
        bgars.read_material(tmp_path / "none.toml")


def test_a_material_of_other_lights_names_its_gains(tmp_path: Path) -> None:
    path = tmp_path / "solder.toml"
    bgars.write_material(ONE_LOBE, path)
    assert bgars.read_material(path, lights=6) == ONE_LOBE
    with pytest.raises(bgars.InputError) as caught:
        bgars.read_material(path, lights=8)
    assert str(caught.value) == f"{path}: gains: must have one number for each of the capture's 8 lights, got 6"
    text = re.sub(r"gains = \[[\d.]+, ", "gains = [", path.read_text(encoding="utf-8"))
    path.write_text(text, encoding="utf-8")
    with pytest.raises(bgars.InputError) as caught:
        bgars.read_material(path)
    words = "standard_errors: 'gain_5' is no parameter of this material (gains: one per light, got 5; known: "
    assert str(caught.value).startswith(f"{path}: {words}")


@pytest.mark.parametrize("command", ["normals", "reconstruct"])
def test_a_command_names_the_file_whose_gains_do_not_fit(tmp_path: Path, capture_folder: Path, command: str) -> None:
    bgars.write_material(ONE_LOBE, tmp_path / "solder.toml")
    options = ["-o", str(tmp_path / "out"), "--material", str(tmp_path / "solder.toml")]
    said = str(CliRunner().invoke(app, [command, str(capture_folder), *options]).exception)
    assert said.endswith("solder.toml: gains: must have one number for each of the capture's 4 lights, got 6")


def test_a_material_is_written_as_toml_only_and_into_folders_that_exist(tmp_path: Path) -> None:
    with pytest.raises(bgars.InputError, match=r"must end in \.toml, got \.txt"):
        bgars.write_material(ONE_LOBE, tmp_path / "solder.txt")
    with pytest.raises(bgars.FileFormatError, match=re.escape(str(tmp_path / "no" / "solder.toml"))):
        bgars.write_material(ONE_LOBE, tmp_path / "no" / "solder.toml")
    assert list(tmp_path.iterdir()) == []
