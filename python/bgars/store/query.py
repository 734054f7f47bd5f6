"""Questions to a store, answered by DuckDB."""

from __future__ import annotations

import importlib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from bgars.errors import FileFormatError, InputError
from bgars.store.read_only import need_reading
from bgars.store.repair import raise_damage
from bgars.store.schema import OLD_NAMES, TABLES, arrow_schema

__all__ = ["VIEWS", "connect", "need_duckdb", "query"]

TRIES = 5
"""A compaction may take files away between the listing and the reading; the next listing has what replaced them."""
LOST = ("No files found", "Cannot open file", "No such file")
VIEWS = {
    "parts": "the latest inspection of each part and round; round = 1, 2, ... counts new images of a serial number",
    "balls": "one row per ball, with serial, lot, part and time of its part",
    "checks": "one row per judged quantity of a part",
    "budgets": "standard uncertainty by cause, of each reading",
    "failures": "captures that could not be inspected, and why; removed once inspected",
    "inspections": "one row per inspection: parts, and those that a later one of the same images replaced",
    "results": "part_key, serial, result_json: everything else of an inspection",
}
# A part is taken from the first of its files, and its balls from the file of the same name: while a compaction runs,
# there are two copies of both.
PARTS = """
CREATE TABLE parts_taken AS
-- The same images inspected again, such as with a station that was calibrated anew, replace what was found before.
-- Files of an earlier bgars do not say which images: a later row has their round only if it has their images.
SELECT *, serial = '' OR (
    row_number() OVER (PARTITION BY serial, recipe, round, coalesce(nullif(images_sha256, ''), part_key)
                       ORDER BY sequence DESC) = 1
    AND NOT (images_sha256 IS NULL AND sequence < coalesce(
        max(sequence) FILTER (images_sha256 IS NOT NULL) OVER (PARTITION BY serial, recipe, round), 0))) AS is_latest
FROM (SELECT * REPLACE (CASE WHEN serial = '' THEN 1 ELSE coalesce(round, row_number() OVER (
    PARTITION BY serial, recipe ORDER BY inspected_utc, sequence)) END AS round)
FROM (SELECT * EXCLUDE (filename, copy) FROM (
    SELECT *, parse_filename(filename, true) AS stem,
           row_number() OVER (PARTITION BY part_key ORDER BY filename) AS copy
    -- Files of an earlier bgars have no rounds, or no checksum of the images.
    FROM (SELECT * EXCLUDE (result_json) FROM {parts} UNION ALL BY NAME
          SELECT NULL::BIGINT AS round, NULL::VARCHAR AS images_sha256 WHERE false))
    WHERE copy = 1));
CREATE VIEW parts AS SELECT * EXCLUDE (stem, is_latest) FROM parts_taken WHERE is_latest;
CREATE VIEW inspections AS SELECT * EXCLUDE (stem) FROM parts_taken;
CREATE VIEW results AS SELECT part_key, serial, result_json FROM (
    SELECT *, row_number() OVER (PARTITION BY part_key ORDER BY filename) AS copy FROM {parts}) WHERE copy = 1;
"""
SIDES = """
CREATE VIEW {name} AS
SELECT p.serial, p.lot, p.part, p.inspected_utc, p.sequence, p.round,
       s.* EXCLUDE (filename, day, recipe), p.day, p.recipe
FROM {files} s JOIN parts_taken p ON s.part_key = p.part_key AND parse_filename(s.filename, true) = p.stem
WHERE p.is_latest;
"""
FAILURES = """
CREATE VIEW failures_taken AS SELECT * EXCLUDE (filename, copy) FROM (
    SELECT *, row_number() OVER (PARTITION BY part_key ORDER BY sequence DESC, filename) AS copy FROM {failures})
WHERE copy = 1;
CREATE VIEW failures AS SELECT * FROM failures_taken f WHERE NOT EXISTS (
    SELECT 1 FROM parts_taken p
    -- A success under another recipe, such as for the other side, says nothing; 'none' is of before it was known.
    WHERE p.sequence > f.sequence AND (f.recipe = p.recipe OR f.recipe = 'none')
      AND ((f.serial <> '' AND p.serial = f.serial)
           OR (p.capture_folder = f.capture_folder
               -- Another part of the same strip, which is named STRIP-PLACE, says nothing of this one.
               AND NOT (p.position <> '' AND ends_with(p.serial, '-' || p.position)
                        AND starts_with(f.serial, p.serial[:-length(p.position) - 1])))));
"""


def query(folder: Path, sql: str) -> Any:  # noqa: ANN401 - pyarrow has no types
    """Return the answer to a question, as an Arrow table.

    Raises
    ------
    InputError
        DuckDB is not installed or refuses the question, or this is no single SELECT that only reads.
    FileFormatError
        A file of the store cannot be read.
    """
    duckdb = need_duckdb()
    for attempt in range(TRIES):
        try:
            with connect(folder) as connection:
                need_reading(connection, sql)
                return _answer(connection, sql)
        except duckdb.OutOfMemoryException as error:
            told = str(error).strip().splitlines()[0]
            msg = f"query: {told}; ask for fewer rows and columns, or for sums"
            raise InputError(msg) from error
        except duckdb.Error as error:
            is_file = isinstance(error, duckdb.IOException)
            if is_file and attempt + 1 < TRIES and any(word in str(error) for word in LOST):
                continue
            # What a damaged file says has no class of its own, and not always the name of the file.
            if is_file or type(error) is duckdb.Error or ".parquet" in str(error):
                raise_damage(folder)
            if is_file:
                msg = f"{folder}: a file of the store cannot be read ({_one_line(error)})"
                raise FileFormatError(msg) from error
            msg = f"query: {_one_line(error)}"
            raise InputError(msg) from error
    msg = f"{folder}: files of the store go while they are read; try again"
    raise FileFormatError(msg)


def _answer(connection: Any, sql: str) -> Any:  # noqa: ANN401 - as above
    """Ask beside this thread, which so hears every signal: DuckDB hears Ctrl-C only, and raises an error of its own."""
    with ThreadPoolExecutor(1) as beside:
        asked = beside.submit(lambda: connection.sql(sql).to_arrow_table())
        try:
            return asked.result()
        except KeyboardInterrupt:
            connection.interrupt()
            raise


def connect(folder: Path) -> Any:  # noqa: ANN401 - duckdb's connection
    """Return a connection to a database in memory whose views are the tables of the store; it reaches nothing else."""
    connection = need_duckdb().connect(":memory:")
    connection.execute("SET TimeZone = 'UTC'")
    connection.execute("SET autoinstall_known_extensions = false")
    sources = {table: _source(connection, folder, table) for table in TABLES}
    connection.execute(PARTS.format(**sources))
    for name in ("balls", "checks", "budgets"):
        connection.execute(SIDES.format(name=name, files=sources[name]))
    connection.execute(FAILURES.format(**sources))
    connection.execute(f"SET allowed_directories = [{_quoted(str(folder.resolve()))}]")
    connection.execute("SET enable_external_access = false")
    connection.execute("SET lock_configuration = true")
    return connection


def _source(connection: Any, folder: Path, table: str) -> str:  # noqa: ANN401 - as above
    """What to select from: the files of a table, or its empty form where there are none; all names are today's."""
    if next((folder / table).rglob("*.parquet"), None) is None:
        empty = arrow_schema(table).empty_table()
        connection.register(f"empty_{table}", empty)
        return f"(SELECT *, '' AS filename, NULL::DATE AS day, NULL::VARCHAR AS recipe FROM empty_{table})"
    files = _quoted(str(folder.resolve() / table / "*" / "*" / "*.parquet"))
    read = (
        f"read_parquet({files}, filename = true, union_by_name = true, hive_partitioning = true, "
        "hive_types = {'day': DATE, 'recipe': VARCHAR})"
    )
    old = OLD_NAMES.get(table)
    if not old:
        return read
    both = ", ".join(f"NULL::DOUBLE AS {name}" for names in old.items() for name in names)
    taken = ", ".join(f"coalesce({new}, {was}) AS {new}" for was, new in old.items())
    return (
        f"(SELECT * EXCLUDE ({', '.join(old)}) REPLACE ({taken}) FROM "
        f"(SELECT * FROM {read} UNION ALL BY NAME SELECT {both} WHERE false))"
    )


def need_duckdb() -> Any:  # noqa: ANN401 - a module
    """Return DuckDB, or say how to get it."""
    try:
        return importlib.import_module("duckdb")
    except ImportError:
        msg = "query: needs duckdb, which is not installed; install it with: pip install 'bgars[store]'"
        raise InputError(msg) from None


def _quoted(text: str) -> str:
    return "'" + text.replace("'", "''") + "'"


def _one_line(error: Exception) -> str:
    """DuckDB's message without the lines that point into the question."""
    lines = [line.strip() for line in str(error).splitlines()]
    return " ".join(line for line in lines if line and set(line) != {"^"} and not line.startswith("LINE "))
