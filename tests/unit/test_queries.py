"""Every question of docs/queries.md is answered, and bgars query prints the answer."""

from __future__ import annotations

import csv
import io
import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import bgars
import pytest
from bgars.cli.app import app
from stored_parts import filled_store, part
from typer.testing import CliRunner

PAGE = Path(__file__).parents[2] / "docs" / "queries.md"
QUESTIONS = re.findall(r"```sql\n(.*?)```", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL)


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> bgars.Store:
    made = filled_store(tmp_path_factory.mktemp("queries") / "store")
    made.append_failure("/captures/broken", "light_03.png: is cut off", serial="SN0100")
    return made


def rows(store: bgars.Store, number: int) -> list[dict]:
    return store.query(QUESTIONS[number - 1]).to_pylist()


def test_the_page_has_ten_questions_and_three_more() -> None:
    assert len(QUESTIONS) == 13


@pytest.mark.parametrize("number", range(1, 12))
def test_every_question_has_an_answer(store: bgars.Store, number: int) -> None:
    assert rows(store, number), QUESTIONS[number - 1]


def test_the_answers_are_right(store: bgars.Store) -> None:
    yields = {row["lot"]: (row["parts"], row["yield_percent"]) for row in rows(store, 1)}
    assert yields == {"L0": (4, 100.0), "L1": (4, 50.0)}
    assert rows(store, 3)[0] == {"defect": "missing", "parts": 2, "percent": 25.0}
    assert {row["ball"]: row["failed"] for row in rows(store, 4)} == {"A1": 1, "B2": 1}
    assert rows(store, 5)[0]["verdict"] == "fail"
    assert [row["parts"] for row in rows(store, 6)] == [4, 4]
    assert len(rows(store, 7)) == 8
    assert [row["cause"] for row in rows(store, 9)] == ["lamps", "noise"]
    assert rows(store, 9)[0]["expanded_um"] == pytest.approx(1.6)
    assert rows(store, 10)[0]["reason"] == "light_03.png: is cut off"


def run(*arguments: object) -> object:
    return CliRunner().invoke(app, ["query", *map(str, arguments)])


def test_the_command_prints_tables_csv_and_json(store: bgars.Store) -> None:
    sql = "select serial, verdict, mean_top_um, defects, inspected_utc from parts order by serial"
    text = run(store.folder, sql).output
    assert "SN0003" in text
    assert "(8 rows)" in text
    table = list(csv.reader(io.StringIO(run(store.folder, sql, "--csv").output)))
    assert table[0] == ["serial", "verdict", "mean_top_um", "defects", "inspected_utc"]
    assert (table[4][0], table[4][1], table[4][3]) == ("SN0003", "fail", "missing")
    answer = json.loads(run(store.folder, sql, "--json").output)
    assert answer["rows"][3]["defects"] == ["missing"]
    assert answer["rows"][0]["inspected_utc"] == "2026-01-01T10:00:00Z"
    twice = run(store.folder, "select serial, count(*), count(*) from parts group by serial order by serial", "--csv")
    assert twice.output.splitlines()[1] == "SN0000,1,1"
    assert "parts (8 rows)" in run(store.folder).output


def test_no_cell_of_csv_is_a_formula(store: bgars.Store) -> None:
    sql = """select '=1+2' as "=name", '@x' as at, -1.5 as number, ['+a', 'b'] as list"""
    rows = list(csv.reader(io.StringIO(run(store.folder, sql, "--csv").output)))
    assert rows == [["'=name", "at", "number", "list"], ["'=1+2", "'@x", "-1.5", "'+a; b"]]


def test_json_has_every_column_and_every_kind_of_value(store: bgars.Store) -> None:
    sql = """select 1 as a, 2 as a, {'x': 1, 'y': ['nan'::double]} as s, '\\xAA'::blob as b,
        interval '1 month 2 days 3.5 seconds' as i, time '10:11:12' as t, timestamptz '2026-01-02 10:00:00+02' as z,
        map {'k': 1} as m, sum(1) as n, date '2026-01-02' as d"""
    answer = json.loads(run(store.folder, sql, "--json").output)
    assert answer["columns"] == ["a", "a_1", "s", "b", "i", "t", "z", "m", "n", "d"]
    assert list(answer["rows"][0].values()) == [
        *(1, 2, {"x": 1, "y": [None]}, "aa", "P1M2DT3.5S", "10:11:12"),
        *("2026-01-02T08:00:00Z", [["k", 1]], 1, "2026-01-02"),
    ]
    assert type(answer["rows"][0]["n"]) is int
    cells = next(csv.reader([run(store.folder, sql, "--csv").output.splitlines()[1]]))
    assert cells[2] == '{"x": 1, "y": [null]}'


@pytest.mark.parametrize(
    ("sql", "words"),
    [
        ("selec 1", "query: Parser Error"),
        ("select * from nothing", "Table with name nothing does not exist"),
        ("select * from read_csv('/etc/passwd')", "Permission Error"),
        ("copy parts to '/tmp/bgars-test.csv'", "must be one SELECT that returns rows"),
        ("-- no question", "must be one SELECT that returns rows"),
        ("select 1; select 2", "got 2 statements"),
        ("pivot parts on verdict using count(*)", "got PIVOT without IN"),
    ],
)
def test_a_question_that_is_none_gets_one_line(store: bgars.Store, sql: str, words: str) -> None:
    with pytest.raises(bgars.InputError) as caught:
        store.query(sql)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "sql",
    [
        "copy (select 1 a) to '{store}/store.json' (format csv)",
        "with w as (copy (select 1 a) to '{store}/store.json' (format csv)) select 1",
        "select * from (select 1) where exists (with w as (copy (select 1 a) to '{store}/store.json') select 1)",
        "explain analyze copy (select 1 a) to '{store}/store.json' (format csv)",
        "select 1; copy (select 1 a) to '{store}/store.json' (format csv)",
        "with w as (delete from parts_taken returning serial) select * from w",
        "attach '{store}/new.db' as d",
        "export database '{store}/dump'",
        "create table t as select 1 a",
        "drop view parts",
    ],
)
def test_no_question_writes_into_the_store(store: bgars.Store, sql: str) -> None:
    before = {path: path.read_bytes() for path in store.folder.rglob("*") if path.is_file()}
    with pytest.raises(bgars.InputError, match=r"query: (must be one SELECT|Binder Error|Parser Error)"):
        store.query(sql.replace("{store}", str(store.folder)))
    assert {path: path.read_bytes() for path in store.folder.rglob("*") if path.is_file()} == before


@pytest.mark.parametrize(
    "sql",
    [
        "with recursive n as (select 1 i union all select i + 1 from n where i < 3) select i from n",
        "pivot parts on verdict in ('pass', 'fail') using count(*)",
        "describe parts",
        "from parts limit 1;",
        "select 'copy' a union values ('insert')",
    ],
)
def test_questions_that_read_in_other_words_are_answered(store: bgars.Store, sql: str) -> None:
    assert store.query(sql).num_rows >= 1


WITH_4_GB = """
import os
from bgars.cli import main, query
query.SHARE = 4e9 / os.sysconf("SC_PHYS_PAGES") / os.sysconf("SC_PAGE_SIZE")
main()
"""


@pytest.mark.skipif(sys.platform != "linux", reason="memory of a process is not bounded there")
def test_a_query_does_not_take_the_memory_of_the_machine(store: bgars.Store) -> None:
    asked = [sys.executable, "-c", WITH_4_GB, "query", str(store.folder)]
    few, lists = (
        subprocess.run([*asked, sql], capture_output=True, text=True, check=False)
        for sql in ("select count(*) from balls", "select range(1e9::bigint)")  # 8 GB, asked for at once
    )
    assert few.returncode == 0, few.stderr
    assert (lists.returncode, lists.stdout, lists.stderr.count("\n")) == (2, "", 1)
    assert "ask for fewer rows and columns, or for sums" in lists.stderr


def test_what_rework_mended_and_what_it_did_not(tmp_path: Path) -> None:
    store = filled_store(tmp_path / "store", 6)
    for number, serial in ((2, "SN0003"), (5, "SN0003")):
        again = replace(part(number), serial=serial, inspected_utc=f"2026-02-0{number}T10:00:00Z")
        assert store.append(again)
    (question,) = [text for text in QUESTIONS if "is_left" in text]
    told = store.query(question).to_pylist()
    assert [(row["round"], row["before_it"], row["after_it"]) for row in told] == [
        (2, "fail", "pass"),
        (3, "pass", "fail"),
    ]
    assert "missing: B2" in told[0]["was"]
    assert "missing: A1" in told[1]["is_left"]


def test_the_yield_by_place_on_the_strip(tmp_path: Path) -> None:
    store = filled_store(tmp_path / "store", 1)
    for number, position in ((2, "R1C1"), (3, "R1C1"), (4, "R1C2")):
        store.append(replace(part(number), identity=bgars.PartIdentity(position=position)))
    assert store.query(QUESTIONS[-1]).to_pylist() == [
        {"position": "R1C1", "parts": 2, "yield_percent": 50.0},
        {"position": "R1C2", "parts": 1, "yield_percent": 100.0},
    ]
