"""Image names in a list, a ``.lp`` file or a recipe, found where the files lie now."""

from __future__ import annotations

import os
import posixpath
import unicodedata
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import unquote

from bgars.errors import FileFormatError
from bgars.files.safe_files import shown
from bgars.io.image_formats import IMAGE_SUFFIXES

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

__all__ = ["find_named_images"]

RTI_FOLDERS = ("jpeg-exports", "original-captures", "cropped-files", "images")
"""Where RTIBuilder and others keep the images, seen from the folder of the ``.lp`` file, and beside it."""


def find_named_images(
    folder: Path, names: Sequence[str], source: Path | None, subfolders: Sequence[str] = ()
) -> tuple[list[str], list[str]]:
    """Return where the named images lie, relative to `folder`, and what had to be assumed for it.

    As written first; then by the last part of their paths beside the capture, beside the file that names them, and in
    the folders of an RTI project; then whatever their case; then by a stem that is unique (``img_01.CR2`` is developed
    to ``img_01.png``).

    Raises
    ------
    FileFormatError
        An image is nowhere, or a name fits several.
    """
    if not any(_is_absolute(name) for name in names):
        for written in (list(names), [name.replace("\\", "/") for name in names]):
            if all(_is_file(folder / name) for name in written):
                return [posixpath.normpath(name) for name in written], []
    bases = [_base_name(name) for name in names]
    best: tuple[int, str] = (-1, "")
    parents = {name.replace("\\", "/").rpartition("/")[0].rpartition("/")[2] for name in names}
    for place in _places(folder, source, subfolders, parents.pop() if len(parents) == 1 else ""):
        files = _image_files(place)
        for rule, find in RULES.items():
            found, missing = find(bases, files)
            if not missing and len(set(found)) == len(found):
                return _told(folder, place, names, found, rule, source)
            best = max(best, (len(names) - len(missing), names[bases.index(missing[0])] if missing else names[0]))
    if all(_is_absolute(name) and _is_file(Path(name)) for name in names):
        return list(names), [f"images taken from {Path(names[0]).parent}, as the file says"]
    count, first = best
    where = "" if source is None else f"{source.name} names it; "
    listing = f"{where}{max(count, 0)} of {len(names)} named images found in {folder}"
    if count <= 0 and source is not None and not any(Path(name).suffix.lower() in IMAGE_SUFFIXES for name in bases):
        listing += "; if these are not files, remove them: lights are then assigned to images in their order"
    msg = f"{shown(folder / _base_name(first))}: no such image file ({listing})"
    raise FileFormatError(msg)


def _told(
    folder: Path, place: Path, names: Sequence[str], found: list[str], rule: str, source: Path | None
) -> tuple[list[str], list[str]]:
    """Bring the found names to the folder of the capture, and say how they were found."""
    relative = [_relative(folder, place / name) for name in found]
    notes = []
    where = "" if source is None else f"{source.name}: "
    example = f"such as {shown(names[0])} as {shown(relative[0])}"
    if rule or any(Path(name).name != new for name, new in zip(names, found, strict=True)):
        how = rule or "by the last part of their paths"
        notes.append(f"{where}images found {how}, {example}")
    elif place != folder:
        notes.append(f"{where}images found in {_relative(folder, place)}")
    elif any(_is_absolute(name) or "/" in name for name in names):
        notes.append(f"{where}images found by the last part of their paths, {example}")
    return relative, notes


def _places(folder: Path, source: Path | None, subfolders: Sequence[str], named: str) -> list[Path]:
    bases = [folder] if source is None or source.parent == folder else [folder, source.parent, source.parent.parent]
    candidates = [*bases, *(base / name for base in bases for name in RTI_FOLDERS)]
    if source is not None and source.parent.name.lower() in ("assembly-files", "finished-files"):
        candidates += [source.parent.parent / name for name in RTI_FOLDERS]
    if folder.name.lower() in ("assembly-files", "finished-files"):
        candidates += [folder.parent / name for name in RTI_FOLDERS]
    candidates += [folder / name for name in subfolders]
    places = [place for place in dict.fromkeys(candidates) if place.is_dir()]
    # The folder that the file names comes first: cropped images lie beside whole ones of the same names.
    return sorted(places, key=lambda place: place.name.lower() != named.lower())


def _image_files(place: Path) -> list[str]:
    try:
        return [path.name for path in place.iterdir() if not path.name.startswith(".") and path.is_file()]
    except OSError:
        return []


def _as_written(bases: list[str], files: list[str]) -> tuple[list[str], list[str]]:
    known = set(files)
    return [name for name in bases if name in known], [name for name in bases if name not in known]


def _any_form(bases: list[str], files: list[str]) -> tuple[list[str], list[str]]:
    """Letters with accents may be one character or two: macOS writes two, others one (Unicode forms NFD and NFC)."""
    return _by_key(bases, files, lambda name: unicodedata.normalize("NFC", name))


def _any_case(bases: list[str], files: list[str]) -> tuple[list[str], list[str]]:
    return _by_key(bases, files, lambda name: unicodedata.normalize("NFC", name).lower())


def _by_stem(bases: list[str], files: list[str]) -> tuple[list[str], list[str]]:
    images = [name for name in files if Path(name).suffix.lower() in IMAGE_SUFFIXES]
    return _by_key(bases, images, lambda name: unicodedata.normalize("NFC", _stem(name)).lower())


RULES = {
    "": _as_written,
    "by letters with accents written another way": _any_form,
    "ignoring the case of letters": _any_case,
    "by stem": _by_stem,
}
"""How names are looked for in a folder, in this order, each in the words of a note."""


def _by_key(bases: list[str], files: list[str], key: Callable[[str], str]) -> tuple[list[str], list[str]]:
    groups: dict[str, list[str]] = {}
    for name in files:
        groups.setdefault(key(name), []).append(name)
    found, missing = [], []
    for name in bases:
        fitting = groups.get(key(name), [])
        if len(fitting) == 1:
            found.append(fitting[0])
        else:
            missing.append(name)
    return found, missing


def _stem(name: str) -> str:
    """Name without the ending of a file; a number after the last dot is part of the name (``buddha.0``)."""
    stem, dot, ending = name.rpartition(".")
    return stem if dot and stem and not ending.isdecimal() else name


def _base_name(name: str) -> str:
    name = unquote(name) if name.startswith("file:") else name
    return name.replace("\\", "/").rstrip("/").rpartition("/")[2]


def _is_absolute(name: str) -> bool:
    drive = len(name) > 2 and name[0].isalpha() and name[1] == ":" and name[2] in "\\/"  # noqa: PLR2004 - C:\
    return drive or name.startswith(("/", "\\", "file:"))


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def _relative(folder: Path, path: Path) -> str:
    try:
        return path.relative_to(folder).as_posix()
    except ValueError:  # walks up only from Python 3.12 on
        return Path(os.path.relpath(path, folder)).as_posix()
