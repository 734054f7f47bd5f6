"""What makes a part known: the contents that its result follows from."""

from __future__ import annotations

import hashlib
import json
from itertools import islice, takewhile
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

    from bgars.records.part_result import PartResult

__all__ = ["failure_key", "images_key", "key_of", "part_key"]

NO_IMAGE = (".toml", ".txt", ".lp")
"""How the files end that follow the images in the list of what was read: the description, else names or lights."""


def part_key(result: PartResult) -> str:
    """Return the key of a result: the same inputs, serial, recipe, method and version give the same key.

    Where files lie and when they were inspected does not count.
    """
    digests = [digest for _, digest in result.files]
    return key_of(digests, serial=result.serial, method=result.method, version=result.version)


def key_of(digests: Iterable[str], *, serial: str, method: str, version: str) -> str:
    """Return the key of what is about to be inspected.

    Parameters
    ----------
    digests : iterable of str
        SHA-256 of the files that are read, those of the recipe too, in any order.
    serial, method, version : str

    Examples
    --------
    >>> key_of(["b", "a"], serial="S", method="m", version="1") == key_of(["a", "b"], serial="S", method="m",
    ...                                                                   version="1")
    True
    """
    told = json.dumps([sorted(digests), serial, method, version])
    return hashlib.sha256(told.encode()).hexdigest()


def images_key(files: Iterable[tuple[str, str]], lights: int) -> str:
    """Return the key of the images alone, whatever station, description, recipe, method or version goes with them.

    Parameters
    ----------
    files : iterable of (str, str)
        Name and SHA-256 of what was read: images come first, one a light (a stack of pages is one file).
    lights : int

    Returns
    -------
    str
        "" where no image was a file.

    Examples
    --------
    >>> one, other = ([("a.png", "1"), ("capture.toml", text)] for text in "23")
    >>> images_key(one, 4) == images_key(other, 4), images_key([], 4)
    (True, '')
    """
    images = islice(takewhile(lambda file: not file[0].lower().endswith(NO_IMAGE), files), lights)
    digests = sorted(digest for _, digest in images)
    return hashlib.sha256(json.dumps(digests).encode()).hexdigest() if digests else ""


def failure_key(folder: str, *, serial: str, recipe: str, version: str) -> str:
    """Return the key of a capture that could not be inspected, whose contents may be unreadable."""
    return hashlib.sha256(json.dumps([folder, serial, recipe, version]).encode()).hexdigest()
