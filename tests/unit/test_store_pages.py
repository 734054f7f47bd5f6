"""Pages of a store, on demand: of a part with its identity, and of a lot with its figures."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import bgars
import pytest
from bgars.cli.app import app
from bgars.line.lot_page import lot_facts
from line_captures import copy_capture
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


def test_the_overview_counts_and_links(tmp_path: Path) -> None:
    store = filled_store(tmp_path / "store", 8)
    facts = lot_facts(store)
    assert (facts["total"], facts["yield_percent"]) == (8, 75.0)
    assert facts["defects"] == [{"defect": "missing", "n": 2}]
    assert {mark["name"] for mark in facts["places"]["marks"] if mark["share"] == 1.0} == {"A1", "B2"}
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
