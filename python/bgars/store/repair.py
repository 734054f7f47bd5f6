"""Files of a store that a disk or a copy damaged: made again from the results, or set aside, without the others."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from bgars.errors import FileFormatError
from bgars.io.parquet import need_pyarrow
from bgars.io.result_file import parse_result
from bgars.store.append import COMMIT, write_table
from bgars.store.rows import result_rows
from bgars.store.schema import TABLES, arrow_schema

if TYPE_CHECKING:
    from pathlib import Path

__all__ = ["damage", "need_columns", "raise_damage", "repair"]

ASIDE = "damaged"
"""Folder of the store for files that were set aside; they keep their place in it."""
NEEDED = ("part_key", "serial", "sequence", "inspected_utc", "lot", "result_json")
"""Columns that a file of parts has had since the first store."""
SIDES = ("balls", "checks", "budgets")


def damage(path: Path, error: Exception) -> FileFormatError:
    """Return the error that names a damaged file, and the way out."""
    store = path.parents[3]
    told = " ".join(str(error).split()).rstrip(".")
    way_out = f"'bgars store repair {store}' makes it again or sets it aside"
    return FileFormatError(f"{path}: is not a readable file of a store ({told}); {way_out}")


def need_columns(names: list[str], needed: tuple[str, ...] = NEEDED) -> None:
    """Raise ValueError where a file lacks a column: another program wrote it."""
    lost = [name for name in needed if name not in names]
    if lost:
        msg = f"has no column {lost[0]}"
        raise ValueError(msg)


def raise_damage(folder: Path) -> None:
    """Raise FileFormatError where a file of a store is damaged; all are read."""
    for table in TABLES:
        for path in sorted((folder / table).rglob("*.parquet")):
            try:
                _table(path)
            except FileFormatError:
                if path.is_file():  # else a compaction took it
                    raise


def repair(folder: Path) -> dict[str, list[str]]:
    """Read every file of a store; make damaged ones again from the whole results, else set them aside.

    A file of balls, checks or budgets follows from the results in the file of their parts. Without that, all files of
    these parts are moved to ``damaged/``: the store does not know them any more, and they can be inspected again.

    Returns
    -------
    dict of list of str
        ``remade`` and ``set_aside``: files, relative to the store.

    Raises
    ------
    FileFormatError
        A file cannot be moved or written.
    """
    remade, aside = [], []
    for table in sorted(TABLES, key=lambda name: name != COMMIT):  # a part's file first, with all that hangs on it
        for path in sorted((folder / table).rglob("*.parquet")):
            if not path.is_file() or _table_or_none(path) is not None:
                continue
            place = path.relative_to(folder / table)
            parts = _table_or_none(folder / COMMIT / place) if table in SIDES else None
            if parts is not None:
                write_table(_made_again(parts, table, path), path)
                remade.append(f"{table}/{place.as_posix()}")
                continue
            for each in (COMMIT, *SIDES) if table == COMMIT else (table,):
                if (folder / each / place).is_file():
                    _set_aside(folder / each / place, folder / ASIDE / each / place)
                    aside.append(f"{each}/{place.as_posix()}")
    return {"remade": remade, "set_aside": aside}


def _table(path: Path) -> Any:  # noqa: ANN401 - pyarrow has no types
    pyarrow, parquet = need_pyarrow()
    try:
        with parquet.ParquetFile(path) as file:
            need_columns(file.schema_arrow.names, NEEDED if path.parents[2].name == COMMIT else NEEDED[:1])
            return file.read()
    except (OSError, ValueError, pyarrow.ArrowException) as error:
        raise damage(path, error) from error


def _table_or_none(path: Path) -> Any:  # noqa: ANN401 - as above
    try:
        return _table(path)
    except FileFormatError:
        return None


def _made_again(parts: Any, table: str, path: Path) -> Any:  # noqa: ANN401 - as above
    pyarrow, _ = need_pyarrow()
    rows: list[dict[str, Any]] = []
    for part in parts.select(["part_key", "sequence", "result_json"]).to_pylist():
        result = parse_result(part["result_json"].encode(), path)
        made = result_rows(result, sequence=part["sequence"])[table]
        rows += ({**row, "part_key": part["part_key"]} for row in made)
    return pyarrow.Table.from_pylist(rows, schema=arrow_schema(table))


def _set_aside(path: Path, target: Path) -> None:
    target = target.with_name(f"{target.name}.damaged")  # no file that counts
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        path.replace(target)
    except OSError as error:
        msg = f"{path}: cannot be moved to {target} ({error.strerror or error})"
        raise FileFormatError(msg) from error
