"""What the overview of a lot draws of each recipe: where balls and parts fail, and how readings drift."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from bgars.line.strip_page import PLACE, strip_cells

if TYPE_CHECKING:
    from bgars.store import Store

__all__ = ["recipe_charts"]

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


def recipe_charts(store: Store, chosen: str) -> list[dict[str, Any]]:
    """Return the pictures of each recipe as plain values: balls of two recipes have nothing in common but names.

    `chosen` is a condition of SQL that chooses parts.
    """
    names = [row["recipe"] for row in _rows(store, f"select distinct recipe from parts where {chosen} order by recipe")]
    charts = []
    for name in names:
        of_recipe = f"where {chosen} and recipe = '{name.replace(chr(39), chr(39) * 2)}'"
        readings = ", ".join(DRIFTS)
        drift = _rows(
            store,
            f"select * from (select serial, inspected_utc, sequence, verdict, {readings} from parts {of_recipe} "
            f"order by sequence desc limit {DRIFT_PARTS}) order by sequence",
        )
        charts.append(
            {
                "recipe": name,
                "places": _places(store, of_recipe),
                "strip": _strip(store, of_recipe),
                "drifts": [one for key, title in DRIFTS.items() if (one := _drift(drift, key, title)) is not None],
            }
        )
    return charts


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
            "words": f"{100 * row['passed'] // row['n']} % of {row['n']}",
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
