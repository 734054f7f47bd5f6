"""The commands ``bgars query`` and ``bgars store``."""

from __future__ import annotations

import csv
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bgars.cli.console import owns_process, print_json, say
from bgars.cli.options import JsonOption
from bgars.cli.plain_cells import distinct_names, plain, text_of
from bgars.errors import InputError
from bgars.files.counted import counted
from bgars.files.csv_cells import harmless
from bgars.io.result_file import read_result
from bgars.store import open_store
from bgars.store.query import VIEWS

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["register"]

MOST_WIDE = 60
BLOCK_ROWS = 10_000
SHARE = 0.75
"""Of the machine's memory, that a query may take: the rest of the line's programs work there, too."""
StoreArgument = Annotated[
    Path, typer.Argument(metavar="STORE", help="Store that bgars batch or bgars watch wrote.", show_default=False)
]


def register(app: typer.Typer) -> None:
    """Add the commands."""
    app.command("query")(query)
    stores = typer.Typer(help="Maintain a store of results.", no_args_is_help=True)
    stores.command("compact")(compact)
    stores.command("export")(export)
    stores.command("add")(add)
    stores.command("repair")(repair)
    app.add_typer(stores, name="store")


def query(
    store: StoreArgument,
    sql: Annotated[
        str,
        typer.Argument(
            metavar="SQL", help="A query in SQL; without one, the tables and columns are listed.", show_default=False
        ),
    ] = "",
    as_csv: Annotated[bool, typer.Option("--csv", help="Print CSV.")] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object: columns, and rows as objects.")
    ] = False,
) -> None:
    """Query a store of results, in SQL: which lot, which ball, since when, how often.

    Tables: parts, balls, checks, budgets, failures, inspections, results; docs/queries.md has examples. A query reads
    only the store and changes nothing.

    Exit code 0: answered. 2: no store, or a query that DuckDB refuses.
    """
    if as_csv and as_json:
        msg = "--csv and --json: give one of them"
        raise InputError(msg)
    opened = open_store(store)
    if not sql:
        _say_tables(opened, as_json=as_json)
        return
    if owns_process():
        _bound_memory()
    answer = opened.query(sql)
    names = answer.column_names
    # As Python's objects, an answer takes many times its memory: a part at a time.
    rows = (row for part in answer.to_batches(max_chunksize=BLOCK_ROWS) for row in _rows(part))
    if as_json:
        names = distinct_names(names)
        print_json({"columns": names, "rows": [dict(zip(names, row, strict=True)) for row in rows]})
    elif as_csv:
        writer = csv.writer(sys.stdout, lineterminator="\n")
        writer.writerow([harmless(name) for name in names])
        writer.writerows([_csv_cell(value) for value in row] for row in rows)
    else:
        _say_table(names, list(rows))


def compact(store: StoreArgument, as_json: JsonOption = False) -> None:
    """Join the many small files of a store; others may read and append meanwhile."""
    counts = open_store(store).compact()
    if as_json:
        print_json(counts)
    else:
        say(f"{store}: {counts['files_before']} files became {counts['files_after']}")


def export(
    store: StoreArgument,
    url: Annotated[
        str,
        typer.Argument(
            metavar="URL",
            help="Database as SQLAlchemy names it: sqlite:///parts.db, postgresql+psycopg://user@host/name.",
            show_default=False,
        ),
    ],
    as_json: JsonOption = False,
) -> None:
    r"""Copy new parts into a database, as tables bgars_parts, bgars_balls, bgars_checks, bgars_budgets, bgars_failures.

    Needs pip install 'bgars\[sql]' and the database's driver. Run it again for what came since.
    """
    added = open_store(store).export(url)
    if as_json:
        print_json(dict(added))
        return
    for name, count in added.items():
        say(f"{name}: {count} rows")


def add(
    store: StoreArgument,
    results: Annotated[
        list[Path],
        typer.Argument(metavar="RESULT", help="result.json files, or folders that hold one.", show_default=False),
    ],
    as_json: JsonOption = False,
) -> None:
    """Add results that bgars inspect wrote; makes the store where there is none."""
    read = [(path, read_result(path)) for path in results]
    opened = open_store(store, create=True)
    count = sum(opened.append(result, capture_folder=str(path)) for path, result in read)
    if as_json:
        print_json({"added": count, "known": len(read) - count})
    else:
        say(f"{store}: {count} results added, {len(read) - count} were there")


def repair(store: StoreArgument, as_json: JsonOption = False) -> None:
    """Read every file of a store; make damaged ones again from the results, or move them to STORE/damaged.

    Files of balls, checks and budgets are made again. Parts whose own file is damaged are not in the store any more:
    inspect their captures again. What is readable stays as it is.
    """
    done = open_store(store).repair()
    if as_json:
        print_json(dict(done))
        return
    for name in done["remade"]:
        say(f"{store / name}: made again from the results")
    for name in done["set_aside"]:
        say(f"{store / name}: moved to {store / 'damaged'}")
    if any(name.startswith("parts/") for name in done["set_aside"]):
        say("parts are missing: inspect their captures again, with bgars batch")
    if not any(done.values()):
        say(f"{store}: every file is readable")


def _bound_memory() -> None:
    """Let the system refuse what is too much: DuckDB's limit does not count the memory of lists."""
    if sys.platform == "linux":  # Windows has no such limit, macOS ignores it
        import resource  # noqa: PLC0415 - of this system

        most = int(SHARE * os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
        now, highest = resource.getrlimit(resource.RLIMIT_AS)
        lowest = min([each for each in (now, highest, most) if each != resource.RLIM_INFINITY])
        resource.setrlimit(resource.RLIMIT_AS, (lowest, highest))


def _rows(part: Any) -> Iterator[list[Any]]:  # noqa: ANN401 - pyarrow has no types
    columns = [[plain(value) for value in column.to_pylist()] for column in part.columns]
    return map(list, zip(*columns, strict=True))


def _say_tables(opened: Any, *, as_json: bool) -> None:  # noqa: ANN401 - a Store
    counts = {name: opened.query(f"select count(*) n from {name}")["n"][0].as_py() for name in VIEWS}
    columns = {name: opened.query(f"select * from {name} limit 0").column_names for name in VIEWS}
    if as_json:
        print_json({"tables": {name: {"rows": counts[name], "columns": columns[name]} for name in VIEWS}})
        return
    for name, meaning in VIEWS.items():
        say(f"{name} ({counts[name]} rows): {meaning}")
        say(f"  {', '.join(columns[name])}")


def _say_table(names: list[str], rows: list[list[Any]]) -> None:
    cells = [names, *([_cell(value) for value in row] for row in rows)]
    widths = [max(len(row[at]) for row in cells) for at in range(len(names))]
    number = [all(isinstance(row[at], int | float) or row[at] is None for row in rows) for at in range(len(names))]
    for row in cells:
        padded = [
            f"{cell:>{width}}" if right else f"{cell:<{width}}"
            for cell, width, right in zip(row, widths, number, strict=True)
        ]
        say("  ".join(padded).rstrip())
    is_cut = any(len(cell) == MOST_WIDE and cell.endswith("...") for row in cells for cell in row)
    hint = "; texts are shortened, --csv prints them whole" if is_cut else ""
    say(f"({counted(len(rows), 'row')}{hint})")


def _csv_cell(value: Any) -> Any:  # noqa: ANN401 - whatever was asked for
    """Numbers as they are; texts such that no spreadsheet runs them."""
    if isinstance(value, list | dict):
        value = text_of(value)
    return harmless(value) if isinstance(value, str) else value


def _cell(value: Any) -> str:  # noqa: ANN401 - whatever was asked for
    if value is None:
        return "-"
    if isinstance(value, float):
        return f"{value:.6g}"
    text = " ".join(text_of(value).split())
    return text if len(text) <= MOST_WIDE else f"{text[: MOST_WIDE - 3]}..."
