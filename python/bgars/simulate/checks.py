"""Rules that arguments obey; each refusal names the field, the rule and the value."""

from __future__ import annotations

import math
from numbers import Integral, Real
from typing import TYPE_CHECKING, cast

import numpy as np

from bgars.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterable

__all__ = ["at_least", "fraction", "number", "one_of", "positive", "require", "whole"]


def require(holds: bool, name: str, rule: str, value: object) -> None:
    """Raise :class:`bgars.InputError` "name: rule, got value" unless the rule holds."""
    if not holds:
        shown = f"{value:g}" if isinstance(value, float) else repr(value) if isinstance(value, str) else str(value)
        msg = f"{name}: {rule}, got {shown}"
        raise InputError(msg)


def number(name: str, value: float) -> None:
    """Refuse what is not a finite number."""
    is_number = isinstance(cast("object", value), Real)
    require(is_number and math.isfinite(value), name, "must be a finite number", value)


def whole(name: str, value: object, least: int, most: int | None = None) -> None:
    """Refuse what is not a whole number within limits."""
    rule = f"must be a whole number of {least} " + ("or more" if most is None else f"to {most}")
    is_whole = isinstance(value, Integral) and not isinstance(value, (bool, np.bool_))
    require(is_whole and least <= int(cast("int", value)) <= (math.inf if most is None else most), name, rule, value)


def positive(name: str, value: float) -> None:
    """Refuse what is not finite and above 0."""
    number(name, value)
    require(value > 0, name, "must be above 0", value)


def at_least(name: str, value: float, limit: float) -> None:
    """Refuse what is not finite and at least `limit`."""
    number(name, value)
    require(value >= limit, name, f"must be {limit:g} or more", value)


def fraction(name: str, value: float) -> None:
    """Refuse what is not in [0, 1]."""
    number(name, value)
    require(0 <= value <= 1, name, "must lie in [0, 1]", value)


def one_of(name: str, value: object, known: Iterable[object]) -> None:
    """Refuse what is not among the known values."""
    names = list(known)
    require(value in names, name, f"must be one of {', '.join(map(repr, names))}", value)
