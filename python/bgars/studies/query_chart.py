"""Control charts of whatever a store is asked."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from bgars.errors import InputError
from bgars.studies.control_chart import MIN_VALUES, ControlChart, individuals_chart
from bgars.studies.plain import plain

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bgars.store import Store

__all__ = ["QueryChart", "query_charts"]

LARGEST = 1e100  # the squares of larger numbers overflow


@dataclass(frozen=True, eq=False)
class QueryChart:
    """One column of an answer as an I-MR chart; figures take it like a trend.

    Attributes
    ----------
    characteristic, title, unit : str
        Name of the column, twice, and its unit.
    chart : ControlChart
    labels : tuple of str
        Of the rows that have a value.
    left_out : int
        Rows without one.
    """

    characteristic: str
    title: str
    unit: str
    chart: ControlChart
    labels: tuple[str, ...]
    left_out: int

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain Python values."""
        chart = vars(self.chart) | {"means": self.chart.means.tolist(), "spreads": self.chart.spreads.tolist()}
        values = {name: plain(value) for name, value in vars(self).items() if name != "chart"}
        return values | {"chart": {name: plain(value) for name, value in chart.items()}}


def query_charts(
    store: Store, sql: str, *, zone_rules: bool = False, nelson: Sequence[int] = ()
) -> tuple[QueryChart, ...]:
    """Return an I-MR chart of each number in the answer to a question, in the order of its rows.

    Other columns, such as a serial number or a time, label the rows.

    Raises
    ------
    InputError
        A question that DuckDB refuses or that has no ORDER BY, or an answer without numbers or with fewer than 3 rows.

    Examples
    --------
    ``query_charts(store, "select serial, warpage_um from parts order by sequence")``
    """
    rows = store.query(sql).to_pylist()
    if not re.search(r"\border\s+by\b", sql, re.IGNORECASE):
        # Moving ranges are of neighbours: without an order the database returns other ones each time.
        msg = f"query: must say in which order its rows are charted, such as ORDER BY sequence, got {sql!r}"
        raise InputError(msg)
    if len(rows) < MIN_VALUES:
        msg = f"query: must give at least {MIN_VALUES} rows to be charted, got {len(rows)}"
        raise InputError(msg)
    names = list(rows[0])
    numbers = [name for name in names if all(_is_number(row[name]) for row in rows)]
    words = [name for name in names if name not in numbers]
    charts = []
    for name in numbers:
        known = [row for row in rows if row[name] is not None and math.isfinite(row[name])]
        if len(known) < MIN_VALUES:
            continue
        values = np.array([float(row[name]) for row in known])
        worst = values[np.abs(values).argmax()]
        if abs(worst) > LARGEST:
            msg = f"query: {name}: must be within -{LARGEST:g} and {LARGEST:g} to be charted, got {worst:g}"
            raise InputError(msg)
        chart = individuals_chart(values, zone_rules=zone_rules, nelson=nelson)
        labels = tuple("\n".join(str(row[word])[:19] for word in words[:2]) for row in known)
        unit = "µm" if name.endswith("_um") else ""
        charts.append(QueryChart(name, name, unit, chart, labels, len(rows) - len(known)))
    if not charts:
        msg = f"query: must give a column of numbers to be charted, got {', '.join(names)}"
        raise InputError(msg)
    return tuple(charts)


def _is_number(value: object) -> bool:
    return value is None or (isinstance(value, int | float) and not isinstance(value, bool))
