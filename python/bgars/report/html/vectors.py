"""Chart of the offsets from the ideal grid, magnified, each against its tolerance zone at the same magnification."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from bgars.report.html.charts import BLUE, FAIL, axis, literal
from bgars.report.html.picture import ball_radius, drawn_places, round_down
from bgars.report.html.words import is_known, range_of

__all__ = ["VectorChart", "vector_chart"]

LONGEST_ARROW = 0.9
"""Length of the longest arrow, of the pitch."""
LARGEST_ZONE = 0.6
"""Radius up to which circles of the limit are drawn, of the pitch: larger ones run into each other."""
LARGEST_HEAD_PX = 9.0
HEADS_PX = 160.0
"""All heads side by side along one side of the map: where there are many, they are small."""
CIRCLE_POINTS = 25
LINE_OF_MAP = 0.04
"""Height of a line of text, of the map."""
DECIMALS = 1


@dataclass(frozen=True)
class VectorChart:
    """The figure, its magnification, and what is to be said of the limit."""

    figure: dict[str, Any]
    magnification: float
    zones: str


def vector_chart(result: dict[str, Any]) -> VectorChart | None:
    """Draw the offsets; None where none is known."""
    balls = result["balls"]
    known = [index for index, ball in enumerate(balls) if _has_offset(ball)]
    if not known:
        return None
    nominal = np.array([(balls[at]["x_nominal_um"], balls[at]["y_nominal_um"]) for at in known], dtype=np.float64)
    centres = np.array([(balls[at]["x_um"], balls[at]["y_um"]) for at in known], dtype=np.float64)
    offsets = centres - nominal
    longest_um = float(np.hypot(*offsets.T).max())
    room_um = abs(result["pitch_um"] or 0.0) or 3.0 * ball_radius(result)
    magnification = round_down(LONGEST_ARROW * room_um / longest_um) if longest_um > 0 else 1.0
    tips = nominal + magnification * offsets
    limits = range_of(result["recipe"], "true_position_um")
    traces, zones = [], ""
    if limits is not None and limits[1] is not None:
        if magnification * limits[1] <= LARGEST_ZONE * room_um:
            traces.append(_zones(nominal, magnification * limits[1], f"limit {limits[1]:g} µm, magnified alike"))
            zones = (
                "Dotted circles are the limit at the same magnification: an arrow that leaves its circle is outside."
            )
        else:
            zones = (
                f"The limit, {limits[1]:g} µm, is too large to be drawn here; the longest arrow is {longest_um:.2f} µm."
            )
    traces += [_gaps(balls), *_arrows(balls, known, nominal, tips)]
    layout = {
        "xaxis": axis("x (µm)", zeroline=False, constrain="domain"),
        "yaxis": axis("y (µm)", zeroline=False, scaleanchor="x", scaleratio=1, constrain="domain"),
        "legend": {"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0},
        "hovermode": "closest",
    }
    if longest_um > 0:
        traces.append(_key(nominal, magnification, longest_um, room_um))
    figure = {"data": [trace for trace in traces if trace["x"]], "layout": layout}
    return VectorChart(figure, magnification, zones)


def _has_offset(ball: dict[str, Any]) -> bool:
    names = ("true_position_um", "x_um", "y_um", "x_nominal_um", "y_nominal_um")
    return all(is_known(ball[name]) for name in names)


def _arrows(balls: list[dict[str, Any]], known: list[int], nominal: Any, tips: Any) -> list[dict[str, Any]]:  # noqa: ANN401
    """Shafts in one trace for each colour, heads turned along them."""
    traces = []
    for failed, color, words in ((False, BLUE, "offset"), (True, FAIL, "offset of a ball that fails")):
        mine = [row for row, at in enumerate(known) if (balls[at]["verdict"] == "fail") == failed]
        if not mine:
            continue
        start, tip = nominal[mine], tips[mine]
        head_px = round(min(LARGEST_HEAD_PX, HEADS_PX / math.sqrt(len(known))), 1)
        line = {"color": color, "width": max(1.0, round(2.0 * head_px / LARGEST_HEAD_PX, 1))}
        shafts = {"type": "scatter", "mode": "lines", "line": line, "hoverinfo": "skip"}
        x, y = (_broken(start[:, at], tip[:, at]) for at in (0, 1))
        traces.append({**shafts, "x": x, "y": y, "showlegend": False, "name": words})
        turn = np.degrees(np.arctan2(*(tip - start).T)).round(2)
        chosen = [balls[known[row]] for row in mine]
        traces.append(
            {
                "type": "scatter",
                "mode": "markers",
                "name": words,
                "x": tip[:, 0].round(DECIMALS).tolist(),
                "y": tip[:, 1].round(DECIMALS).tolist(),
                "text": [literal(ball["name"]) for ball in chosen],
                "customdata": [
                    [known[row], ball["true_position_um"], *(tip[at] - start[at]).round(3).tolist()]
                    for at, (row, ball) in enumerate(zip(mine, chosen, strict=True))
                ],
                "marker": {"symbol": "triangle-up", "size": head_px, "angle": turn.tolist(), "color": color},
                "hovertemplate": "%{text}: true position %{customdata[1]:.2f} µm<extra></extra>",
            }
        )
    return traces


def _broken(start: Any, tip: Any) -> list[float | None]:  # noqa: ANN401 - (n,) arrays
    """Start, tip, gap, start, tip, gap, ..."""
    line: list[float | None] = []
    for one, two in zip(start.round(DECIMALS).tolist(), tip.round(DECIMALS).tolist(), strict=True):
        line += [one, two, None]
    return line


def _zones(nominal: Any, radius: float, words: str) -> dict[str, Any]:  # noqa: ANN401
    """A circle around every place."""
    turn = np.linspace(0.0, 2.0 * math.pi, CIRCLE_POINTS)
    circle = radius * np.column_stack([np.cos(turn), np.sin(turn)])
    points: dict[str, list[float | None]] = {"x": [], "y": []}
    for place in nominal:
        for at, name in enumerate("xy"):
            points[name] += [*(place[at] + circle[:, at]).round(DECIMALS).tolist(), None]
    line = {"color": FAIL, "width": 1, "dash": "dot"}
    return {"type": "scatter", "mode": "lines", "name": words, **points, "line": line, "hoverinfo": "skip"}


def _gaps(balls: list[dict[str, Any]]) -> dict[str, Any]:
    """Places without an offset: crosses."""
    places = [
        (place, literal(ball["name"]))
        for ball, place in zip(balls, drawn_places(balls), strict=True)
        if place and not _has_offset(ball)
    ]
    return {
        "type": "scatter",
        "mode": "markers",
        "name": "no centre, or no place in the grid",
        "x": [place[0] for place, _ in places],
        "y": [place[1] for place, _ in places],
        "text": [name for _, name in places],
        "marker": {"symbol": "x-thin-open", "size": 11, "color": FAIL, "line": {"width": 2}},
        "hovertemplate": "%{text}: no offset<extra></extra>",
    }


def _key(nominal: Any, magnification: float, longest_um: float, room_um: float) -> dict[str, Any]:  # noqa: ANN401
    """An arrow of a round length under the map, with what it stands for."""
    length_um = round_down(longest_um)
    x = float(nominal[:, 0].min())
    # Clear of the lowest arrows, by a line of text.
    y = float(nominal[:, 1].min() - LONGEST_ARROW * room_um - LINE_OF_MAP * max(room_um, np.ptp(nominal[:, 1])))
    return {
        "type": "scatter",
        "mode": "lines+text",
        "name": "key",
        "showlegend": False,
        "x": [x, x + magnification * length_um],
        "y": [y, y],
        "text": ["", f" {length_um:g} µm"],
        "textposition": "middle right",
        "line": {"color": BLUE, "width": 3},
        "hoverinfo": "skip",
    }
