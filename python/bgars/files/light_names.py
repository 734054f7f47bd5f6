"""How a light, or its image, is called wherever a person reads of it.

Lights count from 0, as the files light_00.png, light_01.png do and as every array does; the file beside the number,
or the words, say so.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

__all__ = ["light_name", "named_lights", "numbered"]

NAMED = re.compile(r"\b(?:lights?|images?|and|,) (\d+) \(")

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


def named_lights(text: str) -> tuple[int, ...]:
    """Numbers of the lights that a message names, as :func:`light_name` and :func:`numbered` write them.

    Examples
    --------
    >>> named_lights("images 2 (light_02.png) and 5 (light_05.png) are swapped"), named_lights("2 balls missing: A1")
    ((2, 5), ())
    """
    return tuple(int(number) for number in NAMED.findall(text))
