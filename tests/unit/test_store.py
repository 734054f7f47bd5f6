"""The store: whole or not at all, from several processes, once each, and readable by its own version only."""

from __future__ import annotations

import errno
import json
import os
import shutil
import sqlite3
import subprocess
import sys
import time
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import bgars
import pytest
from bgars.store import append, part_key
from bgars.store import export as export_module
from bgars.store.schema import OLD_NAMES, TABLES, arrow_schema
from pyarrow import parquet
from stored_parts import filled_store, part

HERE = Path(__file__).parent
COUNTS = "select (select count(*) from parts) p, (select count(*) from balls) b, (select count(*) from checks) c"


def counts(store: bgars.Store) -> tuple[int, ...]:
    return tuple(store.query(COUNTS).to_pylist()[0].values())


def test_a_part_is_kept_with_all_of_it_and_once(tmp_path: Path) -> None:
    store = filled_store(tmp_path / "store", 2)
    assert not store.append(part(0)), "the same inputs"
    assert not bgars.open_store(tmp_path / "store").append(replace(part(0), inspected_utc="2027-05-05T00:00:00Z"))
    assert store.append(replace(part(0), serial="other")), "the same images under another serial are another part"
    assert counts(store) == (3, 18, 12)
    kept = store.query("select result_json from results where serial = 'SN0001'")["result_json"][0].as_py()
    assert kept == store.numbered(part(1)).to_json()
    assert json.loads(kept)["identity"]["round"] == 1
    row = store.query("select * from parts where serial = 'SN0001'").to_pylist()[0]
    assert (row["lot"], row["station"], row["day"].isoformat(), row["seconds"]) == ("L1", "S1", "2026-01-01", 1.5)
    top = store.query("select top_um, u_top_um from balls where serial = 'SN0001' and name = 'B3'").to_pylist()[0]
    ball = next(each for each in part(1).balls if each.name == "B3")
    assert top == {"top_um": ball.top_um, "u_top_um": ball.u_top_um}


def test_files_say_units_and_lie_by_day_and_recipe(tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    filled_store(tmp_path / "store", 1)
    file = next((tmp_path / "store" / "balls").rglob("*.parquet"))
    assert file.parent.relative_to(tmp_path / "store") == Path("balls/day=2026-01-01/recipe=two%20by%20three")
    schema = parquet.ParquetFile(file).schema_arrow
    assert schema.field("top_um").metadata[b"unit"] == b"um"
    assert schema.metadata[b"format_version"] == b"2"
    for table in TABLES:
        for field in arrow_schema(table):
            assert len(field.metadata[b"description"]) > 2


def test_rounds_count_the_inspections_of_a_serial(tmp_path: Path) -> None:
    store = filled_store(tmp_path / "store", 2)
    again = replace(part(0), files=(("a.png", "f" * 64),), inspected_utc="2026-02-01T00:00:00Z")
    assert store.append(again)
    got = store.query("select serial, round from parts order by serial, round").to_pylist()
    assert [(row["serial"], row["round"]) for row in got] == [("SN0000", 1), ("SN0000", 2), ("SN0001", 1)]


def test_the_order_of_parts_does_not_follow_a_clock_that_is_set_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = filled_store(tmp_path / "store", 1)
    monkeypatch.setattr(time, "time_ns", lambda: 5)
    for number in (1, 2):
        bgars.open_store(tmp_path / "store").append(part(number))
    serials = store.query("select serial from parts order by sequence")["serial"].to_pylist()
    assert serials == ["SN0000", "SN0001", "SN0002"]


def test_failures_are_kept_in_one_line_until_a_success(tmp_path: Path) -> None:
    store = filled_store(tmp_path / "store", 1)
    store.append_failure("/c/SN0001", "two\nlines", serial="SN0001")
    store.append_failure("/c/SN0001", "two\nlines", serial="SN0001")
    assert store.query("select reason from failures")["reason"].to_pylist() == ["two lines"]
    store.append(part(1), capture_folder="/c/SN0001")
    assert store.query("select * from failures").num_rows == 0


def test_a_success_under_another_recipe_hides_no_failure(tmp_path: Path) -> None:
    store = bgars.open_store(tmp_path / "store", create=True)
    for recipe in ("top", part(1).name):
        store.append_failure("/c/SN0001", f"under {recipe}", serial="SN0001", recipe=recipe)
    store.append(part(1), capture_folder="/c/SN0001")
    assert store.query("select reason from failures")["reason"].to_pylist() == ["under top"]


def test_compaction_keeps_every_row_and_makes_few_files(tmp_path: Path) -> None:
    store = filled_store(tmp_path / "store", 8)
    before = store.query("select * exclude (day, recipe) from balls order by serial, name")
    joined = store.compact()
    assert joined == {"files_before": 32, "files_after": 8}
    assert store.query("select * exclude (day, recipe) from balls order by serial, name").equals(before)
    assert store.compact()["files_after"] == 8
    assert not bgars.open_store(store.folder).append(part(3)), "known, though its file is gone"


def test_both_copies_of_a_compaction_that_was_killed_count_once(tmp_path: Path) -> None:
    store = filled_store(tmp_path / "store", 4)
    pieces = shutil.copytree(store.folder, tmp_path / "pieces")
    store.compact()
    shutil.copytree(pieces, store.folder, dirs_exist_ok=True)
    assert counts(store) == (4, 24, 16)
    store.compact()
    assert counts(store) == (4, 24, 16)
    assert len(list((store.folder / "parts").rglob("*.parquet"))) == 1


def test_rows_whose_part_never_came_do_not_count(tmp_path: Path) -> None:
    store = filled_store(tmp_path / "store", 2)
    next((store.folder / "parts").rglob("*.parquet")).unlink()
    assert counts(store) == (1, 6, 4)
    old = time.time() - 2 * 86_400
    orphans = list(store.folder.rglob("*.parquet"))
    partial = store.folder / "balls" / ".p-x.1.ab.partial"
    partial.write_bytes(b"half")
    for path in [*orphans, partial]:
        os.utime(path, (old, old))
    store.compact()
    assert not partial.exists()
    assert len(list((store.folder / "balls").rglob("*.parquet"))) == 1


def test_a_full_disk_leaves_nothing_and_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = filled_store(tmp_path / "store", 1)

    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(append.os, "fsync", full)
        with pytest.raises(bgars.FileFormatError, match=r"cannot be written \(No space left on device\)"):
            store.append(part(1))
    assert not list(store.folder.rglob("*.partial"))
    assert counts(store) == (1, 6, 4)
    assert store.append(part(1)), "and is taken when there is room again"


def test_processes_append_and_compact_at_once_and_kill_each_other(tmp_path: Path) -> None:
    """Three writers of the same eight parts, two of them killed, and compactions between: each part once."""
    folder = tmp_path / "store"
    bgars.open_store(folder, create=True)
    code = (
        f"import sys; sys.path.insert(0, {str(HERE)!r})\n"
        "from stored_parts import part\nimport bgars, pathlib\n"
        f"store = bgars.open_store({str(folder)!r})\n"
        "print('ready', flush=True)\n"
        "for n in range(int(sys.argv[1]), int(sys.argv[1]) + 8):\n"
        "    store.append(part(n % 8))\n"
        "    if n % 3 == 0: store.compact()\n"
    )
    writers = [
        subprocess.Popen([sys.executable, "-c", code, str(start)], stdout=subprocess.PIPE) for start in (0, 3, 5)
    ]
    for writer in writers:
        assert writer.stdout is not None
        writer.stdout.readline()
    time.sleep(0.15)
    for writer in writers[1:]:
        writer.kill()
    for writer in writers:
        writer.communicate(timeout=120)
    assert writers[0].returncode == 0
    store = bgars.open_store(folder)
    assert counts(store) == (8, 48, 32)
    store.compact()
    assert counts(store) == (8, 48, 32)


def test_a_newer_store_is_refused_in_one_line(tmp_path: Path) -> None:
    store = filled_store(tmp_path / "store", 1)
    mark = store.folder / "store.json"
    mark.write_text(json.dumps(json.loads(mark.read_text()) | {"format_version": 3}))
    with pytest.raises(bgars.FileFormatError, match="reads stores up to 2, got 3: written by a newer bgars"):
        bgars.open_store(store.folder)
    with pytest.raises(bgars.FileFormatError, match="is not a store of bgars"):
        bgars.open_store(tmp_path)
    (tmp_path / "else").mkdir()
    (tmp_path / "else" / "file").touch()
    with pytest.raises(bgars.InputError, match="it holds other files"):
        bgars.open_store(tmp_path / "else", create=True)
    mark.write_text("{")
    with pytest.raises(bgars.FileFormatError, match="cannot be read"):
        bgars.open_store(store.folder)


def as_version_1(folder: Path) -> Path:
    """Give a store the columns, and the mark, that version 1 wrote."""
    for path in (folder / "balls").rglob("*.parquet"):
        table = parquet.read_table(path, partitioning=None)
        was = {new: old for old, new in OLD_NAMES["balls"].items()}
        parquet.write_table(table.rename_columns([was.get(name, name) for name in table.column_names]), path)
    mark = folder / "store.json"
    mark.write_text(json.dumps(json.loads(mark.read_text()) | {"format_version": 1}))
    return folder


def test_a_store_of_version_1_is_read_and_appended_to(tmp_path: Path) -> None:
    folder = as_version_1(filled_store(tmp_path / "store", 2).folder)
    asked = "select serial, name, aspect_ratio, u_aspect_ratio, flat_top_depth_um from balls order by all"
    assert bgars.open_store(folder).query("select * from balls").column_names.count("q") == 0
    assert bgars.open_store(folder).append(part(2))
    expected = filled_store(tmp_path / "new", 3).query(asked)
    assert bgars.open_store(folder).query(asked) == expected
    assert json.loads((folder / "store.json").read_text())["format_version"] == 2
    bgars.open_store(folder).compact()
    assert bgars.open_store(folder).query(asked) == expected


def test_a_database_of_version_1_goes_on(tmp_path: Path) -> None:
    store, url = filled_store(tmp_path / "store", 1), f"sqlite:///{tmp_path / 'parts.db'}"
    store.export(url)
    with closing(sqlite3.connect(tmp_path / "parts.db")) as base, base:
        for old, new in OLD_NAMES["balls"].items():
            base.execute(f"alter table bgars_balls rename column {new} to {old}")
    store.append(part(1))
    assert store.export(url)["bgars_parts"] == 1
    with closing(sqlite3.connect(tmp_path / "parts.db")) as base:
        (count,) = base.execute("select count(aspect_ratio) from bgars_balls").fetchone()
    assert count == len(part(0).balls) + len(part(1).balls)


def test_a_store_is_made_where_making_one_was_killed(tmp_path: Path) -> None:
    folder = tmp_path / "store"
    folder.mkdir()
    (folder / ".store.7.ab.partial").write_bytes(b"{")
    assert bgars.open_store(folder, create=True).append(part(0))


def test_a_result_needs_its_time(tmp_path: Path) -> None:
    store = bgars.open_store(tmp_path / "store", create=True)
    with pytest.raises(bgars.InputError, match="needs the time of inspection"):
        store.append(replace(part(0), inspected_utc=""))
    with pytest.raises(bgars.InputError, match=r"result: S.udc80N: holds characters that are no text"):
        store.append(replace(part(0), serial="S\udc80N"))
    assert len(store.query("select * from parts")) == 0
    assert part_key(part(0)) != part_key(part(1))


def test_sqlite_gets_every_new_part_once(tmp_path: Path) -> None:
    store = filled_store(tmp_path / "store", 3)
    url = f"sqlite:///{tmp_path / 'parts.db'}"
    assert store.export(url)["bgars_balls"] == 18
    store.append(part(3))
    assert store.export(url)["bgars_parts"] == 1
    with sqlite3.connect(tmp_path / "parts.db") as connection:
        assert connection.execute("select count(*) from bgars_balls").fetchone() == (24,)
        row = connection.execute("select verdict, defects, day from bgars_parts where serial = 'SN0003'").fetchone()
    connection.close()
    assert row == ("fail", "missing", "2026-01-01")


@pytest.mark.parametrize(
    ("url", "words"),
    [
        ("nonsense", "url: must be as SQLAlchemy takes it"),
        ("postgresql+psycopg://ada:p@SEC:RET@host/x", r"@ is written %40"),
        ("postgresql+psycopg://ada:SECRET@x@host/x", r"@ is written %40"),
        ("postgresql+psycopg://ada:SECRET@host:port/x", "url: must be as"),
        ("none://ada:SECRET@host/x?password=SECRET", r"none://ada@host/x: is not a database that can be reached"),
    ],
)
def test_an_address_of_a_database_is_checked_and_its_password_never_told(tmp_path: Path, url: str, words: str) -> None:
    with pytest.raises(bgars.InputError, match=words) as refused:
        filled_store(tmp_path / "store", 1).export(url)
    assert not any(piece in str(refused.value) for piece in ("SEC", "RET"))


def test_an_export_of_many_parts_looks_into_the_store_no_more_often(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store, looks = filled_store(tmp_path / "store", 7), []
    asked = export_module.query
    monkeypatch.setattr(export_module, "query", lambda *given: looks.append(given) or asked(*given))
    tables = {}
    for block in (2, 100):
        monkeypatch.setattr(export_module, "BLOCK_PARTS", block)
        looks.clear()
        assert store.export(f"sqlite:///{tmp_path / f'{block}.db'}")["bgars_parts"] == 7
        with closing(sqlite3.connect(tmp_path / f"{block}.db")) as base:
            tables[block] = len(looks), base.execute("select * from bgars_balls order by part_key, name").fetchall()
    assert tables[2] == tables[100]
    assert len(tables[2][1]) == 42


def test_an_export_leaves_the_failures_of_another_store(tmp_path: Path) -> None:
    url, stores = f"sqlite:///{tmp_path / 'parts.db'}", []
    for name in "AB":
        stores.append(bgars.open_store(tmp_path / name, create=True))
        stores[-1].append_failure(f"/{name}/SN0001", f"of {name}", serial="SN0001")
        stores[-1].export(url)
    with closing(sqlite3.connect(tmp_path / "parts.db")) as base:
        told = "select reason from bgars_failures order by reason"
        assert base.execute(told).fetchall() == [("of A",), ("of B",)]
        stores[0].append(part(1))
        stores[0].export(url)
        assert base.execute(told).fetchall() == [("of B",)]


def test_a_database_that_cannot_be_reached_gets_one_line_without_its_password(tmp_path: Path) -> None:
    store = filled_store(tmp_path / "store", 1)
    with pytest.raises(bgars.InputError, match="nodb://: is not a database"):
        store.export("nodb://")
    with pytest.raises(bgars.BgarsError) as caught:
        store.export("postgresql+psycopg://ada:secret@127.0.0.1:1/none")
    assert "secret" not in str(caught.value)
    assert "\n" not in str(caught.value)
