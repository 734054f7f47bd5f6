"""Pages of a store, on demand: of a part with its identity, and of a lot with its figures."""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import replace
from pathlib import Path

import bgars
import pytest
from bgars.cli.app import app
from bgars.line import lot_page
from bgars.line.lot_page import lot_facts
from bgars.line.pages import page_name
from bgars.store.append import append_rows
from line_captures import copy_capture
from pyarrow import parquet
from stored_parts import filled_store, part
from typer.testing import CliRunner


def run(*arguments: object) -> dict:
    done = CliRunner().invoke(app, ["report", *map(str, arguments), "--json"])
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    return json.loads(done.output)


def test_a_part_gets_its_page_with_photograph_and_identity(tmp_path: Path) -> None:
    folder = copy_capture(tmp_path / "L7" / "SN1")
    bgars.inspect_many([folder], store=tmp_path / "store", processes=1, naming=bgars.Naming("{lot}/{serial}"))
    told = run(tmp_path / "store", "SN1")
    assert told["warnings"] == []
    page = Path(told["output"])
    text = page.read_text(encoding="utf-8")
    assert page == tmp_path / "store" / "pages" / "SN1.html"
    heading = text[text.index("<header") : text.index("</header>")]
    for words in ("SN1", "L7", "serial number", "images written", "inspected"):
        assert words in heading
    assert "data:image/jpeg" in text
    assert (page.parent / "plotly.min.js").stat().st_size > 1_000_000
    assert len(text) < 1_500_000, "plotly.js is beside it, not in it"
    (folder / "light_00.png").write_bytes((folder / "light_01.png").read_bytes())
    assert "holds other images now" in run(tmp_path / "store", "SN1")["warnings"][0]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("SN0001 --lot L0", "--lot: is for the overview, without SERIAL"),
        ("SN0001 --pages", "--pages: is for the overview, without SERIAL"),
        ("--round 1", "--round: needs SERIAL"),
        ("--recipe-name x", "--recipe-name: needs SERIAL"),
    ],
)
def test_an_option_that_would_be_ignored_is_refused(words: str, told: str, tmp_path: Path) -> None:
    store = filled_store(tmp_path / "store", 2)
    with pytest.raises(bgars.InputError, match=told):
        run(store.folder, *words.split())
    assert not (store.folder / "pages").exists()


def test_the_overview_counts_and_links(tmp_path: Path) -> None:
    store = filled_store(tmp_path / "store", 8)
    facts = lot_facts(store)
    assert (facts["total"], facts["yield_percent"]) == (8, 75.0)
    assert facts["defects"] == [{"defect": "missing", "n": 2}]
    assert {mark["name"] for mark in facts["recipes"][0]["places"]["marks"] if mark["share"] == 1.0} == {"A1", "B2"}
    assert lot_facts(store, "L0")["yield_percent"] == 100.0
    told = run(store.folder, "--lot", "L1", "--pages")
    text = Path(told["output"]).read_text(encoding="utf-8")
    links = re.findall(r'href="(SN\d+\.html)"', text)
    assert links == ["SN0005.html", "SN0003.html", "SN0007.html", "SN0005.html", "SN0003.html", "SN0001.html"], (
        "those that do not pass, then the last ones"
    )
    assert all((store.folder / "pages" / link).is_file() for link in links)
    assert "50.0 % pass" in text


def test_a_part_that_was_reworked_counts_once_as_it_was_found_last(tmp_path: Path) -> None:
    store = filled_store(tmp_path / "store", 4)
    good = part(2)
    assert store.append(replace(good, serial="SN0003", inspected_utc="2026-01-09T10:00:00Z"))
    facts = lot_facts(store)
    assert (facts["total"], facts["yield_percent"], facts["not_passed"]) == (4, 100.0, [])
    assert [(row["round"], row["n"], row["percent"]) for row in facts["rework"]] == [(1, 4, 75.0), (2, 1, 100.0)]
    text = Path(run(store.folder)["output"]).read_text(encoding="utf-8")
    assert "first: 75.0 % of 4 pass; round 2: 100.0 % of 1 pass" in text


def test_texts_of_a_part_cannot_write_into_the_page(tmp_path: Path) -> None:
    store = filled_store(tmp_path / "store", 1)
    store.append_failure("/x/<script>alert(1)</script>", "<b>bad</b>")
    text = Path(run(store.folder)["output"]).read_text(encoding="utf-8")
    assert "<script>" not in text
    assert "&lt;b&gt;bad" in text


def test_what_is_not_there_gets_one_line(tmp_path: Path) -> None:
    store = filled_store(tmp_path / "store", 1)
    with pytest.raises(bgars.InputError, match="has no part with the serial number 'nix'"):
        run(store.folder, "nix")
    with pytest.raises(bgars.InputError, match="has no part with the serial number 'SN0000', round 2"):
        run(store.folder, "SN0000", "--round", "2")
    with pytest.raises(bgars.InputError, match="has no parts of lot 'L9'"):
        run(store.folder, "--lot", "L9")
    with pytest.raises(bgars.InputError, match="is not a store"):
        run(tmp_path, "SN0000")


def under(recipe: str, result: bgars.PartResult) -> bgars.PartResult:
    """The result under a recipe of another name, of other images."""
    files = (("a.png", hashlib.sha256(f"{recipe} {result.serial}".encode()).hexdigest()),)
    return replace(result, name=recipe, recipe=replace(result.recipe, name=recipe), files=files)


def test_two_sides_of_a_part_have_a_page_each(tmp_path: Path) -> None:
    store = bgars.open_store(tmp_path / "store", create=True)
    assert store.append(under("bottom", replace(part(3), serial="SN1")))
    assert store.append(under("top", replace(part(2), serial="SN1")))
    with pytest.raises(bgars.InputError, match="'SN1' under 2 recipes: give --recipe-name, one of 'bottom', 'top'"):
        run(store.folder, "SN1")
    page = Path(run(store.folder, "SN1", "--recipe-name", "bottom")["output"])
    assert page.name == page_name("SN1", recipe="bottom") != page_name("SN1", recipe="top")
    with pytest.raises(bgars.InputError, match="'SN1', recipe 'left'"):
        run(store.folder, "SN1", "--recipe-name", "left")
    text = Path(run(store.folder, "--pages")["output"]).read_text(encoding="utf-8")
    failed, *_ = re.findall(r'href="(SN1[^"]*)"', text)
    assert failed == page.name
    assert "missing: B2" in (page.parent / failed).read_text(encoding="utf-8")
    assert ">Drift, recipe bottom<" in text
    assert ">Drift, recipe top<" in text
    assert [block["places"]["most"] for block in lot_facts(store)["recipes"]] == [1, 0], "no map of both"


def test_an_earlier_round_does_not_link_to_the_page_of_a_later_one(tmp_path: Path) -> None:
    store = filled_store(tmp_path / "store", 4)
    store.append(replace(part(2), serial="SN0003", inspected_utc="2026-01-09T10:00:00Z"))
    rows = {(row["round"], row["page_name"]) for row in lot_facts(store)["last"] if row["serial"] == "SN0003"}
    assert rows == {(1, "SN0003.round1.html"), (2, "SN0003.html")}


def test_figures_of_the_overview_are_not_rounded_up_or_cut_off(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = filled_store(tmp_path / "store", 8)
    assert lot_facts(store, "L1")["yield_percent"] == 50.0
    monkeypatch.setattr(lot_page, "LAST_PARTS", 2)
    for number in range(3):
        store.append_failure(f"/captures/{number}", "is cut off")
    text = Path(run(store.folder)["output"]).read_text(encoding="utf-8")
    assert "; 3 captures could not be inspected" in text
    assert text.count("The last 2 of 3.") == 1


def test_a_yield_below_all_is_not_a_hundred_percent(tmp_path: Path) -> None:
    """Of 2,000 parts one fails: 99.95 %."""
    store = filled_store(tmp_path / "store", 4)
    rows = parquet.read_table(next((store.folder / "parts").rglob("*.parquet"))).to_pylist()
    good = [dict(rows[0], part_key=f"{n:064x}", serial=f"P{n}", verdict="pass", sequence=n) for n in range(1996)]
    append_rows(store.folder, Path("day=2026-01-09/recipe=3%20x%203"), "p-many", {"parts": good})
    facts = lot_facts(store)
    assert (facts["total"], facts["verdicts"]["fail"], facts["yield_percent"]) == (2000, 1, 99.9)
    assert facts["rework"][0]["percent"] == 99.9


def test_a_reason_names_two_balls_in_a_table() -> None:
    assert lot_page.shortened("3 balls missing: A1, A2, A3; look") == "3 balls missing: A1, A2, A3; look"
    assert lot_page.shortened("3 balls outside limits: A1 (x); A2 (y); A3 (z)").endswith(": A1 (x); A2 (y) and 1 more")
