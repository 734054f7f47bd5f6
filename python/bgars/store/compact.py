"""Many small files become few, while others append and read."""

from __future__ import annotations

import hashlib
import time
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from bgars.io.parquet import need_pyarrow
from bgars.store.append import COMMIT, PARTIAL, write_table
from bgars.store.repair import damage
from bgars.store.schema import TABLES

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

__all__ = ["compact"]

FEWEST_FILES = 2
LARGEST_BYTES = 16 << 20
"""Of the files that become one: they are read into memory, where they take some ten times as much."""
ABANDONED_S = 86_400.0
"""Age at which a file without its part, or a partial one, is what a killed process left: no append takes a day."""
OF_PARTS = tuple(name for name in TABLES if name != "failures")


def compact(folder: Path) -> dict[str, int]:
    """Join the files of each partition; return how many files there were and are.

    A joined file is written before its pieces go, so that no row is ever away; while both are there, readers take one
    copy of each part. Killed at any time, or run twice at once, it loses nothing.

    Raises
    ------
    FileFormatError
        A file cannot be read or written.
    """
    before = _count(folder)
    for commit, tables in ((COMMIT, OF_PARTS), ("failures", ("failures",))):
        for place in sorted({path.parent for path in (folder / commit).rglob("*.parquet")}):
            for stems in _groups(place):
                # Where another process joins the same files, what it writes holds them.
                with suppress(FileNotFoundError):
                    _join(folder, place.relative_to(folder / commit), stems, commit, tables)
    _sweep(folder)
    return {"files_before": before, "files_after": _count(folder)}


def _groups(place: Path) -> Iterator[list[str]]:
    """Names of files that are worth to be one, in the order of names."""
    stems: list[str] = []
    held = 0
    for path in sorted(place.glob("*.parquet")):
        with suppress(FileNotFoundError):
            size = path.stat().st_size
            if held + size > LARGEST_BYTES:
                if len(stems) >= FEWEST_FILES:
                    yield stems
                stems, held = [], 0
            if size <= LARGEST_BYTES // 2:
                stems.append(path.stem)
                held += size
    if len(stems) >= FEWEST_FILES:
        yield stems


def _join(folder: Path, place: Path, stems: list[str], commit: str, tables: tuple[str, ...]) -> None:
    """Write the joined files, parts last, then remove the pieces, parts first.

    Everything is read before anything is written, and the pieces are listed before the parts are read: a part that is
    there after the listing had all its rows in it.

    Raises
    ------
    FileNotFoundError
        Another process was quicker.
    """
    sides = [
        (table, stem)
        for table in tables
        if table != commit
        for stem in stems
        if (folder / table / place / f"{stem}.parquet").is_file()
    ]
    pieces: dict[str, list[Any]] = {table: [] for table in tables}
    chosen: dict[str, list[str]] = {}
    seen: set[str] = set()
    for stem in stems:
        piece = _read(folder / commit / place / f"{stem}.parquet")
        keys = [key for key in piece["part_key"].to_pylist() if key not in seen]
        chosen[stem] = keys
        seen.update(keys)
        pieces[commit].append(_only(piece, keys))
    for table, stem in sides:
        pieces[table].append(_only(_read(folder / table / place / f"{stem}.parquet"), chosen[stem]))
    pyarrow, _ = need_pyarrow()
    joined = f"c-{hashlib.sha256(' '.join(stems).encode()).hexdigest()[:40]}"
    for table in sorted(tables, key=lambda name: name == commit):
        if pieces[table]:
            whole = pyarrow.concat_tables(pieces[table], promote_options="permissive")
            write_table(whole, folder / table / place / f"{joined}.parquet")
    for table in sorted(tables, key=lambda name: name != commit):
        for stem in stems:
            (folder / table / place / f"{stem}.parquet").unlink(missing_ok=True)


def _read(path: Path) -> Any:  # noqa: ANN401 - pyarrow has no types
    _, parquet = need_pyarrow()
    try:
        return parquet.ParquetFile(path).read()
    except FileNotFoundError:
        raise
    except (OSError, ValueError) as error:
        raise damage(path, error) from error


def _only(piece: Any, keys: list[str]) -> Any:  # noqa: ANN401 - pyarrow has no types
    """The rows of these parts."""
    wanted = set(keys)
    return piece.filter([key in wanted for key in piece["part_key"].to_pylist()])


def _sweep(folder: Path) -> None:
    """Remove what killed processes left long ago: partial files, and rows whose part never came."""
    oldest = time.time() - ABANDONED_S
    for path in folder.rglob(f".*{PARTIAL}"):
        _remove_old(path, oldest)
    for table in OF_PARTS:
        if table == COMMIT:
            continue
        for path in (folder / table).rglob("*.parquet"):
            if not (folder / COMMIT / path.relative_to(folder / table)).is_file():
                _remove_old(path, oldest)


def _remove_old(path: Path, oldest: float) -> None:
    with suppress(OSError):
        if path.stat().st_mtime < oldest:
            path.unlink()


def _count(folder: Path) -> int:
    return sum(1 for _ in folder.rglob("*.parquet"))
