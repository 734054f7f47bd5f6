"""Whether the folders and files that a caller names are there."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from bgars.errors import FileFormatError
from bgars.safe_files import need_regular, shown

if TYPE_CHECKING:
    import os
    from collections.abc import Callable

__all__ = ["need_file", "need_folder", "need_path"]


def need_folder(path: str | os.PathLike[str]) -> Path:
    """Return the path of a folder; raise FileFormatError where there is none."""
    folder = Path(path)
    if not _found(folder.is_dir, folder):
        exists = _found(folder.exists, folder)
        msg = f"{shown(folder)}: is not a folder" if exists else f"{shown(folder)}: no such folder"
        raise FileFormatError(msg)
    return folder


def need_file(path: str | os.PathLike[str] | None) -> None:
    """Raise FileFormatError where a file that is named is not there, or is a pipe, a device or a folder."""
    if path is not None:
        need_regular(path)


def need_path(path: str | os.PathLike[str]) -> None:
    """Raise FileFormatError where there is neither a file nor a folder."""
    if not _found(Path(path).exists, Path(path)):
        msg = f"{shown(path)}: no such file or folder"
        raise FileFormatError(msg)


def _found(question: Callable[[], bool], path: Path) -> bool:
    """Answer a question about a path; an impossible name is a FileFormatError, not an accident."""
    try:
        return question()
    except (OSError, ValueError) as error:
        msg = f"{shown(path)}: cannot be read ({getattr(error, 'strerror', None) or error})"
        raise FileFormatError(msg) from error
