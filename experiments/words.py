"""Sentences and tables from measured numbers, so that no number on the page is typed by hand."""

from __future__ import annotations

from typing import TYPE_CHECKING

from experiments.measure import FILTER, NAIVE

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from experiments.measure import Measurement
    from experiments.outcome import Row

__all__ = [
    "change",
    "listed",
    "markdown_table",
    "method_table",
    "of_method",
    "ranges",
    "row_table",
    "span",
    "split_by_gain",
]


def listed(values: Iterable[float | str]) -> str:
    """``"1, 2 and 3"``.

    Examples
    --------
    >>> listed([0.01, 0.5, 1.0])
    '0.01, 0.5 and 1'
    """
    words = [value if isinstance(value, str) else f"{value:g}" for value in values]
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


def ranges(values: Sequence[float], of: Sequence[float]) -> str:
    """Values in words, neighbours in the sequence `of` joined.

    Examples
    --------
    >>> ranges([3.0, 5.0, 6.0, 7.0], [3.0, 4.0, 5.0, 6.0, 7.0])
    '3 and 5 to 7'
    """
    groups: list[list[float]] = []
    for value in values:
        if groups and of.index(value) == of.index(groups[-1][-1]) + 1:
            groups[-1].append(value)
        else:
            groups.append([value])
    return listed(f"{group[0]:g} to {group[-1]:g}" if len(group) > 1 else f"{group[0]:g}" for group in groups)


def span(values: Iterable[float], digits: int = 1) -> str:
    """``"4.3 to 17.7"``, or one number when both ends read the same.

    Examples
    --------
    >>> span([3.0, 1.04, 2.0])
    '1.0 to 3.0'
    """
    numbers = list(values)
    low, high = f"{min(numbers):.{digits}f}", f"{max(numbers):.{digits}f}"
    return low if low == high else f"{low} to {high}"


def of_method(measurements: Sequence[Measurement], method: str) -> list[Measurement]:
    """Those of one method, in their order."""
    return [measurement for measurement in measurements if measurement.method == method]


def split_by_gain(
    measurements: Sequence[Measurement], value: Callable[[Measurement], float], error: str = "mean_deg_nz03"
) -> tuple[list[float], list[float]]:
    """The values at which the specular filter has a smaller error than least squares, and the others."""
    pairs = zip(of_method(measurements, NAIVE), of_method(measurements, FILTER), strict=True)
    better: list[float] = []
    worse: list[float] = []
    for naive, filtered in pairs:
        (better if getattr(filtered, error) < getattr(naive, error) else worse).append(value(naive))
    return better, worse


def change(measurements: Sequence[Measurement], value: Callable[[Measurement], float], at: Sequence[float]) -> str:
    """``"0.05 (17.7 → 12.3 deg), ..."``: mean error of least squares, then of the filter."""
    naive = {value(one): one.mean_deg_nz03 for one in of_method(measurements, NAIVE)}
    filtered = {value(one): one.mean_deg_nz03 for one in of_method(measurements, FILTER)}
    return listed(f"{x:g} ({naive[x]:.1f} → {filtered[x]:.1f} deg)" for x in at)


def markdown_table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Lines of a Markdown table; the first column to the left, numbers to the right."""
    lines = [f"| {' | '.join(header)} |", f"| --- |{' ---: |' * (len(header) - 1)}"]
    return lines + [f"| {' | '.join(row)} |" for row in rows]


def row_table(columns: Mapping[str, str], rows: Iterable[Row]) -> list[str]:
    """Lines of a Markdown table: heading to format, applied to each row.

    Examples
    --------
    >>> row_table({"light": "{light}", "grey level": "{grey:.1f}"}, [{"light": 1, "grey": 20.04}])[2]
    '| 1 | 20.0 |'
    """
    return markdown_table(list(columns), ([shown.format(**row) for shown in columns.values()] for row in rows))


def method_table(
    name: str, measurements: Sequence[Measurement], value: Callable[[Measurement], float], shown: str = "{:g}"
) -> list[str]:
    """A row a value; for each method the mean error (n_z > 0.3, deg) and the height RMSE (px)."""
    methods = list(dict.fromkeys(one.method for one in measurements))
    header = [name] + [column for method in methods for column in (f"{method} (deg)", "height (px)")]
    rows: dict[float, list[str]] = {}
    for one in measurements:
        cells = rows.setdefault(value(one), [shown.format(value(one))])
        cells += [f"{one.mean_deg_nz03:.2f}", f"{one.height_rmse_px:.2f}"]
    return markdown_table(header, rows.values())
