"""What a field of a record is in a file: the one description from which schema, reader and writer follow.

A field that ``result.json`` holds is written ``name: Annotated[type, Key("its meaning, in its unit")]``, and that is
all: the type says what form the value has (NaN becomes null, an array or a tuple a list, a record an object), the order
of the fields is that of the keys.
"""

from __future__ import annotations

import math
from dataclasses import MISSING, Field, dataclass, fields, is_dataclass
from functools import cache
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np

__all__ = ["DIGITS", "Key", "as_plain", "default_of", "keys_of", "old_names", "plain_value", "types_of"]

DIGITS = 6


@dataclass(frozen=True)
class Key:
    """What a file says about a field.

    Attributes
    ----------
    meaning : str
        In words, with the unit.
    ge, gt : float or None
        Least value of a number, allowed or not; a number with a least value is always known.
    pattern : str or None
        Regular expression of a text.
    shape : tuple of int or None
        Of an array; None = any number.
    names : tuple of str
        Names that a table may have; empty: any.
    is_exact : bool
        Whether numbers keep all digits.
    is_late : bool
        Whether files of earlier versions lack the key: they then mean the field's default.
    was : str
        Name that files of earlier versions have for it.
    """

    meaning: str
    ge: float | None = None
    gt: float | None = None
    pattern: str | None = None
    shape: tuple[int | None, ...] = ()
    names: tuple[str, ...] = ()
    is_exact: bool = False
    is_late: bool = False
    was: str = ""


@cache
def types_of(record: type) -> dict[str, Any]:
    """Types of a record's fields that files hold, in their order."""
    hints = get_type_hints(record, include_extras=True)
    return {name: hint.__origin__ for name, hint in hints.items() if _key(hint) is not None}


@cache
def keys_of(record: type) -> dict[str, Key]:
    """Keys of a record's fields that files hold, in their order.

    Examples
    --------
    >>> import bgars
    >>> keys_of(bgars.BallResult)["diameter_um"].meaning
    'horizontal diameter, in um'
    """
    hints = get_type_hints(record, include_extras=True)
    return {name: key for name, hint in hints.items() if (key := _key(hint)) is not None}


@cache
def old_names(record: type) -> dict[str, str]:
    """Names that earlier versions had for a record's fields, and what they are called now.

    Examples
    --------
    >>> import bgars
    >>> old_names(bgars.BallResult)["q"]
    'aspect_ratio'
    """
    return {key.was: name for name, key in keys_of(record).items() if key.was}


def _key(hint: Any) -> Key | None:  # noqa: ANN401 - a type
    return next((entry for entry in getattr(hint, "__metadata__", ()) if isinstance(entry, Key)), None)


def default_of(record: type, name: str) -> Any:  # noqa: ANN401 - a field of a record
    """The plain value of a field where nothing is given."""
    entry: Field[Any] = next(entry for entry in fields(record) if entry.name == name)
    return plain_value(entry.default if entry.default_factory is MISSING else entry.default_factory())


def as_plain(record: Any) -> dict[str, Any]:  # noqa: ANN401 - a record
    """Return a record as plain Python values by name: rounded, None for what is not known."""
    keys = keys_of(record.__class__)
    return {name: plain_value(getattr(record, name), None if key.is_exact else DIGITS) for name, key in keys.items()}


def plain_value(value: Any, digits: int | None = DIGITS) -> Any:  # noqa: ANN401 - a field of a record; a line a kind
    """Return a value as JSON has it: rounded, None for NaN, lists for tuples and arrays, tables for records."""
    if is_dataclass(value) or hasattr(value, "_fields"):
        return as_plain(value)
    if isinstance(value, np.ndarray):
        return plain_value(value.tolist(), digits)
    if isinstance(value, dict):
        return {key: plain_value(entry, digits) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [plain_value(entry, digits) for entry in value]
    if isinstance(value, float):
        return None if not math.isfinite(value) else value if digits is None else round(value, digits)
    return str(value) if isinstance(value, Path) else value
