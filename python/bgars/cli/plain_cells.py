"""Answers of DuckDB as values that JSON, CSV and a table can hold."""

from __future__ import annotations

import datetime
import json
from decimal import Decimal
from typing import Any

__all__ = ["distinct_names", "plain", "text_of"]


def plain(value: Any) -> Any:  # noqa: ANN401, PLR0911 - whatever was asked for; a line a kind
    """Return a value as JSON has it: structs are objects, maps lists of pairs, bytes hexadecimal, times ISO 8601."""
    if isinstance(value, float):
        return value if value == value and abs(value) != float("inf") else None  # noqa: PLR0124 - NaN
    if isinstance(value, Decimal):
        return int(value) if value == int(value) and value.as_tuple().exponent == 0 else float(value)
    if isinstance(value, datetime.datetime):
        utc = value if value.tzinfo is None else value.astimezone(datetime.timezone.utc).replace(tzinfo=None)
        return utc.isoformat(timespec="seconds") + "Z"
    if isinstance(value, datetime.date | datetime.time):
        return value.isoformat()
    if isinstance(value, bytes):
        return value.hex()
    if isinstance(value, dict):
        return {str(name): plain(each) for name, each in value.items()}
    if hasattr(value, "months"):  # pyarrow's interval
        return f"P{value.months}M{value.days}DT{value.nanoseconds / 1e9:.9g}S"
    if isinstance(value, list | tuple):
        return [plain(each) for each in value]
    return value if isinstance(value, int | str | bool | None) else str(value)


def text_of(value: Any) -> str:  # noqa: ANN401 - a plain value
    """Return a plain value in one cell: lists joined by semicolons, objects as JSON."""
    if isinstance(value, list):
        return "; ".join(map(text_of, value))
    return json.dumps(value, ensure_ascii=False) if isinstance(value, dict) else str(value)


def distinct_names(names: list[str]) -> list[str]:
    """Return names of columns, each once, as an object needs them; DuckDB gives a second one a number, too.

    Examples
    --------
    >>> distinct_names(["serial", "serial", "n"])
    ['serial', 'serial_1', 'n']
    """
    found: list[str] = []
    for name in names:
        free, number = name, 1
        while free in found or (free != name and free in names):
            free, number = f"{name}_{number}", number + 1
        found.append(free)
    return found
