"""Which questions to a store only read: DuckDB may write into the folders that it may read."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from bgars.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["need_reading"]

READING = {"SELECT_NODE", "SET_OPERATION_NODE", "RECURSIVE_CTE_NODE", "CTE_NODE"}
"""Parts of a parsed SELECT; INSERT, DELETE and COPY, which WITH takes as well, have others."""
KNOWN_KINDS = {"MULTI": "PIVOT without IN, or several statements"}


def need_reading(connection: Any, sql: str) -> None:  # noqa: ANN401 - duckdb's connection
    """Raise InputError unless a text is one SELECT (also FROM, VALUES, DESCRIBE, SHOW) that writes nothing.

    EXPLAIN is refused, too: EXPLAIN ANALYZE does what it explains.
    """
    statements = connection.extract_statements(sql)
    kinds = [statement.type.name for statement in statements]
    if not kinds:
        told = repr(sql)
    elif len(kinds) > 1:
        told = f"{len(kinds)} statements"
    elif kinds != ["SELECT"]:
        told = KNOWN_KINDS.get(kinds[0], kinds[0])
    else:
        ((text,),) = connection.execute("SELECT json_serialize_sql(?::VARCHAR)", [statements[0].query]).fetchall()
        written = set(_nodes(json.loads(text))) - READING
        if not written:
            return
        told = " and ".join(sorted(name.split("_")[0] for name in written)) + " within it"
    msg = f"query: must be one SELECT that returns rows, such as 'select count(*) from parts', got {told}"
    raise InputError(msg)


def _nodes(value: Any) -> Iterator[str]:  # noqa: ANN401 - parsed JSON
    """The kinds of statement in a parsed question, however deep; one that was not understood is one, too."""
    if isinstance(value, list):
        for each in value:
            yield from _nodes(each)
    elif isinstance(value, dict):
        kind = value.get("type")
        if isinstance(kind, str) and kind.endswith("_NODE"):
            yield kind
        if value.get("error") is True:
            yield "UNKNOWN"
        for each in value.values():
            yield from _nodes(each)
