"""The balls of a result as a Parquet table, for data lakes: one row per ball, units in the columns' metadata."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from bgars.errors import InputError
from bgars.io.atomic import atomic_file
from bgars.records.ball_result import BallResult
from bgars.records.keys import keys_of
from bgars.records.part_identity import PartIdentity
from bgars.records.part_result import FORMAT, FORMAT_VERSION, PartResult

if TYPE_CHECKING:
    from os import PathLike


__all__ = ["need_pyarrow", "write_parquet"]

PART_COLUMNS = ("name", "serial", "capture", "inspected_utc", "verdict", "version")
PREFIX = "part_"
LOT, ROUND = "part_lot", "part_round"
UNITS = {"_um": "um", "_deg": "deg"}
WHOLE = {"row", "col", "lights_used"}
TEXT = {"name", "verdict", "kind"}


def write_parquet(result: PartResult, path: str | PathLike[str]) -> None:
    """Write the balls as a Parquet file; many of them read as one table.

    Columns are those of ``balls.csv``, full digits, null = not measured, after eight of the part
    (``part_name``, ``part_serial``, ``part_capture``, ``part_inspected_utc``, ``part_verdict``, ``part_version``,
    ``part_lot``, ``part_round``). Each column's
    metadata holds its ``unit`` ("" for none) and ``description``; the table's, ``format`` and ``format_version``.

    Parameters
    ----------
    result : PartResult
    path : path

    Raises
    ------
    InputError
        pyarrow is not installed.
    FileFormatError
        The file cannot be written.
    """
    pyarrow, parquet = need_pyarrow()
    columns: list[tuple[str, str, list[Any]]] = []
    for name in PART_COLUMNS:
        about = keys_of(PartResult)[name].meaning
        columns.append((PREFIX + name, about, [getattr(result, name)] * len(result.balls)))
    columns.append((LOT, "lot or order of the part", [result.identity.lot] * len(result.balls)))
    about = keys_of(PartIdentity)["round"].meaning
    columns.append((ROUND, about, [result.identity.round] * len(result.balls)))
    for name, key in keys_of(BallResult).items():
        if name != "budget":
            columns.append((name, key.meaning, [_cell(getattr(ball, name)) for ball in result.balls]))
    schema = pyarrow.schema(
        [
            pyarrow.field(name, _type(pyarrow, name), metadata={"unit": _unit(name), "description": about})
            for name, about, _ in columns
        ],
        metadata={"format": f"{FORMAT}-balls", "format_version": str(FORMAT_VERSION)},
    )
    table = pyarrow.table({name: values for name, _, values in columns}, schema=schema)
    with atomic_file(path) as temporary:
        parquet.write_table(table, temporary)


def need_pyarrow(extra: str = "parquet") -> tuple[Any, Any]:
    """Return pyarrow and its Parquet module, or say how to get them: by the extra that holds what else is needed."""
    try:
        import pyarrow  # noqa: PLC0415 - an extra
        from pyarrow import parquet  # noqa: PLC0415
    except ImportError:
        msg = f"{extra}: needs pyarrow, which is not installed; install it with: pip install 'bgars[{extra}]'"
        raise InputError(msg) from None
    return pyarrow, parquet


def _cell(value: Any) -> Any:  # noqa: ANN401 - a field of a record
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _type(pyarrow: Any, name: str) -> Any:  # noqa: ANN401 - pyarrow has no types
    if name in WHOLE or name == ROUND:
        return pyarrow.int32()
    if name.startswith(PREFIX) or name in TEXT:
        return pyarrow.string()
    if name == "present":
        return pyarrow.bool_()
    return pyarrow.list_(pyarrow.string()) if name == "reasons" else pyarrow.float64()


def _unit(name: str) -> str:
    return next((unit for end, unit in UNITS.items() if name.endswith(end)), "")
