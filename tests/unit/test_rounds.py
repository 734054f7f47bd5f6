"""Rounds count new images of a part: the same ones, inspected again, replace what was found; lots that disagree."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import bgars
import pytest
from bgars.cli import batch
from bgars.line.batch import Batch, store_outcome
from bgars.line.job import Outcome
from bgars.line.lot_page import write_lot_page
from bgars.store import part_key
from pyarrow import parquet
from stored_parts import part


def recalibrated(result: bgars.PartResult, station: str, day: int) -> bgars.PartResult:
    """The same images, inspected with another station file; each finds another verdict."""
    files = (("a.png", "a" * 64), ("capture.toml", "c" * 64), ("station.toml", station * 64))
    return replace(result, files=files, serial="SN7", inspected_utc=f"2026-03-{day:02d}T00:00:00Z")


def test_the_same_images_with_another_station_are_no_rework(tmp_path: Path) -> None:
    """The yield before and after rework counts parts, not calibrations; the latest result of a round counts."""
    store = bgars.open_store(tmp_path / "store", create=True)
    first, again = recalibrated(part(3), "1", 2), recalibrated(part(4), "2", 1)  # the clock was set back
    assert part_key(first) != part_key(again)
    assert store.append(first)
    assert store.append(again)
    assert store.append(replace(part(4), serial="SN7", inspected_utc="2026-03-09T00:00:00Z")), "after rework"
    assert bgars.open_store(store.folder).numbered(recalibrated(part(3), "3", 3)).identity.round == 1
    for _ in range(2):
        rows = store.query("select round, verdict from parts order by round").to_pylist()
        assert rows == [{"round": 1, "verdict": "pass"}, {"round": 2, "verdict": "pass"}]
        every = store.query("select round, verdict, is_latest from inspections order by sequence").to_pylist()
        assert [tuple(row.values()) for row in every] == [(1, "fail", False), (1, "pass", True), (2, "pass", True)]
        assert store.query("select count(*) n from balls")["n"].to_pylist() == [12]
        assert store.query("select count(*) n from results")["n"].to_pylist() == [3]
        store.compact()


def test_images_of_a_store_without_their_checksum_are_known_from_the_results(tmp_path: Path) -> None:
    store = bgars.open_store(tmp_path / "store", create=True)
    store.append(recalibrated(part(3), "1", 1))
    for path in (store.folder / "parts").rglob("*.parquet"):
        parquet.write_table(parquet.ParquetFile(path).read().drop_columns(["images_sha256"]), path)
    store = bgars.open_store(store.folder)
    assert store.numbered(replace(part(4), serial="SN7")).identity.round == 2
    assert store.append(recalibrated(part(4), "2", 2))
    assert store.query("select round, verdict from parts").to_pylist() == [{"round": 1, "verdict": "pass"}]


def test_a_database_loses_what_was_replaced_and_gets_new_columns(tmp_path: Path) -> None:
    store, url = bgars.open_store(tmp_path / "store", create=True), f"sqlite:///{tmp_path / 'parts.db'}"
    store.append(recalibrated(part(3), "1", 1))
    store.export(url)
    with closing(sqlite3.connect(tmp_path / "parts.db")) as base, base:
        base.execute("alter table bgars_parts drop column images_sha256")
    store.append(recalibrated(part(4), "2", 2))
    assert store.export(url)["bgars_parts"] == 1
    with closing(sqlite3.connect(tmp_path / "parts.db")) as base:
        assert base.execute("select verdict, length(images_sha256) from bgars_parts").fetchall() == [("pass", 64)]
        assert base.execute("select count(*) from bgars_balls").fetchone() == (6,)


def test_a_serial_number_in_two_lots_is_spoken_of(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Serial numbers are unique among parts of a recipe; the second of two parts would count as its rework."""
    store, notes = bgars.open_store(tmp_path / "store", create=True), []
    for number, lot in ((0, "A"), (1, "A"), (2, "B"), (4, "B")):
        result = replace(part(number), serial="S1", identity=replace(part(number).identity, lot=lot))
        store_outcome(Outcome("f", "S1", result), store, say=notes.append)
    (note,) = notes
    assert note.startswith("S1: was in lot A, is in lot B now, and counts as round 3 of one part; if these are two")
    batch._tell(Batch(4, notes=notes), store.folder)
    assert f"note: {note}\n" in capsys.readouterr().out
    write_lot_page(store, tmp_path / "lot.html", lot="A")
    assert "S1 (A, B)" in (tmp_path / "lot.html").read_text(encoding="utf-8")
