"""Records that hold arrays show what they hold in one line, not the numbers."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["Short", "facts_table"]

LONGEST = 40
"""Characters of a single value."""


def facts_table(title: str, facts: Mapping[str, object]) -> str:
    """Return facts as a table in HTML, for notebooks."""
    left = "style='text-align:left'"
    rows = "".join(
        f"<tr><th {left}>{escape(name)}</th><td {left}>{escape(str(fact))}</td></tr>" for name, fact in facts.items()
    )
    return f"<table><caption><b>{escape(title)}</b></caption>{rows}</table>"


class Short:
    """A dataclass (with ``repr=False``) whose repr has sizes for arrays and lists, and names for records."""

    def _facts(self) -> dict[str, object]:
        record: Any = self
        values = {entry.name: getattr(self, entry.name) for entry in fields(record)}
        return {name: _short(value) for name, value in values.items() if value is not None}

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{name}={fact}' for name, fact in self._facts().items())})"


def _short(value: Any) -> str:  # noqa: ANN401 - a field of a record
    if isinstance(value, np.ndarray):
        return f"{value.shape} {value.dtype}"
    if isinstance(value, float):
        return f"{value:.4g}"
    if is_dataclass(value):
        return f"{type(value).__name__}(...)"
    told = repr(value)
    if len(told) <= LONGEST:
        return told
    if isinstance(value, list | tuple | dict):
        return f"{len(value)} {'entry' if len(value) == 1 else 'entries'}"
    return f"{told[: LONGEST - 3]}..."
