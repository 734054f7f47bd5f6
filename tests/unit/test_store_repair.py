"""Damaged files of a store: named, made again or set aside, without the others."""

from __future__ import annotations

from pathlib import Path

import bgars
import pyarrow
import pytest
from bgars.cli.app import app
from bgars.records.keys import DIGITS
from pyarrow import parquet
from stored_parts import filled_store, part
from typer.testing import CliRunner


def rows(store: bgars.Store) -> list[dict]:
    """Balls, with the digits that result.json has, from which a damaged file is made again."""
    told = store.query("select * exclude (day, recipe, sequence) from balls order by serial, name").to_pylist()
    return [
        {name: round(value, DIGITS) if isinstance(value, float) else value for name, value in row.items()}
        for row in told
    ]


@pytest.mark.parametrize("is_compacted", [False, True])
def test_a_damaged_file_of_balls_is_named_and_made_again(tmp_path: Path, *, is_compacted: bool) -> None:
    store = filled_store(tmp_path / "store", 4)
    if is_compacted:
        store.compact()
    before = rows(store)
    balls, *_ = sorted((store.folder / "balls").rglob("*.parquet"))
    balls.write_bytes(balls.read_bytes()[:200])
    with pytest.raises(bgars.FileFormatError) as caught:
        rows(store)
    assert f"{balls}: is not a readable file of a store" in str(caught.value)
    assert f"'bgars store repair {store.folder}' makes it again or sets it aside" in str(caught.value)
    told = CliRunner().invoke(app, ["store", "repair", str(store.folder)]).output
    assert told == f"{balls}: made again from the results\n"
    assert rows(store) == before
    told = CliRunner().invoke(app, ["store", "repair", str(store.folder)]).output
    assert told == f"{store.folder}: every file is readable\n"


def test_a_damaged_file_of_a_part_is_set_aside_without_the_others(tmp_path: Path) -> None:
    store = filled_store(tmp_path / "store", 4)
    before = rows(store)
    parts, *_ = sorted((store.folder / "parts").rglob("*.parquet"))
    whole = parts.read_bytes()
    parts.write_bytes(whole[:200] + b"x" * 60 + whole[260:])  # both ends are whole: DuckDB does not name the file
    for look in (lambda: store.query("select * from results"), store.compact):
        with pytest.raises(bgars.FileFormatError, match=f"{parts.name}: is not .* 'bgars store repair"):
            look()
    parts.write_bytes(whole[:200])
    with pytest.raises(bgars.FileFormatError, match="'bgars store repair"):
        bgars.open_store(store.folder).known()
    done = store.repair()
    assert [name.split("/")[0] for name in done["set_aside"]] == ["parts", "balls", "checks", "budgets"]
    assert len(list((store.folder / "damaged").rglob("*.parquet.damaged"))) == 4
    assert store.query("select count(*) n from parts")["n"].to_pylist() == [3]
    assert [store.append(part(number)) for number in range(4)].count(True) == 1, "it comes again, the others are there"
    assert rows(store) == before


def test_a_file_that_lacks_a_column_is_named_and_set_aside(tmp_path: Path) -> None:
    store = filled_store(tmp_path / "store", 2)
    foreign, *_ = sorted((store.folder / "parts").rglob("*.parquet"))
    parquet.write_table(pyarrow.table({"part_key": ["x"]}), foreign)
    with pytest.raises(bgars.FileFormatError, match=r"is not a readable file of a store \(has no column serial\)"):
        bgars.open_store(store.folder).known()
    told = CliRunner().invoke(app, ["store", "repair", str(store.folder)]).output
    assert f"moved to {store.folder / 'damaged'}" in told
    assert len(bgars.open_store(store.folder).known()) == 1
