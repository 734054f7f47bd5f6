"""Outputs appear whole or not at all, and never in the place of somebody's input."""

from __future__ import annotations

import os
import platform
import shutil
import time
import zlib
from contextlib import contextmanager, suppress
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from bgars.errors import FileFormatError
from bgars.files.safe_files import shown
from bgars.io.own_files import foreign_files, is_own, sign

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["PARTIAL_PREFIX", "FolderNames", "atomic_file", "atomic_folder"]

PARTIAL_PREFIX = ".bgars-partial-"
"""Of everything that is not whole yet; the process, its start, its machine and a number follow."""
FIELDS = 4
_numbers = count()
FORGOTTEN_S = 24 * 3600.0
"""Age from which what another machine left in a shared folder counts as left: its processes cannot be asked."""


class FolderNames(NamedTuple):
    """Files that a command leaves in its folder of results.

    Attributes
    ----------
    written : frozenset of str
        Every name that some run of the command may write.
    marks : frozenset of str
        Those that tell whose run it is; they are removed last.
    judged : bool
        They hold a verdict: a run that fails must not leave that of an earlier part.
    """

    written: frozenset[str]
    marks: frozenset[str]
    judged: bool = True


@contextmanager
def _write_errors(path: Path) -> Iterator[None]:
    """Turn what the system says into one message that names the output."""
    if "\0" in str(path):
        msg = f"{shown(path)}: cannot be written (a name cannot hold a null character)"
        raise FileFormatError(msg)
    try:
        yield
    except FileFormatError:
        raise
    except OSError as error:
        msg = f"{path}: cannot be written ({error.strerror or error})"
        raise FileFormatError(msg) from error


@contextmanager
def atomic_file(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary path beside `path` (same suffix); rename it to `path` when the block succeeds.

    What a killed run left beside it is removed.

    Raises
    ------
    FileFormatError
        The folder is missing or not writable.
    """
    path = Path(path)
    with _write_errors(path):
        if path.is_dir():
            msg = f"{path}: cannot be written (it is a folder)"
            raise FileFormatError(msg)
        _remove_leftovers(path.parent)
        temporary = path.with_name(f"{_partial_name()}{path.suffix}")
        temporary.touch()
        try:
            yield temporary
            temporary.replace(path)
        finally:
            temporary.unlink(missing_ok=True)


@contextmanager
def atomic_folder(folder: str | os.PathLike[str], names: FolderNames | None = None) -> Iterator[Path]:
    """Yield a temporary folder; when the block succeeds, move its files into `folder`.

    Other files of an existing `folder` stay. The folder is tried before the block runs, so that long work is not lost.
    With `names`, what an earlier run left is removed: before the block runs where it holds a verdict, else when the new
    files move in. A folder holds one run or none. An earlier run's files are known by what is in them: where another's
    file lies in the way, the run is refused before anything is touched. What a killed run left is removed.

    Raises
    ------
    FileFormatError
        `folder` cannot be made or written, or holds files of these names that bgars did not write.
    """
    folder = Path(folder)
    with _write_errors(folder):
        if folder.exists() and not folder.is_dir():
            msg = f"{folder}: cannot be written (it is a file, not a folder)"
            raise FileFormatError(msg)
        if names is not None:
            _refuse_foreign(folder, names)
        parent = folder if folder.is_dir() else folder.absolute().parent
        made = [place for place in (parent, *parent.parents) if not place.exists()]
        parent.mkdir(parents=True, exist_ok=True)
        _remove_leftovers(parent)
        temporary = parent / _partial_name()
        temporary.mkdir()
        try:
            if names is not None and names.judged:
                _remove_earlier(folder, names)
            yield temporary
            folder.mkdir(exist_ok=True)
            if names is not None:
                _refuse_foreign(folder, names)  # that came while the work was done
                _remove_earlier(folder, names)
            for path in sorted(temporary.iterdir(), key=lambda path: names is not None and path.name in names.marks):
                if names is not None and path.is_file():
                    sign(path)
                path.replace(folder / path.name)
        except BaseException:
            shutil.rmtree(temporary, ignore_errors=True)
            for place in made:
                with suppress(OSError):
                    place.rmdir()
            raise
        temporary.rmdir()


def _partial_name() -> str:
    """A name of this process alone: its number may belong to another one when it is looked at."""
    process = os.getpid()
    return f"{PARTIAL_PREFIX}{process}-{_started(process)}-{_machine()}-{next(_numbers)}"


def _machine() -> str:
    return str(zlib.crc32(platform.node().encode()))


def _started(process: int) -> str:
    """When a process began, in ticks since the machine did; 0 where the system does not say."""
    with suppress(OSError, IndexError):
        # The second field, a name in parentheses, may hold anything.
        return Path(f"/proc/{process}/stat").read_text(encoding="utf-8", errors="replace").rsplit(")", 1)[1].split()[19]
    return "0"


def _remove_leftovers(folder: Path) -> None:
    """Remove what killed runs left in a folder: partial files of processes that are gone, or that are a day old."""
    for path in folder.glob(f"{PARTIAL_PREFIX}*"):
        fields = path.name.removeprefix(PARTIAL_PREFIX).split(".")[0].split("-")
        if len(fields) != FIELDS or not all(field.isascii() and field.isdecimal() for field in fields):
            continue
        process, started, machine, _ = fields
        with suppress(OSError):
            is_old = time.time() - path.lstat().st_mtime > FORGOTTEN_S
            # Processes of another machine that shares the folder cannot be asked.
            if not is_old and (machine != _machine() or _is_alive(int(process), started)):
                continue
            if path.is_dir() and not path.is_symlink():
                shutil.rmtree(path, ignore_errors=True)
            else:
                path.unlink()


def _is_alive(process: int, started: str) -> bool:
    """Whether the process that a partial file names still runs here."""
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:
        return True  # somebody else's
    return started in {"0", _started(process)}


def _refuse_foreign(folder: Path, names: FolderNames) -> None:
    found = foreign_files(folder, names.written)
    if found:
        msg = (
            f"{folder}: holds {', '.join(found)}, which bgars did not write: nothing of it is overwritten; "
            "name another folder with -o, or move what is there"
        )
        raise FileFormatError(msg)


def _remove_earlier(folder: Path, names: FolderNames) -> None:
    """Remove the files of an earlier run, known by what is in them."""
    # Marks go last: what an interrupted removal leaves is still known as a run's.
    for name in sorted(names.written, key=lambda name: (name in names.marks, name)):
        if (folder / name).is_file() and is_own(folder / name):
            (folder / name).unlink()
