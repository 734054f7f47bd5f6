"""A file that a result was made from."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from bgars.records.keys import Key

__all__ = ["InputFile"]


class InputFile(NamedTuple):
    """A file that the result was made from."""

    name: Annotated[str, Key("file name without its folder")]
    sha256: Annotated[str, Key("SHA-256 of its bytes, in hexadecimal", pattern="^[0-9a-f]{64}$")]
