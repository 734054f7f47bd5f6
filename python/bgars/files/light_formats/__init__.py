"""Files that describe lights, a module a dialect; :data:`LIGHT_FORMATS` is the list of them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from bgars.files.light_formats.arrays import read_mat_table, read_npy_table
from bgars.files.light_formats.json_tables import read_dome_table, read_json_table
from bgars.files.light_formats.luces import is_led_parameters, read_led_parameters
from bgars.files.light_formats.table import MAX_LIGHTS, LightTable
from bgars.files.light_formats.text import read_lp_table, read_text_table

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["LIGHT_FORMATS", "MAX_LIGHTS", "LightFormat", "LightTable", "read_light_file"]


class LightFormat(NamedTuple):
    """A way to write down lights.

    Attributes
    ----------
    name : str
        What it is called.
    suffixes : tuple of str
        Lower-case endings of its files.
    read : callable
        Its reader.
    recognises : callable or None
        Whether a file of that ending is of this format, where several formats share it.
    """

    name: str
    suffixes: tuple[str, ...]
    read: Callable[[Path], LightTable]
    recognises: Callable[[Path], bool] | None = None


LIGHT_FORMATS = (
    LightFormat("RTI light positions", (".lp",), read_lp_table),
    LightFormat("relight dome", (".dome",), read_dome_table),
    LightFormat("JSON (by image name, or Meshroom)", (".json",), read_json_table),
    LightFormat("NumPy array", (".npy",), read_npy_table),
    LightFormat("MATLAB matrix", (".mat",), read_mat_table),
    LightFormat("LUCES LED parameters", (".txt",), read_led_parameters, is_led_parameters),
    LightFormat("lines of x y z", (".txt", ".csv", ".tsv", ".dat"), read_text_table),
)
"""Formats in the order in which they are tried; a file of another ending is read as lines of x y z."""


def read_light_file(path: Path) -> LightTable:
    """Read the lights of a file, by its ending.

    Raises
    ------
    FileFormatError
        The file is missing or does not hold what its ending promises.
    """
    suffix = path.suffix.lower()
    for kind in LIGHT_FORMATS:
        if suffix in kind.suffixes and (kind.recognises is None or kind.recognises(path)):
            return kind.read(path)
    return read_text_table(path)
