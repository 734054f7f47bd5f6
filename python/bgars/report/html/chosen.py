"""The mark that a chosen ball gets in the charts: one more trace, and where it goes for each ball."""

from __future__ import annotations

from typing import Any

from bgars.report.html.words import is_known

__all__ = ["chosen_marks"]

RING = {"size": 16, "color": "rgba(0,0,0,0)", "line": {"color": "#D55E00", "width": 3}}
RING_3D = {"size": 9, "symbol": "circle-open", "color": "#D55E00", "line": {"color": "#D55E00", "width": 3}}

Places = dict[str, dict[str, list[list[float]]]]


def chosen_marks(result: dict[str, Any], figures: dict[str, dict[str, Any]]) -> Places:
    """Add an empty trace to each chart that shows balls one by one; return coordinates for each ball's number."""
    places: Places = {}
    balls = result["balls"]
    if "coplanarity" in figures:
        figures["coplanarity"]["data"].append(_trace("scatter", RING))
        places["coplanarity"] = {
            str(index): [[index] * len(values), values]
            for index, ball in enumerate(balls)
            if (values := [ball[k] for k in ("seating_deviation_um", "regression_deviation_um") if is_known(ball[k])])
        }
    for name, kind, mark in (("offsets", "scatter", RING), ("scene", "scatter3d", RING_3D)):
        if name not in figures:
            continue
        tips = _points(figures[name])
        figures[name]["data"].append(_trace(kind, mark))
        places[name] = tips
    return places


def _points(figure: dict[str, Any]) -> dict[str, list[list[float]]]:
    """Coordinates of what carries a ball's number."""
    found: dict[str, list[list[float]]] = {}
    for trace in figure["data"]:
        for at, number in enumerate(trace.get("customdata", ())):
            found[str(number[0])] = [[trace[axis][at]] for axis in "xyz" if axis in trace]
    return found


def _trace(kind: str, marker: dict[str, Any]) -> dict[str, Any]:
    empty: dict[str, list[float]] = {axis: [] for axis in ("xyz" if kind == "scatter3d" else "xy")}
    return {
        "type": kind,
        "mode": "markers",
        "name": "chosen",
        **empty,
        "marker": marker,
        "hoverinfo": "skip",
        "showlegend": False,
    }
