"""An inbox belongs to one process at a time."""

from __future__ import annotations

import sys
from contextlib import contextmanager
from typing import IO, TYPE_CHECKING

from bgars.errors import FileFormatError, InputError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

__all__ = ["watched"]

LOCK = ".bgars-watch.lock"


@contextmanager
def watched(folder: Path) -> Iterator[None]:
    """Hold an inbox for this process alone.

    Raises
    ------
    InputError
        Another process watches it.
    FileFormatError
        It is no folder that can be written.
    """
    if not folder.is_dir():
        msg = f"{folder}: is not a folder" if folder.exists() else f"{folder}: no such folder"
        raise FileFormatError(msg)
    try:
        lock = (folder / LOCK).open("a+b")
    except OSError as error:
        msg = f"{folder}: cannot be written ({error.strerror}); parts are moved out of it"
        raise FileFormatError(msg) from error
    with lock:
        if not _lock(lock):
            msg = f"{folder}: another bgars watch works on it"
            raise InputError(msg)
        yield


def _lock(file: IO[bytes]) -> bool:
    """Take the lock, which the system gives back however the process ends."""
    if sys.platform == "win32":
        import msvcrt  # noqa: PLC0415 - only there

        try:
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        return True
    import fcntl  # noqa: PLC0415 - not there

    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True
