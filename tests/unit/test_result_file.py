"""result.json: written, published as a schema, read again; everything else is refused with its name."""

from __future__ import annotations

import json
import math
import runpy
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Annotated, Any

import bgars
import jsonschema
import pytest
from bgars.io.result_schema import table_of
from bgars.records.ball_layout import BallLayout
from bgars.records.keys import Key, as_plain, keys_of
from bgars.records.part_check import PartCheck
from bgars.records.part_identity import PartIdentity
from bgars.records.part_recipe import PartRecipe
from bgars.records.seating_result import SeatingResult
from judged_parts import LIMITS, RECIPE, judged

DOCS = Path(__file__).parents[2] / "docs"
LIST = PartRecipe("list", BallLayout(positions=(("P", -500.0, 0.0), ("Q", 500.0, 0.0))), limits=LIMITS)


def empty() -> bgars.PartResult:
    scene = bgars.Scene.plane(size_um=(4000.0, 4000.0))
    capture, _ = bgars.simulate(
        scene, bgars.LightRig.ring(4), bgars.Material(), bgars.Camera(pixel_pitch_um=100.0, read_noise_levels=1.0)
    )
    return bgars.inspect(capture, replace(RECIPE, file=None))


CASES: dict[str, tuple[str, Callable[[], bgars.PartResult]]] = {
    "pass": ("pass", judged),
    "missing ball": ("fail", lambda: judged(defects={"B2": bgars.Defect.missing()})),
    "bridge": ("fail", lambda: judged(bridges=(bgars.Bridge("A1", "A2", radius_um=80.0),))),
    "too near its limit": (
        "undecided",
        lambda: judged(replace(RECIPE, limits=replace(LIMITS, true_position_um=2.5))),
    ),
    "no recipe": ("undecided", lambda: judged(None)),
    "list of places": ("fail", lambda: judged(LIST)),
    "no ball at all": ("undecided", empty),
}


@pytest.mark.parametrize("name", list(CASES))
def test_a_result_is_valid_by_the_schema_and_comes_back_as_it_was(name: str, tmp_path: Path) -> None:
    verdict, made = CASES[name]
    result = made()
    assert result.verdict == verdict, result.reasons
    text = result.to_json()
    schema = json.loads((DOCS / "result.schema.json").read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator(schema).validate(json.loads(text))
    (tmp_path / "result.json").write_text(text, encoding="utf-8")
    for place in (tmp_path, tmp_path / "result.json"):
        again = bgars.read_result(place)
        assert again.to_json() == text
        assert again.to_csv() == result.to_csv()
        assert again.to_table() == result.to_table()
    assert again.recipe == result.recipe
    assert again.light_directions.shape == result.light_directions.shape


def test_the_published_schema_is_the_generated_one() -> None:
    made = runpy.run_path(str(DOCS / "make_result_schema.py"))["schema_text"]()
    assert (DOCS / "result.schema.json").read_text(encoding="utf-8") == made, "run `make schema`"
    schema = json.loads(made)
    jsonschema.Draft202012Validator.check_schema(schema)
    for table in [schema, *schema["$defs"].values()]:
        assert table["additionalProperties"] is False
        assert set(table["required"]) == set(table["properties"])
        for key, entry in table["properties"].items():
            assert len(entry["description"]) > 10, key
            if key.endswith("_um"):
                assert " um" in entry["description"] or "um " in entry["description"], key


@pytest.mark.parametrize("record", [bgars.PartResult, bgars.BallResult, PartCheck, SeatingResult, bgars.PartRecipe])
def test_every_field_of_a_result_is_a_key_of_the_file(record: type) -> None:
    assert [entry.name for entry in fields(record) if entry.name != "surface"] == list(keys_of(record))


def test_a_field_is_all_that_a_reading_takes() -> None:
    @dataclass(frozen=True)
    class Weighed:
        """A ball on a balance."""

        mass_ug: Annotated[float, Key("mass of the solder, in ug", is_late=True)] = math.nan

    assert as_plain(Weighed()) == {"mass_ug": None}
    table = table_of(Weighed)
    assert table.model_validate({}).mass_ug is None
    assert table.model_json_schema()["properties"]["mass_ug"]["description"] == "mass of the solder, in ug"
    with pytest.raises(ValueError, match="mass_ug"):
        table.model_validate({"mass_ug": "heavy"})


def test_what_a_recipe_knows_of_balls_and_lattice_comes_back(tmp_path: Path) -> None:
    result = judged(replace(RECIPE, aspect_ratio=0.98, u_aspect_ratio=0.02, pitch_u_um=0.5))
    text = result.to_json()
    assert '"aspect_ratio": 0.98' in text
    (tmp_path / "result.json").write_text(text, encoding="utf-8")
    again = bgars.read_result(tmp_path)
    assert again.recipe == result.recipe
    assert again.to_json() == text


def test_a_result_from_before_recipes_could_state_q_is_read(tmp_path: Path) -> None:
    values = json.loads(judged().to_json())
    for key in ("aspect_ratio", "u_aspect_ratio", "pitch_u_um"):
        assert values["recipe"].pop(key) is None
    (tmp_path / "result.json").write_text(json.dumps(values), encoding="utf-8")
    assert bgars.read_result(tmp_path).recipe == RECIPE


OLD_NAMES = {"q": "aspect_ratio", "flat_um": "flat_top_depth_um"}
OLD_NAMES |= {f"u_{old}": f"u_{new}" for old, new in OLD_NAMES.items()} | {"normals_choice": "method_reason"}
LATER = {
    2: ("material", "normals_choice"),
    3: ("seating_budget", "budget"),
    4: ("identity", "q", "u_q", "pitch_u_um", "strip"),
}
"""Keys that came with a version, of the result, its recipe and its balls."""


@pytest.mark.parametrize("version", [1, 2, 3, 4])
def test_results_of_every_earlier_version_are_read(version: int, tmp_path: Path) -> None:
    """As that version wrote them: with its names, and without the keys that came later."""
    result = judged()
    values = json.loads(result.to_json()) | {"format_version": version}
    for table in (values, values["recipe"], values["recipe"]["limits"], *values["balls"]):
        for old, new in OLD_NAMES.items():
            if new in table:
                table[old] = table.pop(new)
    late = {key for came, keys in LATER.items() if came > version for key in keys}
    balls = ((ball, late - {"q", "u_q"}) for ball in values["balls"])
    for table, keys in ((values, late), (values["recipe"], late), *balls):
        for key in keys & table.keys():
            del table[key]
    (tmp_path / "result.json").write_text(json.dumps(values), encoding="utf-8")
    again = bgars.read_result(tmp_path)
    known = {} if version > 1 else {"material": None, "method_reason": ""}
    budgets = {} if version > 2 else {"seating_budget": {}, "balls": tuple(replace(b, budget={}) for b in result.balls)}
    identity = {} if version > 3 else {"identity": PartIdentity()}
    assert again.to_json() == replace(result, **known, **budgets, **identity).to_json()


def change(key: str, value: object) -> Callable[[dict[str, Any]], object]:
    return lambda values: values.update({key: value})


SPOILT: dict[str, tuple[Callable[[dict[str, Any]], object], str]] = {
    "foreign": (lambda v: v.pop("format"), "is not a result of bgars: it must be an object"),
    "older": (lambda v: v.pop("format_version"), "format_version: this bgars reads 1 to 5, got None"),
    "newer": (change("format_version", 6), "format_version: this bgars reads 1 to 5, got 6"),
    "key gone": (lambda v: v["balls"][2].pop("top_um"), "balls.2.top_um: Field required"),
    "unknown key": (change("colour", "red"), "unknown key 'colour'"),
    "unknown key of a ball": (lambda v: v["balls"][0].update(x_mm=1), "unknown key 'balls.0.x_mm'; the nearest known"),
    "text for a number": (lambda v: v["balls"][1].update(x_um="5"), "balls.1.x_um: Input should be a valid number"),
    "verdict": (change("verdict", "maybe"), "verdict: Input should be 'pass', 'fail' or 'undecided', got 'maybe'"),
    "one light too few": (lambda v: v["light_change_deg"].pop(), "light_change_deg: must have one number for each"),
    "no pitch": (change("pixel_pitch_um", None), "pixel_pitch_um: Input should be a valid number"),
    "contradicting layout": (lambda v: v["recipe"]["layout"].update(rows=None), "recipe: layout.rows: must be above 0"),
    "impossible q": (
        lambda v: v["recipe"].update(aspect_ratio=5.0),
        "recipe: aspect_ratio: must be from 0.2 to 2, got 5",
    ),
    "checksum": (lambda v: v["files"][0].update(sha256="abc"), "files.0.sha256"),
    "material's unit": (lambda v: v["material"]["parameters"][0].update(unit="cd"), "material.parameters.0.unit"),
    "time": (change("inspected_utc", "yesterday"), "inspected_utc"),
}


@pytest.mark.parametrize("name", list(SPOILT))
def test_a_spoilt_result_is_refused_by_file_and_key(name: str, tmp_path: Path) -> None:
    spoil, words = SPOILT[name]
    values = json.loads(judged().to_json())
    spoil(values)
    path = tmp_path / "result.json"
    path.write_text(json.dumps(values), encoding="utf-8")
    with pytest.raises(bgars.FileFormatError) as error:
        bgars.read_result(path)
    assert str(error.value).startswith(f"{path}: ")
    assert words in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "is not valid JSON"),
        (b'{"format": "bgars-result", "balls": [', "is not valid JSON: cut off"),
        (b"\xff\xfe\x00", "is not valid JSON"),
        (b'{"pitch_um": NaN}', "holds NaN"),
        (b"[]", "but it is a list"),
        (b'{"seating_coplanarity_um": 3}', "made before results had a format"),
        (b"[" * 100_000, "is not valid JSON"),
    ],
)
def test_a_file_that_is_no_result_is_refused_by_name(content: bytes, words: str, tmp_path: Path) -> None:
    path = tmp_path / "x.json"
    path.write_bytes(content)
    with pytest.raises(bgars.FileFormatError) as error:
        bgars.read_result(path)
    assert str(path) in str(error.value)
    assert words in str(error.value)


def test_a_folder_without_a_result_and_no_file_at_all_are_named(tmp_path: Path) -> None:
    with pytest.raises(bgars.FileFormatError, match=r"holds no result\.json"):
        bgars.read_result(tmp_path)
    with pytest.raises(bgars.FileFormatError, match=r"gone\.json: cannot be read"):
        bgars.read_result(tmp_path / "gone.json")


def test_every_cut_of_a_result_is_refused(tmp_path: Path) -> None:
    text = judged().to_json().rstrip()
    path = tmp_path / "result.json"
    for length in range(0, len(text), 997):
        path.write_text(text[:length], encoding="utf-8")
        with pytest.raises(bgars.FileFormatError, match=r"result\.json"):
            bgars.read_result(path)
