"""Whether the folders and files that a caller names are there."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from bgars.errors import FileFormatError, InputError
from bgars.files.safe_files import need_regular, shown

if TYPE_CHECKING:
    import os
    from collections.abc import Callable

__all__ = ["capture_marks", "need_file", "need_folder", "need_output", "need_path"]

CAPTURE_MARKS = {"capture.toml", "light_directions.txt", "filenames.txt"}
"""What a folder of photographs is known by, whatever its images are called; and by any file about lights."""


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


def capture_marks(folder: Path) -> list[str]:
    """Return the files that show a folder to hold a capture."""
    if not folder.is_dir():
        return []
    from bgars.io.light_discovery import is_about_lights  # noqa: PLC0415 - readers of every format of lights

    names = [found.name for found in folder.iterdir()]
    return sorted(
        name for name in names if name in CAPTURE_MARKS or name.lower().endswith(".lp") or is_about_lights(name)
    )


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
    if not _found(folder.is_dir, folder, "written"):
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


def _found(question: Callable[[], bool], path: Path, verb: str = "read") -> bool:
    """Answer a question about a path; an impossible name is a FileFormatError, not an accident."""
    try:
        return question()
    except (OSError, ValueError) as error:
        msg = f"{shown(path)}: cannot be {verb} ({getattr(error, 'strerror', None) or error})"
        raise FileFormatError(msg) from error
