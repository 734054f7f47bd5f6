"""The overview of a lot: yield, defects and where they are, drift, the last parts."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bgars.errors import InputError
from bgars.io.atomic import atomic_file
from bgars.line.lot_charts import recipe_charts
from bgars.line.pages import page_name
from bgars.line.strip_page import template

if TYPE_CHECKING:
    from bgars.store import Store

__all__ = ["lot_facts", "pages_of", "shortened", "write_lot_page"]

LAST_PARTS = 100
MOST_BALLS = 2
NEWEST = "(serial = '' or row_number() over (partition by serial, recipe order by round desc, sequence desc) = 1)"
TITLES = {
    "missing": "ball missing",
    "bridged": "balls bridged",
    "extra": "extra ball",
    "true_position_um": "true position",
    "diameter_um": "diameter",
    "top_um": "height",
    "aspect_ratio": "aspect ratio",
    "flat_top_depth_um": "flat top",
    "other": "other",
    "seating_coplanarity_um": "seating coplanarity",
    "regression_coplanarity_um": "regression coplanarity",
    "warpage_um": "warpage",
    "pitch_um": "pitch",
}


def write_lot_page(store: Store, page: Path, *, lot: str | None = None) -> dict[str, Any]:
    """Write the overview page of a lot, or of all parts, and return its figures.

    Rows of parts whose pages lie beside it link to them.

    Raises
    ------
    InputError
        The store has no such parts.
    FileFormatError
        The page cannot be written.
    """
    facts = lot_facts(store, lot)
    for row in (*facts["last"], *facts["not_passed"]):
        name = row["page_name"]
        row["page"] = name if name and (page.parent / name).is_file() else ""
    text = template("lot.html.j2").render(facts=facts, store=store.folder.name, titles=TITLES)
    with atomic_file(page) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return facts


def pages_of(facts: dict[str, Any]) -> list[dict[str, Any]]:
    """The rows of the last parts that have a page each: with a serial number, as they were found last."""
    return [row for row in facts["last"] if row["page_name"] and row["is_last"]]


def lot_facts(store: Store, lot: str | None = None) -> dict[str, Any]:
    """Return what is on the page as plain values."""
    chosen = "true" if lot is None else f"lot = '{lot.replace(chr(39), chr(39) * 2)}'"
    # A part that came again after rework counts once, as it was found last.
    last_round = f"select * from parts where {chosen} qualify {NEWEST}"
    counts = _rows(store, f"select verdict, count(*) n from ({last_round}) group by verdict")
    by_verdict = {"pass": 0, "fail": 0, "undecided": 0} | {row["verdict"]: row["n"] for row in counts}
    total = sum(by_verdict.values())
    if not total:
        msg = f"{store.folder}: has no parts{'' if lot is None else f' of lot {lot!r}'}"
        raise InputError(msg)
    span = _rows(
        store,
        f"select min(inspected_utc) first, max(inspected_utc) until, list(distinct part) parts, "
        f"list(distinct version) versions from parts where {chosen}",
    )[0]
    return {
        "lot": lot,
        "total": total,
        "verdicts": by_verdict,
        "yield_percent": 1000 * by_verdict["pass"] // total / 10,  # 99.97 % is not 100.0 %
        "rework": _rows(
            store,
            "select round, count(*) n, floor(1000 * count(*) filter (verdict = 'pass') / count(*)) / 10 as percent "
            f"from parts where {chosen} group by round order by round",
        ),
        "defects": _rows(
            store,
            f"select defect, count(*) n from (select unnest(defects) as defect from parts where {chosen}) "
            "group by defect order by n desc, defect",
        ),
        "recipes": recipe_charts(store, chosen),
        "not_passed": _last(store, f"{chosen} qualify {NEWEST} and verdict <> 'pass'"),
        "last": _last(store, chosen),
        "failures": _rows(
            store,
            f"select serial, capture_folder, reason from failures where {chosen} "
            f"order by sequence desc limit {LAST_PARTS}",
        ),
        "failures_total": _rows(store, f"select count(*) n from failures where {chosen}")[0]["n"],
        "two_lots": _rows(
            store,
            "select serial, list_sort(list(distinct lot)) lots from parts where serial <> '' and lot <> '' "
            f"and serial in (select serial from parts where {chosen}) group by serial, recipe "
            f"having count(distinct lot) > 1 order by serial limit {LAST_PARTS}",
        ),
        **span,
    }


def _last(store: Store, chosen: str) -> list[dict[str, Any]]:
    """The last parts, each with the name of its own page: of its recipe and round, where there are several."""
    rows = _rows(
        store,
        "select serial, recipe, lot, round, inspected_utc, verdict, reason, seating_coplanarity_um, mean_top_um, "
        f"station, operator, is_last, is_several from (select *, {NEWEST} as is_last, "
        "min(recipe) over (partition by serial) <> max(recipe) over (partition by serial) as is_several from parts) "
        f"where {chosen} order by sequence desc limit {LAST_PARTS}",
    )
    for row in rows:
        number, recipe = None if row["is_last"] else row["round"], row["recipe"] if row["is_several"] else ""
        row["page_name"] = page_name(row["serial"], number, recipe) if row["serial"] else ""
        row["why"] = shortened(row["reason"])
    return rows


def shortened(reason: str) -> str:
    """Return a reason that names at most two balls, for a table.

    Examples
    --------
    >>> shortened("6 balls outside limits: A1 (low); A2 (low); A3 (low); A4 (low) and 2 more")
    '6 balls outside limits: A1 (low); A2 (low) and 4 more'
    """
    match = re.fullmatch(r"(\d+ balls [^;]*: .*?)(?: and (\d+) more)?", reason)
    balls = [] if match is None else match[1].split("; ")
    if match is None or len(balls) <= MOST_BALLS:
        return reason
    return f"{'; '.join(balls[:MOST_BALLS])} and {len(balls) - MOST_BALLS + int(match[2] or 0)} more"


def _rows(store: Store, sql: str) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = store.query(sql).to_pylist()
    return rows
