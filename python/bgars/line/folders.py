"""Which capture folders somebody means."""

from __future__ import annotations

import glob
import os
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from bgars.errors import FileFormatError, InputError
from bgars.io.recipe import RECIPE_NAME
from bgars.store.data_set import is_store

if TYPE_CHECKING:
    from os import PathLike

__all__ = ["IMAGES", "capture_folders"]

WILD = set("*?[")
NO_CAPTURE = (".", "_")
IMAGES = {".png", ".tif", ".tiff", ".jpg", ".jpeg", ".bmp", ".pgm", ".ppm", ".pnm"}


def capture_folders(given: str | PathLike[str] | Iterable[str | PathLike[str]]) -> list[Path]:
    """Return the capture folders that are meant, each once, in the order of what was given.

    A pattern stands for the folders that match, a folder of folders for those in it; stores are left out of both.

    Raises
    ------
    FileFormatError
        A folder is missing.
    InputError
        A pattern that matches nothing, or no folders at all.
    """
    found: dict[Path, Path] = {}
    for path in _paths(given):
        if path.is_dir():
            places = _captures_in(path)
        elif WILD & set(str(path)):
            matches = map(Path, sorted(glob.glob(str(path))))  # noqa: PTH207
            places = [match for match in matches if match.is_dir() and not is_store(match)]
            if not places:
                msg = f"{path}: no folder matches this pattern"
                raise InputError(msg)
        else:
            msg = f"{path}: is not a folder" if path.exists() else f"{path}: no such folder"
            raise FileFormatError(msg)
        for place in places:
            found.setdefault(place.resolve(), place)
    if not found:
        msg = "folders: must be at least one capture, got none"
        raise InputError(msg)
    return list(found.values())


def _paths(given: object) -> list[Path]:
    """One path, or several; a text is a path, and not its letters."""
    entries = list(given) if isinstance(given, Iterable) and not isinstance(given, str) else [given]
    paths = []
    for entry in entries:
        if not isinstance(entry, str | os.PathLike):
            msg = f"folders: must be paths, got {entry!r}"
            raise InputError(msg)
        paths.append(Path(entry))
    return paths


def _captures_in(folder: Path) -> list[Path]:
    """The folder itself, or, where it holds no images and no description, the folders in it but stores."""
    entries = sorted(folder.iterdir())
    if any(entry.name == RECIPE_NAME or entry.suffix.lower() in IMAGES for entry in entries):
        return [folder]
    places = [
        entry for entry in entries if entry.is_dir() and not entry.name.startswith(NO_CAPTURE) and not is_store(entry)
    ]
    return places or [folder]
