"""How a light, or its image, is called wherever a person reads of it.

Lights count from 0, as the files light_00.png, light_01.png do and as every array does; the file beside the number,
or the words, say so.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

__all__ = ["light_name", "numbered"]

FROM_ZERO = "counted from 0"


def numbered(index: int, files: Sequence[str | Path] = ()) -> str:
    """Number of a light with its image file, or with the base of the count where there is no file.

    Examples
    --------
    >>> numbered(5, ["light_00.png"] * 5 + ["light_05.png"]), numbered(5)
    ('5 (light_05.png)', '5 (counted from 0)')
    """
    told = FROM_ZERO if index >= len(files) else str(getattr(files[index], "name", files[index]))
    return f"{index} ({told})"


def light_name(index: int, files: Sequence[str | Path] = (), *, what: str = "light") -> str:
    """Name of a light in a message; `what` is "image" where the picture is meant.

    Examples
    --------
    >>> light_name(3), light_name(0, ["light_00.png"], what="image")
    ('light 3 (counted from 0)', 'image 0 (light_00.png)')
    """
    return f"{what} {numbered(index, files)}"
