"""Read a ``result.json`` again, which `PartResult.to_json` wrote: everything is checked, nothing is guessed."""

from __future__ import annotations

import itertools
import json
import math
from pathlib import Path
from types import UnionType
from typing import TYPE_CHECKING, Any, Union, get_args, get_origin

import numpy as np

from bgars.errors import FileFormatError, InputError
from bgars.files.safe_files import read_bounded
from bgars.io.result_schema import Table, result_model
from bgars.io.strict_toml import checked
from bgars.records.keys import keys_of, types_of
from bgars.records.part_result import FORMAT, FORMAT_VERSION, OLDEST_VERSION, PartResult

if TYPE_CHECKING:
    from os import PathLike

__all__ = ["RESULT_NAME", "parse_result", "read_result"]

RESULT_NAME = "result.json"
MAX_BYTES = 64_000_000
READABLE_VERSIONS = range(OLDEST_VERSION, FORMAT_VERSION + 1)


def read_result(path: str | PathLike[str]) -> PartResult:
    """Read the result of an inspection.

    Parameters
    ----------
    path : path
        A ``result.json``, or the folder that ``bgars inspect`` wrote.

    Returns
    -------
    PartResult
        As it was, rounded as the file is; :meth:`bgars.PartResult.to_json` gives the same text again.

    Raises
    ------
    FileFormatError
        No such file, not a result of bgars, another version of the format, or a key that is missing, unknown or of
        the wrong kind; file, key, rule and value are named.
    """
    path = Path(path)
    if path.is_dir():
        path /= RESULT_NAME
        if not path.is_file():
            msg = f"{path.parent}: holds no {RESULT_NAME}: neither a folder that bgars inspect wrote nor a store"
            raise FileFormatError(msg)
    return parse_result(read_bounded(path, MAX_BYTES, "result"), path)


def parse_result(content: bytes, path: Path) -> PartResult:
    """Return the result that the content of a ``result.json`` describes; messages name `path`.

    Raises
    ------
    FileFormatError
        As :func:`read_result`.
    """
    values = _json(content, path)
    _check_format(path, values)
    try:
        table = checked(result_model(), values, path)
        _check_lights(path, table)
        result: PartResult = _built(PartResult, table)
    except FileFormatError:
        raise
    except InputError as error:  # from the check, which names the file, or from a layout, which cannot
        text = str(error)
        msg = text if text.startswith(str(path)) else f"{path}: recipe: {text}"
        raise FileFormatError(msg) from None
    return result


def _json(content: bytes, path: Path) -> Any:  # noqa: ANN401 - whatever the file holds
    def refuse(word: str) -> float:
        msg = f"holds {word}, which is no JSON; what was not measured is null"
        raise ValueError(msg)

    try:
        return json.loads(content.decode("utf-8"), parse_constant=refuse)
    except (ValueError, RecursionError) as error:
        msg = f"{path}: is not valid JSON: cut off, or not a result ({error})"
        raise FileFormatError(msg) from error


def _check_format(path: Path, values: object) -> None:
    if not isinstance(values, dict) or values.get("format") != FORMAT:
        got = f"format is {values.get('format')!r}" if isinstance(values, dict) else f"it is a {type(values).__name__}"
        msg = f'{path}: is not a result of bgars: it must be an object with "format": "{FORMAT}", but {got}'
        if isinstance(values, dict) and "seating_coplanarity_um" in values:
            msg += " (made before results had a format: inspect the capture again)"
        raise FileFormatError(msg)
    version = values.get("format_version")
    if version not in READABLE_VERSIONS or isinstance(version, bool):
        msg = (
            f"{path}: format_version: this bgars reads {OLDEST_VERSION} to {FORMAT_VERSION}, got {version!r} "
            f"(written by bgars {values.get('version')})"
        )
        raise FileFormatError(msg)


def _check_lights(path: Path, table: Any) -> None:  # noqa: ANN401 - a model made of PartResult
    if len(table.light_change_deg) != len(table.light_directions):
        msg = (
            f"{path}: light_change_deg: must have one number for each of the {len(table.light_directions)} "
            f"light_directions, got {len(table.light_change_deg)}"
        )
        raise FileFormatError(msg)


def _built(hint: Any, value: Any, shape: tuple[int | None, ...] = ()) -> Any:  # noqa: ANN401, PLR0911 - a line a kind
    """A checked value as its record takes it: NaN for a number that is null, tuples and arrays for lists."""
    kind, parts = get_origin(hint), get_args(hint)
    if hint is float:
        return math.nan if value is None else value
    if value is None:
        return None
    if kind is np.ndarray:
        return np.array(value, dtype=np.float64).reshape([-1 if size is None else size for size in shape])
    if kind in {Union, UnionType}:
        return _built(next(part for part in parts if part is not type(None)), value)
    if kind is tuple:
        kinds = itertools.repeat(parts[0]) if parts[-1] is Ellipsis else parts
        return tuple(_built(part, entry) for part, entry in zip(kinds, value, strict=False))
    if isinstance(value, Table):
        keys = keys_of(hint)
        values = {name: _built(kind, getattr(value, name), keys[name].shape) for name, kind in types_of(hint).items()}
        return hint(**values)
    return Path(value) if hint is Path else value
