"""Values as JSON has them: rounded, None for what was not measured."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

__all__ = ["DIGITS", "_plain"]

DIGITS = 6


def _plain(value: Any, digits: int) -> Any:  # noqa: ANN401 - a field of a record
    """Rounded numbers, None for NaN, lists for tuples and arrays."""
    if isinstance(value, np.ndarray):
        return _plain(value.tolist(), digits)
    if isinstance(value, dict):
        return {key: _plain(entry, digits) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(entry, digits) for entry in value]
    if isinstance(value, float):
        return round(value, digits) if math.isfinite(value) else None
    return value
