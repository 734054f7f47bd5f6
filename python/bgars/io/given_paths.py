"""Whether the folders and files that a caller names are there."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from bgars.errors import FileFormatError

if TYPE_CHECKING:
    import os

__all__ = ["need_file", "need_folder", "need_path"]


def need_folder(path: str | os.PathLike[str]) -> Path:
    """Return the path of a folder; raise FileFormatError where there is none."""
    folder = Path(path)
    if not folder.is_dir():
        msg = f"{folder}: is not a folder" if folder.exists() else f"{folder}: no such folder"
        raise FileFormatError(msg)
    return folder


def need_file(path: str | os.PathLike[str] | None) -> None:
    """Raise FileFormatError where a file that is named is not there."""
    if path is not None and not Path(path).is_file():
        msg = f"{path}: is a folder, not a file" if Path(path).is_dir() else f"{path}: no such file"
        raise FileFormatError(msg)


def need_path(path: str | os.PathLike[str]) -> None:
    """Raise FileFormatError where there is neither a file nor a folder."""
    if not Path(path).exists():
        msg = f"{path}: no such file or folder"
        raise FileFormatError(msg)
