"""`bgars grr` and `bgars spc`: files, exit codes, pages, and every kind of bad input with its name."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import bgars
import pytest
from bgars.cli.app import app
from bgars.cli.console import EXIT_BAD_INPUT
from bgars.studies import study_folder
from judged_parts import RECIPE, judged, write_results, write_study
from typer.testing import CliRunner

NASTY = "<script>alert('x')</script> & co"


def command(*arguments: object) -> tuple[int, str]:
    run = CliRunner().invoke(app, [*map(str, arguments)])
    if isinstance(run.exception, bgars.BgarsError):  # as main() turns it into one line
        return EXIT_BAD_INPUT, str(run.exception)
    assert run.exception is None or isinstance(run.exception, SystemExit), run.exception
    return run.exit_code, run.output


def rewrite(place: Path, result: bgars.PartResult) -> None:
    (place / "result.json").write_text(result.to_json(), encoding="utf-8")


def test_grr_writes_a_page_that_says_what_its_json_says(tmp_path: Path) -> None:
    folder = write_study(tmp_path / "study")
    code, text = command("grr", folder, "-o", tmp_path / "out")
    assert code == 0, text
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"grr.html", "grr.json", "readings.csv"}
    values = json.loads((tmp_path / "out" / "grr.json").read_text(encoding="utf-8"))
    page = (tmp_path / "out" / "grr.html").read_text(encoding="utf-8")
    assert (values["format"], values["verdict"], values["repeats"]) == ("bgars-grr", "pass", 3)
    for each in values["characteristics"]:
        grr = next(spread for spread in each["spreads"] if spread["name"] == "GRR")
        assert f"<strong>{grr['sigma']:.3g}</strong>" in page
        if grr["percent_tolerance"] is not None:
            assert f"{grr['percent_tolerance']:.1f} %" in page
    lines = (tmp_path / "out" / "readings.csv").read_text(encoding="utf-8").splitlines()
    assert len(lines) == 1 + 18 * (4 * 6 + 4)
    first = bgars.read_result(folder / "part1" / "place1" / "1").balls[0]
    assert f"part1,place1,1,A1,top_um,{first.top_um:.6f}" in lines


def test_spc_writes_a_page_that_says_what_its_json_says(tmp_path: Path) -> None:
    folder = write_results(tmp_path / "results", 40)
    code, text = command("spc", folder, "-o", tmp_path / "out", "--json")
    values = json.loads(text)
    assert code == {"pass": 0}.get(values["verdict"], 1)
    assert json.loads((tmp_path / "out" / "spc.json").read_text(encoding="utf-8")) == values
    page = (tmp_path / "out" / "spc.html").read_text(encoding="utf-8")
    for each in values["trends"]:
        ppk = each["overall"]["centred"]["value"]
        if ppk is not None:
            assert f"<strong>{ppk:.2f}</strong>" in page
    assert command("spc", folder / "r1", *(folder / f"r{n}" for n in range(2, 11)), "-o", tmp_path / "two")[0] in {0, 1}


def test_pages_need_nothing_from_outside_and_run_nothing(tmp_path: Path) -> None:
    recipe = replace(RECIPE, name=NASTY)
    for number in range(10):
        place = tmp_path / "s" / "<b>part</b>" / f"{number}"
        place.mkdir(parents=True)
        rewrite(place, replace(judged(recipe, run=number), inspected_utc="", version=NASTY, method=NASTY))
    command("grr", tmp_path / "s", "-o", tmp_path / "out")
    command("spc", *(tmp_path / "s" / "<b>part</b>").iterdir(), "-o", tmp_path / "out")
    for name in ("grr.html", "spc.html"):
        page = (tmp_path / "out" / name).read_text(encoding="utf-8")
        assert "<script" not in page
        assert "<b>part" not in page
        assert "&lt;script&gt;" in page
        assert all(
            link.startswith("data:image/svg+xml;base64,") for link in re.findall(r'(?:src|href)="([^"]*)"', page)
        )
        assert "http" not in page


def test_the_same_study_gives_the_same_page(tmp_path: Path) -> None:
    folder = write_study(tmp_path / "study", parts=2, repeats=2)
    for name in ("one", "two"):
        command("grr", folder, "-o", tmp_path / name)
    assert (tmp_path / "one" / "grr.html").read_bytes() == (tmp_path / "two" / "grr.html").read_bytes()


def test_references_give_bias_and_linearity(tmp_path: Path) -> None:
    folder = write_study(tmp_path / "study")
    rows = ["part,ball,characteristic,reference"]
    for part in ("part1", "part2"):
        result = bgars.read_result(folder / part / "place1" / "1")
        rows += [f"{part},{ball.name},top_um,{ball.top_um - 2.0:.3f}" for ball in result.balls]
    (tmp_path / "r.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    code, text = command("grr", folder, "-o", tmp_path / "out", "--references", tmp_path / "r.csv", "--json")
    assert code == 0, text
    top = next(each for each in json.loads(text)["accuracy"] if each["characteristic"] == "top_um")
    assert top["references"] == 12
    assert top["bias"] == pytest.approx(2.0, abs=0.15)
    assert top["bias_p"] < 1e-6
    assert abs(top["slope"]) < 0.1
    assert "height of the top: bias" in (tmp_path / "out" / "grr.html").read_text(encoding="utf-8")


def mixed_recipe(folder: Path) -> None:
    rewrite(folder / "part2" / "place1" / "2", judged(replace(RECIPE, name="another"), part=2))


def other_limits(folder: Path) -> None:
    limits = replace(RECIPE.limits, flat_top_depth_um=7.0)
    rewrite(folder / "part2" / "place1" / "2", judged(replace(RECIPE, limits=limits), part=2))


def other_pitch(folder: Path) -> None:
    rewrite(folder / "part2" / "place1" / "2", replace(judged(part=2), pixel_pitch_um=5.0))


def cut(folder: Path) -> None:
    path = folder / "part2" / "place1" / "2" / "result.json"
    path.write_bytes(path.read_bytes()[:1000])


def one_repeat(folder: Path) -> None:
    for repeat in ("2", "3"):
        shutil.rmtree(folder / "part2" / "place1" / repeat)


def hole(folder: Path) -> None:
    shutil.rmtree(folder / "part2" / "place1" / "2")


def no_placement(folder: Path) -> None:
    (folder / "part2" / "place1").rename(folder / "part2" / "elsewhere")


def deeper(folder: Path) -> None:
    shutil.copytree(folder / "part1" / "place1" / "1", folder / "part9" / "1")


def empty_folder(folder: Path) -> None:
    (folder / "part2" / "place1" / "4").mkdir()


def a_capture(folder: Path) -> None:
    (folder / "part2" / "place1" / "2" / "result.json").rename(folder / "part2" / "place1" / "2" / "capture.toml")


def copied(folder: Path) -> None:
    shutil.copy(folder / "part1" / "place2" / "1" / "result.json", folder / "part1" / "place2" / "3" / "result.json")


GRR: dict[str, tuple[Callable[[Path], object], str, str]] = {
    "mixed recipe": (mixed_recipe, "part2/place1/2", "must have the same recipe as"),
    "other limits": (other_limits, "part2/place1/2", "another layout or other limits"),
    "other pixel pitch": (other_pitch, "part2/place1/2", "must have the same pixel_pitch_um as"),
    "a copy": (copied, "part1/place2/3", "comes from the same files as"),
    "corrupt": (cut, "part2/place1/2/result.json", "is not valid JSON"),
    "one repeat": (one_repeat, "part2/place1", "must hold at least 2 repeats, got 1"),
    "unbalanced": (hole, "part2/place1", "the design is not balanced: must hold 3 repeats like the first, got 2"),
    "not crossed": (no_placement, "part2", "the design is not crossed"),
    "other depth": (deeper, "part9/1", "all runs must be equally deep"),
    "empty run": (empty_folder, "part2/place1/4", "must be a result, a capture, or hold folders of them"),
    "mixed kinds": (a_capture, "part2/place1/2", "is a capture, but"),
}


@pytest.mark.parametrize("name", list(GRR))
def test_grr_refuses_what_is_no_study_by_name_and_leaves_nothing(name: str, tmp_path: Path) -> None:
    spoil, place, words = GRR[name]
    folder = write_study(tmp_path / "study", placements=2)
    spoil(folder)
    code, text = command("grr", folder, "-o", tmp_path / "out")
    assert code == 2, text
    assert text.startswith(str(folder / place) + ": ")
    assert words in text
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["grr", "none"], "none: no such folder"),
        (["grr", "empty"], "empty: must be a result, a capture, or hold folders of them"),
        (["grr", "study/part1/place1/1"], "is a single run"),
        (["grr", "study", "--recipe", "p.toml"], "holds a finished result, which brings its own recipe"),
        (["grr", "study", "--method", "blind"], "--method: goes with captures; study holds finished results"),
        (["grr", "study", "--references", "none.csv"], "none.csv: no such file"),
        (["grr", "study", "--references", "heading.csv"], "heading.csv: line 1: must be part,ball,characteristic"),
        (["grr", "study", "--references", "name.csv"], "name.csv: line 2: characteristic must be one of diameter_um"),
        (
            ["grr", "study", "--references", "number.csv"],
            "number.csv: line 2: reference must be a finite number, got 'x'",
        ),
        (["grr", "study", "--references", "part.csv"], "part must be one of part1, part2, part3, got 'part7'"),
        (["grr", "study", "--references", "ball.csv"], "ball must be a ball of part part1 for top_um, got 'Z9'"),
        (["spc", "none"], "none: no such file or folder"),
        (["spc", "empty"], "empty: holds no result.json, nor do the folders in it"),
        (["spc", "study/part1/place1", "--subgroup", "5"], "results: must be at least 10 (2 subgroups of 5), got 3"),
        (["spc", "study/part1/place1", "study/part1/place1/1"], "is given more than once"),
        (["spc", "study/part1/place1", "--subgroup", "-1"], "subgroup: must be 1 or more parts, got -1"),
        (["spc", "study/part1/place1", "--subgroup", "0"], "subgroup: must be 1 or more parts, got 0"),
        (["spc", "name.csv"], "name.csv: is not valid JSON"),
    ],
)
def test_wrong_use_is_told_by_name_and_leaves_nothing(
    arguments: list[str], words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    write_study(tmp_path / "study", placements=1)
    (tmp_path / "empty").mkdir()
    (tmp_path / "p.toml").write_text("", encoding="utf-8")
    heading = "part,ball,characteristic,reference\n"
    for name, text in {
        "heading": "part;ball\n",
        "name": heading + "part1,A1,top,500\n",
        "number": heading + "part1,A1,top_um,x\n",
        "part": heading + "part7,A1,top_um,500\n",
        "ball": heading + "part1,Z9,top_um,500\n",
    }.items():
        (tmp_path / f"{name}.csv").write_text(text, encoding="utf-8")
    code, text = command(*arguments, "-o", "out")
    assert code == 2, text
    assert words in text
    assert not (tmp_path / "out").exists()


def test_spc_refuses_mixed_and_corrupt_results_by_name(tmp_path: Path) -> None:
    folder = write_results(tmp_path / "r", 10)
    good = (folder / "r7" / "result.json").read_text(encoding="utf-8")
    rewrite(folder / "r7", judged(replace(RECIPE, name="another")))
    code, text = command("spc", folder, "-o", tmp_path / "out")
    assert (code, "must have the same recipe as" in text, "r7/result.json" in text) == (2, True, True), text
    (folder / "r7" / "result.json").write_text(good[:-100], encoding="utf-8")
    code, text = command("spc", folder, "-o", tmp_path / "out")
    assert (code, "is not valid JSON" in text, "r7/result.json" in text) == (2, True, True), text
    assert not (tmp_path / "out").exists()


def test_a_study_of_captures_is_inspected_and_a_bad_capture_fails_it_by_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = bgars.Scene.ball_array(2, 2, seed=1)
    camera = bgars.Camera(pixel_pitch_um=40.0)
    for number in (1, 2):
        capture, truth = bgars.simulate(scene, bgars.LightRig.ring(4), bgars.Material(), camera, seed=number)
        bgars.write_simulation(capture, truth, tmp_path / "s" / str(number))
    seen: list[tuple[str, object]] = []
    failure: bgars.BgarsError = bgars.CalibrationError("light 3 is dark")

    def stand_in(capture: bgars.Capture, recipe: object, **_: object) -> bgars.PartResult:
        seen.append((capture.name, recipe))
        if len(seen) % 4 == 0:
            raise failure
        return judged(run=len(seen))

    monkeypatch.setattr(study_folder, "inspect", stand_in)
    code, text = command("grr", tmp_path / "s", "-o", tmp_path / "out", "--recipe", bgars.sample_part_recipe())
    assert code in {0, 1}, text
    assert [name for name, _ in seen] == ["1", "2"]
    assert all(isinstance(recipe, bgars.PartRecipe) for _, recipe in seen)
    code, text = command("grr", tmp_path / "s", "-o", tmp_path / "second")
    assert (code, text) == (2, f"{tmp_path / 's' / '2'}: light 3 is dark")
    for failure, kind in (  # noqa: B007 - the stand-in raises it
        (bgars.InputError("no pixel pitch"), bgars.InputError),
        (bgars.ConvergenceError("no end", 7, 0.5), bgars.CalibrationError),
    ):
        seen.extend([("", None)] * (3 - len(seen) % 4))
        with pytest.raises(kind, match=re.escape(str(tmp_path / "s" / "1"))):
            bgars.read_study(tmp_path / "s")
    assert not (tmp_path / "second").exists()


def test_results_of_captures_are_kept_and_repeat_the_study_without_images(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = bgars.Scene.ball_array(2, 2, seed=1)
    for number in (1, 2, 3):
        capture, truth = bgars.simulate(
            scene, bgars.LightRig.ring(4), bgars.Material(), bgars.Camera(pixel_pitch_um=40.0), seed=number
        )
        bgars.write_simulation(capture, truth, tmp_path / "s" / "part 7" / str(number))

    def stand_in(
        capture: bgars.Capture, _recipe: object, *, progress: Callable[[str, float], None], **_: object
    ) -> bgars.PartResult:
        for stage in ("find", "measure", "judge"):
            progress(stage, 0.5)
        return judged(run=int(capture.name))

    monkeypatch.setattr(study_folder, "inspect", stand_in)
    told: list[float] = []
    study = bgars.read_study(tmp_path / "s", progress=told.append)
    assert study.inspected
    assert told == sorted(told)
    assert (told[0], told[-1], len(set(told))) == (0.0, 1.0, 3 * 4 + 1), "it moves while a capture is inspected"
    code, text = command("grr", tmp_path / "s", "-o", tmp_path / "out")
    assert "3 runs, inspected" in text
    kept = tmp_path / "out" / "results"
    assert [bgars.read_result(kept / "part 7" / str(number)).to_json() for number in (1, 2, 3)] == [
        run.result.to_json() for run in study.runs
    ]
    monkeypatch.delattr(study_folder, "inspect")
    again, text = command("grr", kept, "-o", tmp_path / "again")
    assert (again, "3 runs, read from finished results" in text) == (code, True), text
    assert not (tmp_path / "again" / "results").exists()
    first, second = (
        json.loads((tmp_path / name / "grr.json").read_text(encoding="utf-8"))["characteristics"]
        for name in ("out", "again")
    )
    for one, two in zip(first, second, strict=True):
        sigmas = [[spread["sigma"] for spread in each["spreads"]] for each in (one, two)]
        assert sigmas[0] == pytest.approx(sigmas[1], abs=1e-5)
    code, text = command("grr", tmp_path / "s", "-o", tmp_path / "out")
    assert (code, text.startswith(f"{kept}: holds the results of an earlier study")) == (2, True), text
