"""The tables of a store in somebody's database, through SQLAlchemy."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from bgars.errors import FileFormatError, InputError
from bgars.store.query import query
from bgars.store.schema import OLD_NAMES, TABLES

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

__all__ = ["export"]

BLOCK_PARTS = 100
READ_PARTS = 2000
"""Of 100 balls each they take some 100 MB."""
PREFIX = "bgars_"
OWN_COLUMNS = {"day": "text", "recipe": "text"}
KEYS = {
    "parts": ("part_key",),
    "balls": ("part_key", "name"),
    "checks": ("part_key", "name"),
    "failures": ("part_key",),
}


def export(folder: Path, url: str) -> dict[str, int]:
    """Copy parts that a database does not have yet, each with all its rows or not at all.

    Parameters
    ----------
    folder : Path
        The store.
    url : str
        As SQLAlchemy takes it: ``sqlite:///parts.db``, ``postgresql+psycopg://user@host/name``.

    Returns
    -------
    dict of int
        Rows that were added, by table of the database: ``bgars_parts``, ``bgars_balls``, ...

    Raises
    ------
    InputError
        SQLAlchemy or the database's driver is not installed, or the URL is none.
    FileFormatError
        The database refuses; what was complete stays.
    """
    alchemy = _need_sqlalchemy()
    address = _address(alchemy, url)
    shown = _shown(address)
    try:
        engine = alchemy.create_engine(address)
    except (alchemy.exc.ArgumentError, alchemy.exc.NoSuchModuleError, ImportError) as error:
        msg = f"{shown}: is not a database that can be reached from here ({_first_line(error)})"
        raise InputError(msg) from None
    try:
        return _copy(alchemy, engine, folder)
    except alchemy.exc.IntegrityError as error:
        why = "another export writes at the same time, or rows were changed there; run it again"
        msg = f"{shown}: {why} ({_first_line(error)})"
        raise FileFormatError(msg) from None
    except alchemy.exc.SQLAlchemyError as error:
        msg = f"{shown}: {_first_line(error)}"
        raise FileFormatError(msg) from None
    finally:
        engine.dispose()


def _copy(alchemy: Any, engine: Any, folder: Path) -> dict[str, int]:  # noqa: ANN401 - modules without types
    metadata = alchemy.MetaData()
    tables = {name: _table(alchemy, metadata, name) for name in TABLES}
    _rename_columns(alchemy, engine)
    metadata.create_all(engine)
    _add_columns(alchemy, engine, tables)
    with engine.connect() as connection:
        there = set(connection.execute(alchemy.select(tables["parts"].c.part_key)).scalars())
    replaced = query(folder, "select part_key from inspections where not is_latest")["part_key"].to_pylist()
    _remove(engine, tables, [key for key in replaced if key in there])
    keys = query(folder, "select part_key from parts order by sequence")["part_key"].to_pylist()
    fresh = [key for key in keys if key not in there]
    added = dict.fromkeys((f"{PREFIX}{name}" for name in TABLES), 0)
    for rows in _blocks(folder, fresh, tables):
        with engine.begin() as connection:
            for name, of_block in rows.items():
                added[f"{PREFIX}{name}"] += _insert(connection, tables[name], of_block)
    # Failures are few and may go: those of this store, and not of another one, are copied as they are now.
    own = query(folder, "select part_key from failures_taken")["part_key"].to_pylist()
    with engine.begin() as connection:
        for start in range(0, len(own), BLOCK_PARTS):
            of_store = tables["failures"].c.part_key.in_(own[start : start + BLOCK_PARTS])
            connection.execute(tables["failures"].delete().where(of_store))
        every = ", ".join(column.name for column in tables["failures"].columns)
        rows = query(folder, f"select {every} from failures")
        added[f"{PREFIX}failures"] += _insert(connection, tables["failures"], rows)
    return added


def _blocks(folder: Path, keys: list[str], tables: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Rows of the tables, of so many parts as are written at once; every look into a store opens all of its files."""
    pyarrow, compute = (importlib.import_module(name) for name in ("pyarrow", "pyarrow.compute"))
    for first in range(0, len(keys), READ_PARTS):
        read, rows = keys[first : first + READ_PARTS], {}
        asked = ", ".join(f"'{key}'" for key in read)
        for name in ("parts", "balls", "checks", "budgets"):
            names = ", ".join(_name(column.name) for column in tables[name].columns if column.name != "row_id")
            rows[name] = query(folder, f"select {names} from {name} where part_key in ({asked})")
        for start in range(0, len(read), BLOCK_PARTS):
            block = read[start : start + BLOCK_PARTS]
            yield {
                name: table.filter(compute.is_in(table["part_key"], value_set=pyarrow.array(block)))
                for name, table in rows.items()
            }


def _remove(engine: Any, tables: dict[str, Any], keys: list[str]) -> None:  # noqa: ANN401 - as above
    """Remove inspections that later ones of the same images replaced."""
    for start in range(0, len(keys), BLOCK_PARTS):
        with engine.begin() as connection:
            for name in ("budgets", "checks", "balls", "parts"):
                gone = tables[name].c.part_key.in_(keys[start : start + BLOCK_PARTS])
                connection.execute(tables[name].delete().where(gone))


def _add_columns(alchemy: Any, engine: Any, tables: dict[str, Any]) -> None:  # noqa: ANN401 - as above
    """Give a database that an earlier version made the columns that came since, empty in its rows."""
    looked = alchemy.inspect(engine)
    with engine.begin() as connection:
        for table in tables.values():
            there = {each["name"] for each in looked.get_columns(table.name)}
            for column in table.columns:
                if column.name not in there:
                    kind = column.type.compile(dialect=engine.dialect)
                    connection.execute(alchemy.text(f"ALTER TABLE {table.name} ADD COLUMN {column.name} {kind}"))


def _rename_columns(alchemy: Any, engine: Any) -> None:  # noqa: ANN401 - as above
    """Give the columns of a database that an earlier version filled the names that they have now."""
    looked = alchemy.inspect(engine)
    with engine.begin() as connection:
        for name, names in OLD_NAMES.items():
            table = f"{PREFIX}{name}"
            there = {each["name"] for each in looked.get_columns(table)} if looked.has_table(table) else set()
            for old, new in names.items():
                if old in there and new not in there:
                    connection.execute(alchemy.text(f"ALTER TABLE {table} RENAME COLUMN {old} TO {new}"))


def _table(alchemy: Any, metadata: Any, name: str) -> Any:  # noqa: ANN401 - as above
    types = {
        "text": alchemy.Text,
        "texts": alchemy.Text,
        "real": alchemy.Double,
        "whole": alchemy.BigInteger,
        "truth": alchemy.Boolean,
        "time": alchemy.DateTime,
    }
    columns = [(column.name, column.kind) for column in TABLES[name] if column.name != "result_json"]
    columns += list(OWN_COLUMNS.items())
    keys = KEYS.get(name, ())
    made = [alchemy.Column("row_id", alchemy.Integer, primary_key=True)] if not keys else []
    # MySQL and others index text only with a length: keys are 64 digits, names of balls are short.
    made += [
        alchemy.Column(column, alchemy.String(200) if column in keys else types[kind], primary_key=column in keys)
        for column, kind in columns
    ]
    return alchemy.Table(f"{PREFIX}{name}", metadata, *made)


def _insert(connection: Any, table: Any, rows: Any) -> int:  # noqa: ANN401 - as above
    values = [{name: _plain(value) for name, value in row.items()} for row in rows.to_pylist()]
    if values:
        connection.execute(table.insert(), values)
    return len(values)


def _plain(value: Any) -> Any:  # noqa: ANN401 - a cell
    """Lists become one text: not every database has them. Days become text, as the store's folders have them.

    Nor has every database the character NUL, which an error of somebody's library may hold.
    """
    if isinstance(value, list):
        value = "; ".join(value)
    if isinstance(value, str):
        return value.replace("\0", "\ufffd")
    return value.isoformat() if type(value).__name__ == "date" else value


def _name(column: str) -> str:
    return f'"{column}"'


def _need_sqlalchemy() -> Any:  # noqa: ANN401 - a module
    try:
        return importlib.import_module("sqlalchemy")
    except ImportError:
        msg = "export: needs SQLAlchemy, which is not installed; install it with: pip install 'bgars[sql]'"
        raise InputError(msg) from None


def _address(alchemy: Any, url: str) -> Any:  # noqa: ANN401 - SQLAlchemy's URL
    """Take a URL apart; what is said of a wrong one does not hold it, as there may be a password in it."""
    try:
        address = alchemy.engine.make_url(url)
    except (alchemy.exc.ArgumentError, ValueError):
        address = None
    if address is None or "@" in (address.host or ""):
        msg = (
            "url: must be as SQLAlchemy takes it, like sqlite:///parts.db or postgresql+psycopg://user@host:5432/name "
            "(in a password @ is written %40, : %3A, / %2F and % %25)"
        )
        raise InputError(msg)
    return address


def _shown(address: Any) -> str:  # noqa: ANN401 - as above
    """The URL without password and options, which must not come into a log."""
    return str(address._replace(password=None, query={}))


def _first_line(error: Exception) -> str:
    told = str(getattr(error, "orig", None) or error).strip().splitlines()
    return told[0] if told else type(error).__name__
