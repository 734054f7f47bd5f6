"""The overview of one strip: a page and a table with a row per part."""

from __future__ import annotations

import csv
import io
import math
import re
from typing import TYPE_CHECKING, Any, NamedTuple

from bgars.io.atomic import atomic_file
from bgars.version import __version__

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from pathlib import Path

    from bgars.records.part_result import PartResult
    from bgars.records.strip_layout import StripLayout

__all__ = ["COLUMNS", "PlaceRow", "place_row", "strip_cells", "strip_csv", "write_strip_page"]

COLUMNS = (
    "place",
    "serial",
    "verdict",
    "reason",
    "balls",
    "seating_coplanarity_um",
    "u_seating_coplanarity_um",
    "mean_top_um",
    "mean_diameter_um",
    "inspected_utc",
)
PLACE = re.compile(r"R([1-9]\d{0,3})C([1-9]\d{0,3})")


class PlaceRow(NamedTuple):
    """A part of a strip in its overview; None: not measured."""

    place: str
    serial: str
    verdict: str
    reason: str
    balls: int
    seating_coplanarity_um: float | None
    u_seating_coplanarity_um: float | None
    mean_top_um: float | None
    mean_diameter_um: float | None
    inspected_utc: str
    page: str = ""


def place_row(result: PartResult, page: str = "") -> PlaceRow:
    """Return the row of a part."""
    return PlaceRow(
        result.identity.position,
        result.serial,
        result.verdict,
        result.reasons[0] if result.reasons else "",
        len(result.balls),
        _known(result.seating_coplanarity_um),
        _known(result.u_seating_coplanarity_um),
        _mean([ball.top_um for ball in result.balls]),
        _mean([ball.diameter_um for ball in result.balls]),
        result.inspected_utc,
        page,
    )


def strip_csv(strip: str, rows: Sequence[PlaceRow]) -> str:
    """Return the table as CSV text; empty cells where something was not measured."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("strip", *COLUMNS))
    for row in rows:
        values = row._asdict()
        cells = ["" if values[name] is None else values[name] for name in COLUMNS]
        writer.writerow([_safe(cell) for cell in (strip, *cells)])
    return text.getvalue()


def write_strip_page(
    page: Path, title: str, facts: Iterable[str], strip: StripLayout, rows: Sequence[PlaceRow]
) -> None:
    """Write the overview page of a strip; places link to the pages that the rows name.

    Raises
    ------
    FileFormatError
        It cannot be written.
    """
    counts = {name: sum(row.verdict == name for row in rows) for name in ("pass", "fail", "undecided", "error")}
    told = {row.place: {"style": row.verdict, "words": row.verdict, "link": row.page} for row in rows}
    text = template("strip.html.j2").render(
        title=title,
        facts=[fact for fact in facts if fact],
        counts=counts,
        total=len(rows),
        cells=strip_cells(told, strip.rows, strip.cols),
        rows=[row._asdict() for row in rows],
        version=__version__,
    )
    with atomic_file(page) as temporary:
        temporary.write_text(text, encoding="utf-8")


def strip_cells(told: Mapping[str, dict[str, Any]], rows: int = 0, cols: int = 0) -> list[list[dict[str, Any]]]:
    """Return the rows of cells of a strip, from what is told of each place; others are without a part.

    Examples
    --------
    >>> strip_cells({"R1C2": {"style": "pass", "words": "pass", "link": ""}})[0][0]["words"]
    'no part'
    """
    matches = [match for name in told if (match := PLACE.fullmatch(name))]
    rows = max([rows, *(int(match[1]) for match in matches)])
    cols = max([cols, *(int(match[2]) for match in matches)])
    none = {"style": "none", "words": "no part", "link": ""}
    return [
        [{"name": name} | told.get(name, none) for name in (f"R{row}C{col}" for col in range(1, cols + 1))]
        for row in range(1, rows + 1)
    ]


def template(name: str) -> Any:  # noqa: ANN401 - jinja's template
    """Return a template of the line's pages."""
    from jinja2 import Environment, PackageLoader, StrictUndefined  # noqa: PLC0415 - only where a page is written

    loader = PackageLoader("bgars.line", "template")
    environment = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True)
    return environment.get_template(name)


def _known(value: float) -> float | None:
    return round(value, 6) if math.isfinite(value) else None


def _mean(values: list[float]) -> float | None:
    known = [value for value in values if math.isfinite(value)]
    return round(sum(known) / len(known), 6) if known else None


def _safe(cell: object) -> object:
    """Text that a spreadsheet would run as a formula begins with an apostrophe."""
    return f"'{cell}" if isinstance(cell, str) and cell[:1] in {"=", "+", "-", "@"} else cell
