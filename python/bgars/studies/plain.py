"""Records as plain values for JSON."""

from __future__ import annotations

import math
from dataclasses import fields, is_dataclass
from typing import Any

__all__ = ["plain"]

DIGITS = 6


def plain(value: Any) -> Any:  # noqa: ANN401 - a record, or a field of one
    """Rounded numbers, None for NaN, lists for tuples, objects for records.

    Examples
    --------
    >>> plain((1.23456789, float("nan"), "text"))
    [1.234568, None, 'text']
    """
    if is_dataclass(value):
        return {entry.name: plain(getattr(value, entry.name)) for entry in fields(value)}
    if isinstance(value, list | tuple):
        return [plain(each) for each in value]
    if isinstance(value, float):
        return round(float(value), DIGITS) if math.isfinite(value) else None
    return value
