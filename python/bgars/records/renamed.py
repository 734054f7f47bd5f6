"""Fields that had another name: the old one works for one release, with a DeprecationWarning."""

from __future__ import annotations

import functools
import warnings
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["renamed"]

Record = TypeVar("Record")


def renamed(**names: str) -> Callable[[type[Record]], type[Record]]:
    """Let a record's fields be read, and given, by their old names, ``@renamed(old="new")``; dir() leaves these out."""

    def decorate(record: type[Record]) -> type[Record]:
        made: Any = record.__init__

        @functools.wraps(made)
        def init(self: Record, *values: Any, **fields: Any) -> None:  # noqa: ANN401 - the fields of a record
            for old in names.keys() & fields.keys():
                fields[_told(record, old, names[old])] = fields.pop(old)
            made(self, *values, **fields)

        setattr(record, "__init__", init)  # noqa: B010 - a plain assignment mypy takes for a mistake
        for old, new in names.items():
            setattr(record, old, property(functools.partial(_read, record=record, old=old, new=new)))
        listed: Any = record.__dir__
        setattr(record, "__dir__", lambda self: [name for name in listed(self) if name not in names])  # noqa: B010 - same
        return record

    return decorate


def _read(self: object, *, record: type, old: str, new: str) -> Any:  # noqa: ANN401 - a field of a record
    return getattr(self, _told(record, old, new, level=3))


def _told(record: type, old: str, new: str, level: int = 3) -> str:
    """Say that the old name goes, and return the new one."""
    words = f"{record.__name__}.{old} is called {new} now; the next release removes the old name"
    warnings.warn(words, DeprecationWarning, stacklevel=level)
    return new
