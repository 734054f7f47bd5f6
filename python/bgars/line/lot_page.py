"""The overview of a lot: yield, defects and where they are, drift, the last parts."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bgars.errors import InputError
from bgars.io.atomic import atomic_file
from bgars.line.pages import page_name
from bgars.line.strip_page import PLACE, strip_cells, template

if TYPE_CHECKING:
    from bgars.store import Store

__all__ = ["lot_facts", "write_lot_page"]

LAST_PARTS = 100
DRIFT_PARTS = 300
DRIFTS = {
    "mean_top_um": "mean height of the balls",
    "mean_diameter_um": "mean diameter of the balls",
    "seating_coplanarity_um": "seating coplanarity",
    "warpage_um": "warpage",
}
WIDTH, HEIGHT, MARGIN, LEFT = 640.0, 150.0, 14.0, 70.0
"""Of a chart of drift; its numbers stand at the left."""
LETTERED_PX = 9.0
"""Least radius of a ball in the map that has room for its name."""
MAP_SIZE = 420.0
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
        name = page_name(row["serial"])
        row["page"] = name if (page.parent / name).is_file() else ""
    text = template("lot.html.j2").render(facts=facts, store=store.folder.name, titles=TITLES)
    with atomic_file(page) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return facts


def lot_facts(store: Store, lot: str | None = None) -> dict[str, Any]:
    """Return what is on the page as plain values."""
    chosen = "" if lot is None else f"where lot = '{lot.replace(chr(39), chr(39) * 2)}'"
    # A part that came again after rework counts once, as it was found last.
    last_round = (
        f"select * from parts {chosen} qualify serial = '' "
        "or row_number() over (partition by serial, recipe order by round desc, sequence desc) = 1"
    )
    counts = _rows(store, f"select verdict, count(*) n from ({last_round}) group by verdict")
    by_verdict = {"pass": 0, "fail": 0, "undecided": 0} | {row["verdict"]: row["n"] for row in counts}
    total = sum(by_verdict.values())
    if not total:
        msg = f"{store.folder}: has no parts{'' if lot is None else f' of lot {lot!r}'}"
        raise InputError(msg)
    defects = _rows(
        store,
        f"select defect, count(*) n from (select unnest(defects) as defect from parts {chosen}) "
        "group by defect order by n desc, defect",
    )
    names = ", ".join(DRIFTS)
    drift = _rows(
        store,
        f"select * from (select serial, inspected_utc, sequence, verdict, {names} from parts {chosen} "
        f"order by sequence desc limit {DRIFT_PARTS}) order by sequence",
    )
    last = _rows(
        store,
        "select serial, lot, round, inspected_utc, verdict, reason, seating_coplanarity_um, mean_top_um, "
        f"station, operator from parts {chosen} order by sequence desc limit {LAST_PARTS}",
    )
    span = _rows(
        store,
        f"select min(inspected_utc) first, max(inspected_utc) until, list(distinct part) parts, "
        f"list(distinct version) versions from parts {chosen}",
    )[0]
    return {
        "lot": lot,
        "total": total,
        "verdicts": by_verdict,
        "yield_percent": 100.0 * by_verdict["pass"] / total,
        "rework": _rows(
            store,
            "select round, count(*) n, 100.0 * count(*) filter (verdict = 'pass') / count(*) as percent "
            f"from parts {chosen} group by round order by round",
        ),
        "defects": defects,
        "places": _places(store, chosen),
        "strip": _strip(store, chosen),
        "not_passed": _rows(
            store,
            "select serial, lot, round, inspected_utc, verdict, reason "
            f"from ({last_round}) where verdict <> 'pass' order by sequence desc limit {LAST_PARTS}",
        ),
        "drifts": [chart for name, title in DRIFTS.items() if (chart := _drift(drift, name, title)) is not None],
        "last": last,
        "failures": _rows(store, f"select serial, capture_folder, reason from failures {chosen} limit {LAST_PARTS}"),
        "two_lots": _rows(
            store,
            "select serial, list_sort(list(distinct lot)) lots from parts where serial <> '' and lot <> '' "
            f"and serial in (select serial from parts {chosen}) group by serial, recipe "
            f"having count(distinct lot) > 1 order by serial limit {LAST_PARTS}",
        ),
        **span,
    }


def _rows(store: Store, sql: str) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = store.query(sql).to_pylist()
    return rows


def _places(store: Store, chosen: str) -> dict[str, Any] | None:
    """Where the balls are, in the part's own axes, and how often each fails, as circles of a picture."""
    rows = _rows(
        store,
        "select name, median(coalesce(x_nominal_um, x_um)) x, median(coalesce(y_nominal_um, y_um)) y, count(*) n, "
        f"count(*) filter (verdict = 'fail') failed from balls {chosen} group by name order by name",
    )
    rows = [row for row in rows if row["x"] is not None and row["y"] is not None]
    if not rows:
        return None
    xs, ys = [row["x"] for row in rows], [row["y"] for row in rows]
    span = max(max(xs) - min(xs), max(ys) - min(ys), 1.0)
    scale = (MAP_SIZE - 60.0) / span
    most = max(row["failed"] for row in rows)
    radius = max(3.0, min(16.0, 0.35 * (MAP_SIZE - 60.0) / max(math.sqrt(len(rows)) - 1.0, 1.0)))
    marks = [
        {
            "name": row["name"],
            "x": round(30.0 + (row["x"] - min(xs)) * scale, 1),
            "y": round(30.0 + (max(ys) - row["y"]) * scale, 1),
            "share": row["failed"] / most if most else 0.0,
            "failed": row["failed"],
            "words": f"{row['name']}: fails in {row['failed']} of {row['n']} parts",
        }
        for row in rows
    ]
    height = round(60.0 + (max(ys) - min(ys)) * scale, 1)
    return {
        "marks": marks,
        "radius": round(radius, 1),
        "most": most,
        "named": radius >= LETTERED_PX,
        "width": MAP_SIZE,
        "height": height,
    }


def _strip(store: Store, chosen: str) -> list[list[dict[str, Any]]]:
    """Share of parts that pass by their place on the strip, as cells; empty where parts come one by one."""
    rows = _rows(
        store,
        f"select position, count(*) n, count(*) filter (verdict = 'pass') passed from parts {chosen} group by position",
    )
    told = {
        row["position"]: {
            "style": "pass" if row["passed"] == row["n"] else "fail",
            "words": f"{100 * row['passed'] / row['n']:.0f} % of {row['n']}",
            "link": "",
        }
        for row in rows
        if PLACE.fullmatch(row["position"])
    }
    return strip_cells(told) if told else []


def _drift(rows: list[dict[str, Any]], name: str, title: str) -> dict[str, Any] | None:
    """A line of one reading over the parts, as points of a picture."""
    known = [(at, row[name]) for at, row in enumerate(rows) if row[name] is not None]
    if not known:
        return None
    values = [value for _, value in known]
    mean = sum(values) / len(values)
    low, high = min(values), max(values)
    span, steps = (high - low) or 1.0, max(len(rows) - 1, 1)
    points = [
        (
            round(LEFT + at / steps * (WIDTH - LEFT - MARGIN), 1),
            round(MARGIN + (high - value) / span * (HEIGHT - 2 * MARGIN), 1),
        )
        for at, value in known
    ]
    return {
        "title": title,
        "low": low,
        "high": high,
        "mean": mean,
        "mean_y": round(MARGIN + (high - mean) / span * (HEIGHT - 2 * MARGIN), 1),
        "points": [
            {"x": x, "y": y, "words": f"{rows[at]['serial']}: {value:.2f}", "verdict": rows[at]["verdict"]}
            for (x, y), (at, value) in zip(points, known, strict=True)
        ],
        "line": " ".join(f"{x},{y}" for x, y in points),
        "first": rows[0]["serial"],
        "last": rows[-1]["serial"],
        "width": WIDTH,
        "height": HEIGHT,
    }
