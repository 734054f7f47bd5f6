"""One image with many parts: each its own result, name and place, one after the other or from a store."""

from __future__ import annotations

import csv
import json
import re
from dataclasses import replace
from pathlib import Path

import bgars
import numpy as np
import pytest
from bgars.cli.app import app
from bgars.line.inbox import Inbox
from bgars.line.lot_page import write_lot_page
from bgars.line.pages import write_part_page
from bgars.line.strip_page import strip_cells, strip_csv
from bgars.line.watch import Watch
from bgars.pipelines.strip import inspect_place, part_of_strip, places_of_strip
from bgars.records.strip_layout import StripLayout
from strip_captures import PITCH_UM, SHAPE, STRIP, strip_capture, write_recipe, write_strip
from typer.testing import CliRunner

PLACES = ["R1C1", "R1C2", "R1C3", "R2C1", "R2C2", "R2C3"]


def test_a_part_of_a_strip_shows_its_own_balls_only(tmp_path: Path) -> None:
    capture = strip_capture()
    place = STRIP.place("R1C3")
    alone = part_of_strip(capture, STRIP, place)
    rows, cols = np.nonzero(alone.mask)
    x_um = (cols.mean() - (SHAPE[1] - 1) / 2) * PITCH_UM
    y_um = ((SHAPE[0] - 1) / 2 - rows.mean()) * PITCH_UM
    assert (x_um, y_um) == pytest.approx((place.x_um, place.y_um), abs=PITCH_UM)
    covered = sum(part_of_strip(capture, STRIP, each).mask.astype(int) for each in STRIP.places())
    assert covered.max() == 1
    recipe = bgars.read_part_recipe(write_recipe(tmp_path))
    assert [each.name for each in places_of_strip(capture, recipe)] == PLACES


def test_each_part_has_its_result_in_the_store(tmp_path: Path) -> None:
    recipe = write_recipe(tmp_path, 'empty = ["R1C2"]\n')
    folder = write_strip(tmp_path / "in" / "STRIP7")
    done = bgars.inspect_many([folder], recipe, store=tmp_path / "store", processes=1)
    assert (done.total, done.inspected, done.failures) == (1, 5, [])
    store = bgars.open_store(tmp_path / "store")
    rows = store.query("select serial, substrate, position, verdict, reason from parts order by serial").to_pylist()
    assert [row["serial"] for row in rows] == [f"STRIP7-{place}" for place in PLACES if place != "R1C2"]
    assert {row["substrate"] for row in rows} == {"STRIP7"}
    assert [row["position"] for row in rows if row["verdict"] == "fail"] == ["R2C3"]
    assert "B1" in rows[-1]["reason"]
    middles = store.query(
        "select position, avg(x_um) x, avg(top_um) z from balls join parts using (part_key) group by 1"
    )
    for row in middles.to_pylist():
        assert row["z"] == pytest.approx(500.0, abs=15.0)
        if row["position"] != "R2C3":
            assert row["x"] == pytest.approx(STRIP.place(row["position"]).x_um, abs=5.0)
    again = bgars.inspect_many([folder], recipe, store=tmp_path / "store", processes=1)
    assert (again.inspected, again.known) == (0, 5)
    source, _ = write_part_page(store, "STRIP7-R2C3")
    assert source.photograph is not None
    assert source.photograph.left_um > 0, "its own window only"
    write_lot_page(store, tmp_path / "lot.html")
    text = (tmp_path / "lot.html").read_text(encoding="utf-8")
    assert "Where parts fail on the strip" in text
    assert re.search(r"R1C2<small class=\"none\">no part", text)


def test_one_part_that_cannot_be_inspected_does_not_stop_the_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recipe = write_recipe(tmp_path, 'empty = ["R1C2", "R1C3", "R2C1", "R2C2"]\n')
    folder = write_strip(tmp_path / "STRIP7")
    from bgars.line import job  # noqa: PLC0415 - to meddle

    real = job.inspect_place

    def meddling(capture: bgars.Capture, part: bgars.PartRecipe, place: str, **options: object) -> bgars.PartResult:
        if place == "R1C1":
            msg = "too dark"
            raise bgars.InputError(msg)
        return real(capture, part, place, **options)

    monkeypatch.setattr(job, "inspect_place", meddling)
    done = bgars.inspect_many([folder], recipe, store=tmp_path / "store", processes=1)
    assert (done.inspected, done.failures) == (1, [(str(folder), "too dark")])
    store = bgars.open_store(tmp_path / "store")
    assert store.query("select serial from failures")["serial"].to_pylist() == ["STRIP7-R1C1"]
    monkeypatch.undo()
    again = bgars.inspect_many([folder], recipe, store=tmp_path / "store", processes=1)
    assert (again.inspected, again.known) == (1, 1)
    store.refresh()
    assert store.query("select serial from failures").num_rows == 0


def test_inspect_writes_a_folder_a_part_and_an_overview(tmp_path: Path) -> None:
    recipe = write_recipe(tmp_path, 'empty = ["R1C1", "R1C2", "R1C3", "R2C1"]\n')
    folder, out = write_strip(tmp_path / "STRIP7"), tmp_path / "out"
    command = ["inspect", str(folder), "-r", str(recipe), "-o", str(out), "--no-pictures", "--serial", "S7", "--json"]
    run = CliRunner().invoke(app, command)
    assert run.exit_code == 1, run.output
    assert [part["verdict"] for part in json.loads(run.stdout)["parts"]][1] == "fail"
    assert sorted(path.name for path in out.iterdir()) == ["R2C2", "R2C3", "parts.csv", "strip.html"]
    result = bgars.read_result(out / "R2C3")
    assert (result.serial, result.identity.substrate, result.identity.position) == ("S7-R2C3", "S7", "R2C3")
    assert result.recipe is not None
    assert result.recipe.strip is not None
    assert result.recipe.strip.empty == ("R1C1", "R1C2", "R1C3", "R2C1")
    page = (out / "strip.html").read_text(encoding="utf-8")
    assert 'href="R2C3/report.html"' in page
    rows = list(csv.DictReader((out / "parts.csv").read_text(encoding="utf-8").splitlines()))
    assert [row["place"] for row in rows] == ["R2C2", "R2C3"]
    # The same folder for a capture that cannot be measured: no verdict of the strip is left.
    (folder / "light_3.png").unlink()
    run = CliRunner().invoke(app, [*command[:-1]])
    assert isinstance(run.exception, bgars.InputError)
    assert not list(out.rglob("result.json"))
    assert not (out / "strip.html").exists()


def test_a_file_of_somebody_else_in_the_folder_of_a_place_is_never_touched(tmp_path: Path) -> None:
    recipe, folder, out = write_recipe(tmp_path), write_strip(tmp_path / "STRIP7"), tmp_path / "out"
    (out / "R1C1").mkdir(parents=True)
    (out / "R1C1" / "part.png").write_bytes(b"a holiday")
    run = CliRunner().invoke(app, ["inspect", str(folder), "-r", str(recipe), "-o", str(out)])
    assert "R1C1: holds part.png, which bgars did not write" in str(run.exception)
    assert [path.name for path in out.rglob("*")] == ["R1C1", "part.png"]


def test_the_command_for_one_part_refuses_a_strip(tmp_path: Path) -> None:
    with pytest.raises(bgars.InputError, match="inspect_place"):
        bgars.inspect(strip_capture(), write_recipe(tmp_path))


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ("rowz = 2", "rowz"),
        ('empty = ["R3C1"]', "strip.empty: must be places of the strip, R1C1 to R2C3, got 'R3C1'"),
        ("window_um = [5000.0, 3000.0]", "strip.window_um: must be above 0 and at most pitch_x_um"),
        ("window_um = [5000.0]", "window_um: must be two numbers"),
        ("offset_um = [nan, 0.0]", "offset_um"),
    ],
)
def test_a_wrong_strip_is_refused_in_one_line(tmp_path: Path, more: str, words: str) -> None:
    with pytest.raises(bgars.InputError) as error:
        bgars.read_part_recipe(write_recipe(tmp_path, f"{more}\n"))
    assert words in str(error.value)
    assert "part.toml" in str(error.value)
    assert "\n" not in str(error.value)


def test_places_outside_the_image_and_windows_below_the_part_are_refused(tmp_path: Path) -> None:
    capture = strip_capture()
    recipe = bgars.read_part_recipe(write_recipe(tmp_path, "offset_um = [4000.0, 0.0]\n"))
    with pytest.raises(bgars.InputError, match=r"place R1C3 must lie in the image of 12720 x 8160 um"):
        places_of_strip(capture, recipe)
    recipe = bgars.read_part_recipe(write_recipe(tmp_path, "window_um = [2500.0, 3000.0]\n"))
    with pytest.raises(bgars.InputError, match="need a width of 2600 um, its window has 2500 um"):
        places_of_strip(capture, recipe)
    with pytest.raises(bgars.InputError, match="has no part at 'R9C9'"):
        STRIP.place("R9C9")
    for wrong in ({"rows": 0}, {"pitch_x_um": 0.0}, {"rows": 100, "cols": 100}):
        with pytest.raises(bgars.InputError, match="strip"):
            StripLayout(**({"rows": 1, "cols": 1, "pitch_x_um": 1.0, "pitch_y_um": 1.0} | wrong))


def test_the_overview_keeps_the_form_of_the_strip() -> None:
    cells = strip_cells({"R2C1": {"style": "pass", "words": "pass", "link": ""}}, 2, 2)
    assert [[cell["name"] for cell in row] for row in cells] == [["R1C1", "R1C2"], ["R2C1", "R2C2"]]
    assert strip_csv("=1+1", []).startswith("strip,place,serial")


def test_a_watch_takes_every_part_of_a_strip(tmp_path: Path) -> None:
    recipe = write_recipe(tmp_path, 'empty = ["R1C1", "R1C2", "R1C3", "R2C1"]\n')
    inbox = tmp_path / "inbox"
    write_strip(inbox / "STRIP8")
    (inbox / "STRIP8" / "ready").touch()
    told: list[str] = []
    store = bgars.open_store(tmp_path / "store", create=True)
    watching = Watch(
        Inbox(inbox, count=None, trigger="ready", settle_s=0.0),
        store,
        recipe,
        None,
        inbox / "_done",
        inbox / "_failed",
        say=told.append,
    )
    assert watching.step()
    assert [path.name for path in inbox.glob("_done/*/*")] == ["STRIP8"]
    rows = store.query("select serial, capture_folder from parts order by serial").to_pylist()
    assert [row["serial"] for row in rows] == ["STRIP8-R2C2", "STRIP8-R2C3"]
    assert all(Path(row["capture_folder"]).is_dir() for row in rows)
    assert ["STRIP8-R2C2" in told[0], "STRIP8-R2C3" in told[1], len(told)] == [True, True, 2]


def test_a_part_may_lie_off_its_place_by_less_than_half_the_margin(tmp_path: Path) -> None:
    recipe = bgars.read_part_recipe(write_recipe(tmp_path))
    for offset_um, is_whole in ((700.0, True), (1500.0, False)):
        moved = replace(recipe, strip=replace(STRIP, offset_um=(offset_um, 0.0), empty=("R1C3", "R2C3")))
        result = inspect_place(strip_capture(), moved, "R1C2")
        assert (result.verdict == "pass") == is_whole, "a part that is cut off is never good"
