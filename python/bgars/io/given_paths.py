"""Whether the folders and files that a caller names are there."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from bgars.errors import FileFormatError, InputError

if TYPE_CHECKING:
    import os

__all__ = ["capture_marks", "need_file", "need_folder", "need_output", "need_path"]

CAPTURE_MARKS = ("capture.toml", "light_directions.txt", "filenames.txt", "*.lp")
"""What a folder of photographs is known by, whatever its images are called."""
SHOWN = 80
IMPOSSIBLE = (OSError, ValueError)
"""Of paths that no system takes: names of more than 255 bytes, NUL characters."""


def need_folder(path: str | os.PathLike[str]) -> Path:
    """Return the path of a folder; raise FileFormatError where there is none."""
    folder = Path(path)
    _check_name(folder)
    if not folder.is_dir():
        msg = f"{folder}: is not a folder" if folder.exists() else f"{folder}: no such folder"
        raise FileFormatError(msg)
    return folder


def need_file(path: str | os.PathLike[str] | None) -> None:
    """Raise FileFormatError where a file that is named is not there."""
    if path is None:
        return
    _check_name(Path(path))
    if not Path(path).is_file():
        msg = f"{path}: is a folder, not a file" if Path(path).is_dir() else f"{path}: no such file"
        raise FileFormatError(msg)


def need_path(path: str | os.PathLike[str]) -> None:
    """Raise FileFormatError where there is neither a file nor a folder."""
    _check_name(Path(path))
    if not Path(path).exists():
        msg = f"{path}: no such file or folder"
        raise FileFormatError(msg)


def capture_marks(folder: Path) -> list[str]:
    """Return the files that show a folder to hold a capture."""
    if not folder.is_dir():
        return []
    return sorted(found.name for mark in CAPTURE_MARKS for found in folder.glob(mark))


def need_output(output: str | os.PathLike[str], *inputs: str | os.PathLike[str]) -> None:
    """Raise InputError where results would come to lie among inputs: of this command, or of any.

    Parameters
    ----------
    output : path
        Folder for results; need not exist.
    inputs : paths
        Folders that the command reads.
    """
    folder = Path(output)
    _check_name(folder)
    if not folder.is_dir():
        return
    for given in inputs:
        if Path(given).is_dir() and folder.samefile(given):
            msg = (
                f"{folder}: is read by this command, and results never go among inputs; "
                f"name another folder, such as {folder / 'results'}"
            )
            raise InputError(msg)
    found = capture_marks(folder)
    if found:
        msg = (
            f"{folder}: holds a capture ({', '.join(found)}), and results never go among inputs; "
            f"name another folder, such as {folder / 'results'}"
        )
        raise InputError(msg)


def _check_name(path: Path) -> None:
    """Raise FileFormatError where no system can have such a path."""
    try:
        path.exists()
    except IMPOSSIBLE as error:
        name = str(path) if len(str(path)) <= SHOWN else f"{str(path)[:SHOWN]}..."
        reason = getattr(error, "strerror", None) or error
        msg = f"{name!r}: cannot be a path ({reason})"
        raise FileFormatError(msg) from None
