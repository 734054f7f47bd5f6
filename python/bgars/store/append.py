"""Files of a store appear whole or not at all, from any number of processes, and stay after a power cut."""

from __future__ import annotations

import hashlib
import os
import secrets
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from bgars.errors import FileFormatError
from bgars.io.parquet import need_pyarrow
from bgars.store.schema import arrow_schema

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

__all__ = ["COMMIT", "PARTIAL", "append_rows", "partition", "write_durably", "write_table"]

COMMIT = "parts"
"""The table that is written last: rows of the others count only with their row here."""
PARTIAL = ".partial"
LONGEST_NAME = 100


def partition(day: str, recipe: str) -> Path:
    """Return the folder of a day and a recipe in each table, as Hive names it.

    Examples
    --------
    >>> str(partition("2026-01-31", "BGA 100/A"))
    'day=2026-01-31/recipe=BGA%20100%2FA'
    """
    name = quote(recipe or "none", safe="")
    if len(name) > LONGEST_NAME:
        name = f"{name[:LONGEST_NAME].rstrip('%')}~{hashlib.sha256(recipe.encode()).hexdigest()[:12]}"
    return Path(f"day={day}") / f"recipe={name}"


def append_rows(folder: Path, place: Path, stem: str, rows: Mapping[str, Sequence[dict[str, Any]]]) -> None:
    """Write the rows of each table to ``TABLE/place/stem.parquet``; the parts come last, which makes the rest count.

    A file that is there is replaced: the same stem has the same content.

    Raises
    ------
    FileFormatError
        A file cannot be written, such as on a full disk. No row counts then.
    """
    pyarrow, _ = need_pyarrow()
    for table in sorted(rows, key=lambda name: name == COMMIT):
        if rows[table]:
            made = pyarrow.Table.from_pylist(list(rows[table]), schema=arrow_schema(table))
            write_table(made, folder / table / place / f"{stem}.parquet")


def write_table(table: Any, path: Path) -> None:  # noqa: ANN401 - pyarrow has no types
    """Write an Arrow table as a Parquet file, whole or not at all."""
    pyarrow, parquet = need_pyarrow()
    buffer = pyarrow.BufferOutputStream()
    parquet.write_table(table, buffer, compression="zstd")
    write_durably(path, memoryview(buffer.getvalue()))


def write_durably(path: Path, content: bytes | memoryview) -> None:
    """Write a file beside its place, bring it to the disk, rename it, and bring the name to the disk.

    Raises
    ------
    FileFormatError
        What the system says, with the path.
    """
    # Of its own random name: several processes may write the same file.
    temporary = path.with_name(f".{path.stem}.{os.getpid()}.{secrets.token_hex(4)}{PARTIAL}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            with temporary.open("wb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
            temporary.replace(path)
        finally:
            temporary.unlink(missing_ok=True)
        _sync_folder(path.parent)
    except OSError as error:
        msg = f"{path}: cannot be written ({error.strerror or error})"
        raise FileFormatError(msg) from error


def _sync_folder(folder: Path) -> None:
    """Bring names to the disk; systems without folders that open (Windows) do it by themselves."""
    if os.name == "nt":
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
