"""Charts of the page as plain plotly figures: coplanarity, and how readings are spread.

Figures are dictionaries in plotly's own schema, so that writing a page does not import plotly; the tests have plotly
check each of them.
"""

from __future__ import annotations

import html
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from bgars.report.html.words import QUANTITIES, Quantity, expanded, is_known, limit_words, range_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["BLUE", "FAIL", "PURPLE", "UNDECIDED", "axis", "coplanarity_chart", "histogram_charts", "literal"]

BLUE, PURPLE, FAIL, UNDECIDED = "#0072B2", "#B0578D", "#D55E00", "#E69F00"
"""Okabe and Ito, Color universal design, 2008; the purple darkened for thin marks."""
HISTOGRAMS = ("true_position_um", "diameter_um", "top_um", "seating_deviation_um", "aspect_ratio", "flat_top_depth_um")
LEAST_SPAN_UM = 1.0
LEAST_SPAN_RATIO = 0.002
MAX_TICKS = 32
TICKS = 5
MAX_NAME = 6
"""Letters of a name that the margin holds, turned."""
MAX_ERROR_BARS = 120
DASH = {"dash": "dash", "width": 1.6, "color": FAIL}


def literal(text: str) -> str:
    """A text that plotly shows letter by letter: it would take tags and entities for markup.

    Examples
    --------
    >>> literal("<b>A1</b>")
    '&lt;b&gt;A1&lt;/b&gt;'
    """
    return html.escape(text, quote=False)


def axis(title: str, **options: Any) -> dict[str, Any]:  # noqa: ANN401 - plotly's schema
    """An axis with its title; margins are fixed, as fitting them to labels lays a chart out several times."""
    return {"title": {"text": title, "standoff": 6}, **options}


def coplanarity_chart(result: dict[str, Any]) -> dict[str, Any] | None:
    """Distance of every apex below both planes; None where there is no plane."""
    balls = result["balls"]
    names = [literal(ball["name"]) for ball in balls]
    seats = set(result["seatings"][0]["balls"]) if result["seatings"] else set()
    traces = []
    kinds = (
        ("seating_deviation_um", "below the seating plane", BLUE, "circle"),
        ("regression_deviation_um", "below the regression plane", PURPLE, "diamond-open"),
    )
    for key, words, color, symbol in kinds:
        known = [index for index, ball in enumerate(balls) if is_known(ball[key])]
        if not known:
            continue
        is_seating = key == "seating_deviation_um"
        touching = [is_seating and balls[index]["name"] in seats for index in known]
        trace: dict[str, Any] = {
            "type": "scatter",
            "mode": "markers",
            "name": words,
            "x": known,
            "y": [balls[index][key] for index in known],
            "text": [names[index] for index in known],
            "customdata": known,
            "marker": {
                "color": color,
                "symbol": ["star" if seat else symbol for seat in touching],
                "size": [14 if seat else 9 for seat in touching],
                "line": {"width": 0 if is_seating else 2},
            },
            "hovertemplate": "%{text}: %{y:.2f} µm " + words + "<extra></extra>",
        }
        if is_seating and len(known) <= MAX_ERROR_BARS:
            u = [expanded(balls[index]["u_top_um"]) or 0.0 for index in known]
            trace["error_y"] = {"type": "data", "array": u, "color": color, "thickness": 1, "width": 2}
        traces.append(trace)
    if not traces:
        return None
    shapes, annotations = [], []
    for key, color in (("seating_coplanarity_um", BLUE), ("regression_coplanarity_um", PURPLE)):
        limits = range_of(result["recipe"], key)
        if limits is None or limits[1] is None:
            continue
        line = {"dash": "dash", "width": 1.6, "color": color}
        shapes.append(
            {"type": "line", "xref": "paper", "x0": 0, "x1": 1, "y0": limits[1], "y1": limits[1], "line": line}
        )
        annotations.append(_note(f"limit {key.split('_')[0]} {limits[1]:g} µm", 1.0, limits[1], color))
    highest = max([0.0, *(value for trace in traces for value in trace["y"]), *(shape["y0"] for shape in shapes)])
    lowest = min([0.0, *(value for trace in traces for value in trace["y"])])
    room = 0.06 * max(highest - lowest, LEAST_SPAN_UM)
    step = max(1, math.ceil(len(balls) / MAX_TICKS))
    ticks = list(range(0, len(balls), step))
    return {
        "data": traces,
        "layout": {
            # The plane is the line at 0; what hangs below it hangs below it.
            "yaxis": axis("apex below the plane (µm)", range=[highest + room, lowest - room], zeroline=True),
            "xaxis": axis(
                "ball",
                tickvals=ticks,
                ticktext=[names[at] for at in ticks],
                automargin=max(len(balls[at]["name"]) for at in ticks) > MAX_NAME,
                range=[-0.7, len(balls) - 0.3],
                zeroline=False,
            ),
            "legend": {"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0},
            "shapes": shapes,
            "annotations": annotations,
            "hovermode": "closest",
        },
    }


def _note(text: str, x: float, y: float, color: str) -> dict[str, Any]:
    """Words at the right end of a limit."""
    place = {"xref": "paper", "x": x, "y": y, "xanchor": "right", "yanchor": "bottom", "showarrow": False}
    return {"text": text, "font": {"color": color, "size": 11}, **place}


def histogram_charts(result: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """One histogram a quantity; limits dashed, the band of the median U on either side shaded."""
    by_name = {quantity.name: quantity for quantity in QUANTITIES}
    whole = [ball for ball in result["balls"] if ball["present"] and ball["kind"] == "ball"]
    charts = {}
    for name in HISTOGRAMS:
        quantity = by_name[name]
        values = np.array([ball[name] for ball in whole if is_known(ball[name])], dtype=np.float64)
        if values.size:
            limits = range_of(result["recipe"], quantity.limit)
            charts[name] = _histogram(quantity, values, limits, _band(quantity, whole, result))
    return charts


def _band(quantity: Quantity, balls: list[dict[str, Any]], result: dict[str, Any]) -> float:
    """U of a typical ball; of the whole part for the coplanarity."""
    if not quantity.u_name:
        return expanded(result["u_seating_coplanarity_um"]) or 0.0
    known = [ball[quantity.u_name] for ball in balls if is_known(ball[quantity.u_name])]
    return 2.0 * float(np.median(known)) if known else 0.0


def _whole_step(most: int) -> int:
    """Step of ticks that count balls: whole, about five of them.

    Examples
    --------
    >>> _whole_step(1), _whole_step(8), _whole_step(300)
    (1, 2, 100)
    """
    step = max(1, math.ceil(most / TICKS))
    power = int(10 ** (len(str(step)) - 1))
    return next(round_ * power for round_ in (1, 2, 5, 10) if round_ * power >= step)


def _histogram(
    quantity: Quantity,
    values: NDArray[np.float64],
    limits: tuple[float | None, float | None] | None,
    u: float,
) -> dict[str, Any]:
    low, high = float(values.min()), float(values.max())
    least = LEAST_SPAN_UM if quantity.unit else LEAST_SPAN_RATIO
    room = max(0.02 * (high - low), 0.5 * (least - (high - low)))
    count = int(np.clip(np.sqrt(values.size) * 2, 5, 40))
    first = max(low - room, min(low, 0.0))  # a length is no less than 0
    bars, edges = np.histogram(values, bins=count, range=(first, high + room))
    unit = f" {quantity.unit}" if quantity.unit else ""
    shapes: list[dict[str, Any]] = []
    for edge in (each for each in limits or () if each is not None):
        shapes.append({"type": "line", "yref": "paper", "y0": 0, "y1": 1, "x0": edge, "x1": edge, "line": DASH})
        if u > 0:
            band = {"fillcolor": UNDECIDED, "opacity": 0.3, "line": {"width": 0}, "layer": "below"}
            shapes.append({"type": "rect", "yref": "paper", "y0": 0, "y1": 1, "x0": edge - u, "x1": edge + u, **band})
    ends = [first, high + room, *(shape[end] for shape in shapes for end in ("x0", "x1"))]
    margin = 0.04 * (max(ends) - min(ends))
    start = min(ends) - margin
    if limits and limits[0] is None:  # a distance: it begins at 0
        start = min(0.0, first)
    title = f"{quantity.title} ({quantity.unit})" if quantity.unit else quantity.title
    return {
        "data": [
            {
                "type": "bar",
                "x": ((edges[:-1] + edges[1:]) / 2).round(6).tolist(),
                "y": bars.tolist(),
                "width": np.diff(edges).round(6).tolist(),
                "customdata": np.stack([edges[:-1], edges[1:]], axis=1).round(quantity.digits + 1).tolist(),
                "marker": {"color": BLUE},
                "hovertemplate": "%{y} balls from %{customdata[0]} to %{customdata[1]}" + unit + "<extra></extra>",
            }
        ],
        "layout": {
            "title": {"text": f"limits: {limit_words(limits)}" if limits else "no limit given"},
            "xaxis": axis(title, range=[start, max(ends) + margin], zeroline=False),
            "yaxis": axis("balls", rangemode="tozero", dtick=_whole_step(int(bars.max(initial=0)))),
            "shapes": shapes,
            "showlegend": False,
            "bargap": 0,
        },
    }
