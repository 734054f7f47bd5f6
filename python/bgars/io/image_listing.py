"""What lies in a capture folder, and what each image file is for."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from numpy.lib.format import open_memmap

from bgars.errors import FileFormatError
from bgars.files.safe_files import shown
from bgars.io.image_formats import IMAGE_FORMATS, IMAGE_SUFFIXES

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

__all__ = ["Listing", "choose_series", "list_folder", "natural_key", "role_of", "some_of"]

ROLES = {
    "mask": "a mask",
    "masks": "a mask",
    "dark": "a dark frame",
    "darkframe": "a dark frame",
    "ambient": "an image without the lights",
    "ambiant": "an image without the lights",
    "background": "an image without the lights",
    "off": "an image without the lights",
    "flat": "a flat field",
    "flatfield": "a flat field",
    "normal": "a normal map",
    "normals": "a normal map",
    "gt": "a truth",
    "albedo": "a result",
    "depth": "a result",
    "height": "a result",
    "confidence": "a result",
    "overview": "a result",
    "preview": "a preview",
    "thumb": "a preview",
    "thumbnail": "a preview",
}
"""Words in the names of files that are no image of one light; together they are ignored, and named."""
MAX_ENTRIES = 100_000
AXES = 3
SHOWN = 6


@dataclass(frozen=True)
class Listing:
    """Entries of a folder, by what they are for; names in natural order.

    Attributes
    ----------
    images : tuple of str
        Images that may be one of a light.
    masks : tuple of str
        Images whose names say that they are masks.
    special : tuple of str
        Images whose names say that they are something else.
    hidden : tuple of str
        Hidden files.
    others : tuple of str
        Other files.
    folders : tuple of str
        Folders that are not hidden.
    """

    images: tuple[str, ...]
    masks: tuple[str, ...]
    special: tuple[str, ...]
    hidden: tuple[str, ...]
    others: tuple[str, ...]
    folders: tuple[str, ...]

    def in_words(self, *, without_images: bool = False) -> str:
        """What is there, for a message about what is not."""
        parts = [
            f"{len(names)} {what.format(s='' if len(names) == 1 else 's')} ({some_of(names)})"
            for what, names in (
                ("image{s}", () if without_images else self.images),
                ("mask{s}", self.masks),
                ("image{s} of other use", self.special),
                ("hidden file{s}", self.hidden),
                ("file{s} other than images", self.others),
                ("folder{s}", self.folders),
            )
            if names
        ]
        return "; ".join(parts) or ("nothing else" if without_images else "nothing at all")


def natural_key(name: str) -> list[tuple[int, int | str]]:
    """Sort key that puts ``img2`` before ``img10``.

    Examples
    --------
    >>> sorted(["img10.png", "img2.png", "img1²2.png"], key=natural_key)
    ['img1²2.png', 'img2.png', 'img10.png']
    """
    parts = re.split(r"(\d+)", name, flags=re.ASCII)
    return [(0, int(part)) if part.isascii() and part.isdecimal() else (1, part.lower()) for part in parts if part]


def some_of(names: Sequence[str]) -> str:
    """The first of some names, with dots where there are more."""
    return ", ".join(shown(name) for name in names[:SHOWN]) + (", ..." if len(names) > SHOWN else "")


def role_of(name: str) -> str | None:
    """What the name of an image says that it is for; None for an image of one light.

    Examples
    --------
    >>> role_of("buddha.mask.tga"), role_of("Normal_gt.png"), role_of("darkpart_1.png")
    ('a mask', 'a normal map', None)
    """
    stem = name.rpartition(".")[0] or name
    words = re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", stem)
    return next((ROLES[word.lower()] for word in words if word.lower() in ROLES), None)


def list_folder(folder: Path) -> Listing:
    """Return what a folder holds.

    Raises
    ------
    FileFormatError
        The folder cannot be read, or holds more than 100,000 entries.
    """
    groups: dict[str, list[str]] = {key: [] for key in Listing.__dataclass_fields__}
    try:
        entries = sorted((entry.name for entry in folder.iterdir()), key=natural_key)
        for name in entries[:MAX_ENTRIES]:
            groups[_group(folder / name)].append(name)
    except OSError as error:
        msg = f"{folder}: cannot be read ({error.strerror})"
        raise FileFormatError(msg) from error
    if len(entries) > MAX_ENTRIES:
        msg = f"{folder}: holds {len(entries)} entries, more than a capture folder may ({MAX_ENTRIES})"
        raise FileFormatError(msg)
    return Listing(**{key: tuple(names) for key, names in groups.items()})


def _group(path: Path) -> str:
    name = path.name
    is_image = path.suffix.lower() in IMAGE_SUFFIXES
    if name.startswith((".", "~$", "__MACOSX")):
        return "hidden"
    if path.is_dir():
        return "folders"
    # By name only: a pipe, or a link to nowhere, called mask.png is refused when it is read, not passed over.
    if not is_image or _is_array_of_lights(path):
        return "others"
    role = role_of(name)
    return "images" if role is None else "masks" if role == "a mask" else "special"


def _is_array_of_lights(path: Path) -> bool:
    """True for a ``.npy`` whose name says that it holds lights, or whose shape that it holds vectors or numbers."""
    if path.suffix.lower() != ".npy":
        return False
    if re.search(r"light|led|dir|normal", path.stem, re.IGNORECASE) is not None:
        return True
    try:
        shape = open_memmap(path, mode="r").shape if path.is_file() else ()  # a pipe would wait
    except Exception:  # whatever damaged bytes make of the header: its reader will say what is wrong
        return False
    return len(shape) == 1 or (len(shape) == 2 and min(shape) <= AXES)  # noqa: PLR2004 - a picture is wider


def choose_series(names: Iterable[str], count: int) -> tuple[str, ...] | None:
    """Return the one numbered series of `count` images among some names, None where there is none or several.

    Names are of one series where they differ in numbers only. Of series that differ in their endings only, the one that
    keeps most of the light is taken (TIFF rather than raw, raw rather than JPEG).

    Examples
    --------
    >>> choose_series(["a_1.png", "a_2.png", "final.png"], 2)
    ('a_1.png', 'a_2.png')
    """
    series: dict[str, list[str]] = {}
    for name in names:
        series.setdefault(re.sub(r"\d+", "#", name, flags=re.ASCII).lower(), []).append(name)
    fitting = {pattern: group for pattern, group in series.items() if len(group) == count and "#" in pattern}
    if len({pattern.rpartition(".")[0] for pattern in fitting}) != 1:
        return None
    best = min(fitting, key=_loss)  # the same images, developed twice
    return tuple(sorted(fitting[best], key=natural_key))


def _loss(name: str) -> int:
    """What an image format loses: 0 nothing; 1 nothing, but it must be developed; 2 what the eye does not need."""
    suffix = "." + name.rpartition(".")[2]
    kind = next((kind for kind in IMAGE_FORMATS if suffix in kind.suffixes), None)
    return 0 if kind is None else 2 if kind.lossy else 1 if kind.decoder == "raw" else 0
