"""Outputs appear whole or not at all."""

from __future__ import annotations

import os
import shutil
import tempfile
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from bgars.errors import FileFormatError

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["FolderNames", "atomic_file", "atomic_folder"]


class FolderNames(NamedTuple):
    """Files that a command leaves in its folder of results.

    Attributes
    ----------
    written : frozenset of str
        Every name that some run of the command may write.
    marks : frozenset of str
        Those that nothing else writes: where one lies, an earlier run was there.
    judged : bool
        They hold a verdict: a run that fails must not leave that of an earlier part.
    """

    written: frozenset[str]
    marks: frozenset[str]
    judged: bool = True


@contextmanager
def _write_errors(path: Path) -> Iterator[None]:
    """Turn what the system says into one message that names the output."""
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

    Raises
    ------
    FileFormatError
        The folder is missing or not writable.
    """
    path = Path(path)
    if path.is_dir():
        msg = f"{path}: cannot be written (it is a folder)"
        raise FileFormatError(msg)
    temporary = path.with_name(f".{path.stem}.{os.getpid()}.partial{path.suffix}")
    with _write_errors(path):
        temporary.touch()
        try:
            yield temporary
            temporary.replace(path)
        finally:
            temporary.unlink(missing_ok=True)


@contextmanager
def atomic_folder(folder: str | os.PathLike[str], names: FolderNames | None = None) -> Iterator[Path]:
    """Yield a temporary folder; when the block succeeds, move its files into `folder`.

    Files of the same name are replaced.

    Other files of an existing `folder` stay. The folder is tried before the block runs, so that long work is not lost.
    With `names`, what an earlier run left is removed: before the block runs where it holds a verdict, else when the new
    files move in. A folder holds one run or none.

    Raises
    ------
    FileFormatError
        `folder` cannot be made or written.
    """
    folder = Path(folder)
    if folder.exists() and not folder.is_dir():
        msg = f"{folder}: cannot be written (it is a file, not a folder)"
        raise FileFormatError(msg)
    parent = folder if folder.is_dir() else folder.absolute().parent
    made = [place for place in (parent, *parent.parents) if not place.exists()]
    with _write_errors(folder):
        parent.mkdir(parents=True, exist_ok=True)
        temporary = Path(tempfile.mkdtemp(prefix=".bgars-partial-", dir=parent))
        try:
            if names is not None and names.judged:
                _remove_earlier(folder, names)
            yield temporary
            folder.mkdir(exist_ok=True)
            if names is not None and not names.judged:
                _remove_earlier(folder, names)
            for path in sorted(temporary.iterdir()):
                path.replace(folder / path.name)
        except BaseException:
            shutil.rmtree(temporary, ignore_errors=True)
            for place in made:
                with suppress(OSError):
                    place.rmdir()
            raise
        temporary.rmdir()


def _remove_earlier(folder: Path, names: FolderNames) -> None:
    """Remove the files of an earlier run; without a mark of one, files of these names are somebody else's."""
    if not any((folder / name).is_file() for name in names.marks):
        return
    # Marks go last: what an interrupted removal leaves is still known as a run's.
    for name in sorted(names.written, key=lambda name: (name in names.marks, name)):
        if (folder / name).is_file():
            (folder / name).unlink()
