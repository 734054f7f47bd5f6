"""The 3-D view of the page: board, balls and planes, each from the result and nothing else.

What is measured is coloured: the caps of the balls, from the equator up, as the spheroids that shadows and silhouettes
gave. What is only drawn is grey: below the equator no light of the camera's comes back.
"""

from __future__ import annotations

import math
from base64 import b64encode
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from bgars.report.page_charts import BLUE, FAIL, PURPLE, literal
from bgars.report.page_picture import ball_radius, deviations, drawn_places
from bgars.report.page_words import is_known

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["scene_chart"]

GREY, BOARD, PLAIN = "#b4b8bd", "#8fa58a", "#7a8aa0"
SIDES_OF_ALL = 250.0
"""Sides of a ball, times the root of their number: what all balls may cost."""
FEWEST_SIDES, MOST_SIDES = 10, 32
SKIRT_LEVELS = 3
BOARD_POINTS = 25
MARGIN_RADII = 2.5
LIGHTING = {"ambient": 0.55, "diffuse": 0.65, "specular": 0.25, "roughness": 0.5}


@dataclass(frozen=True)
class _Solid:
    """A ball that is measured whole; heights in the world."""

    index: int
    x_um: float
    y_um: float
    board_um: float
    radius_um: float
    centre_z_um: float
    top_um: float
    q: float


def scene_chart(result: dict[str, Any]) -> dict[str, Any] | None:
    """The figure; None when no ball has a place."""
    balls = result["balls"]
    places = drawn_places(balls)
    known = np.array([place for place in places if place], dtype=np.float64).reshape(-1, 2)
    if not len(known):
        return None
    board = _board_of(result)
    solids = [
        _Solid(
            index, ball["x_um"], ball["y_um"], float(board(ball["x_um"], ball["y_um"])),
            ball["diameter_um"] / 2, ball["centre_z_um"], ball["top_um"], ball["q"] or 1.0,
        )
        for index, ball in enumerate(balls)
        if _is_whole(ball)
    ]  # fmt: skip
    name, values = deviations(result)
    sides = int(np.clip(SIDES_OF_ALL / math.sqrt(max(len(solids), 1)), FEWEST_SIDES, MOST_SIDES))
    coloured = [solid for solid in solids if is_known(values[solid.index])]
    plain = [solid for solid in solids if not is_known(values[solid.index])]
    traces = [_board_trace(known, ball_radius(result), board)]
    if coloured:
        colors = np.array([values[solid.index] for solid in coloured], dtype=np.float64)
        bar = {"title": {"text": f"{name} (µm)", "side": "right"}, "thickness": 14, "len": 0.75}
        cap = _caps(coloured, sides)
        cap |= {"intensity": _packed(np.repeat(colors, _cap_points(sides))), "colorscale": "Viridis", "colorbar": bar}
        traces.append({**cap, "name": "balls, measured (equator up)", "showlegend": True})
    if plain:
        traces.append({**_caps(plain, sides), "color": PLAIN, "name": "balls without a plane", "showlegend": True})
    if solids:
        skirt = {"color": GREY, "name": "below the equator: drawn, not measured"}
        traces.append({**_skirts(solids, sides), **skirt, "showlegend": True})
        traces.append(_apexes(solids, balls))
    ring = _rings(result, places, {solid.index for solid in solids}, board)
    traces += [trace for trace in (ring, *_planes(result, solids, known)) if trace]
    layout = {
        "scene": _frame(known, result, solids, board),
        "legend": {"orientation": "h", "y": 0, "yanchor": "top", "x": 0},
        "margin": {"l": 0, "r": 0, "t": 8, "b": 8},
    }
    return {"data": traces, "layout": layout}


def _is_whole(ball: dict[str, Any]) -> bool:
    """Whether all that a spheroid needs was measured."""
    lengths = (ball[name] for name in ("x_um", "y_um", "diameter_um", "centre_z_um", "top_um"))
    return ball["present"] and all(map(is_known, lengths)) and ball["diameter_um"] > 0 and (ball["q"] or 1.0) > 0


def _frame(known: Array, result: dict[str, Any], solids: list[_Solid], board: Any) -> dict[str, Any]:  # noqa: ANN401
    """Axes true to scale, as large as the balls and their board."""
    x, y = _rectangle(known, MARGIN_RADII * ball_radius(result), BOARD_POINTS)
    z = np.broadcast_to(board(x, y), x.shape)
    high_um = max([float(z.max()) + ball_radius(result), *(1.05 * (s.board_um + s.top_um) for s in solids)])
    ranges = {"x": (x.min(), x.max()), "y": (y.min(), y.max()), "z": (float(z.min()) - 0.02 * high_um, high_um)}
    longest_um = max(high - low for low, high in ranges.values())
    axes = {
        f"{name}axis": {
            "title": {"text": f"{name} (µm)"},
            "range": [float(low), float(high)],
            "nticks": 4 if name == "z" else 8,
        }
        for name, (low, high) in ranges.items()
    }
    ratio = {name: 1.6 * float(high - low) / float(longest_um) for name, (low, high) in ranges.items()}
    camera = {"eye": {"x": 0.5, "y": -1.75, "z": 1.1}, "center": {"x": 0.0, "y": 0.0, "z": -0.12}}
    return {"aspectmode": "manual", "aspectratio": ratio, "camera": camera, **axes}


def _board_of(result: dict[str, Any]) -> Any:  # noqa: ANN401 - a function of x and y
    """The board's height at x, y; unknown terms count as 0."""
    c = np.array([value if is_known(value) else 0.0 for value in result["board_coefficients_um"]])
    return lambda x, y: c[0] + c[1] * x + c[2] * y + c[3] * x * x + c[4] * x * y + c[5] * y * y


def _packed(values: Array) -> dict[str, str]:
    """An array as plotly's typed array: a third of the size of its digits."""
    kind = "f4" if values.dtype.kind == "f" else "u4"
    if kind == "f4":  # a damaged result may hold what single precision cannot
        values = np.clip(values, np.finfo(np.float32).min, np.finfo(np.float32).max)
    return {"dtype": kind, "bdata": b64encode(values.astype(f"<{kind}").tobytes()).decode("ascii")}


def _rectangle(known: Array, margin_um: float, count: int) -> tuple[Array, Array]:
    low, high = known.min(axis=0) - margin_um, known.max(axis=0) + margin_um
    x, y = np.meshgrid(np.linspace(low[0], high[0], count), np.linspace(low[1], high[1], count))
    return x, y


def _surface(x: Array, y: Array, z: Array, color: str, **options: Any) -> dict[str, Any]:  # noqa: ANN401
    return {
        "type": "surface",
        "x": x[0].round(2).tolist(),
        "y": y[:, 0].round(2).tolist(),
        "z": z.round(3).tolist(),
        "colorscale": [[0, color], [1, color]],
        "showscale": False,
        "showlegend": True,
        "contours": {each: {"highlight": False} for each in "xyz"},
        "lighting": {"ambient": 0.8, "diffuse": 0.3, "specular": 0.0},
        **options,
    }


def _board_trace(known: Array, radius_um: float, board: Any) -> dict[str, Any]:  # noqa: ANN401
    x, y = _rectangle(known, MARGIN_RADII * radius_um, BOARD_POINTS)
    z = np.broadcast_to(board(x, y), x.shape)
    return _surface(x, y, z, BOARD, name="board, fitted", hoverinfo="skip")


def _planes(result: dict[str, Any], solids: list[_Solid], known: Array) -> list[dict[str, Any]]:
    """The worst seating plane, and the regression plane as the deviations from it say."""
    planes = []
    x, y = _rectangle(known, 2.0 * ball_radius(result), 2)
    look = {"opacity": 0.22, "hoverinfo": "skip"}
    if result["seatings"]:
        seat = result["seatings"][0]
        if all(is_known(seat[key]) for key in ("slope_x", "slope_y", "offset_um")):
            z = seat["slope_x"] * x + seat["slope_y"] * y + seat["offset_um"]
            planes.append(_surface(x, y, z, BLUE, name="seating plane", **look))
    points = [
        (solid.x_um, solid.y_um, solid.board_um + solid.top_um + deviation)
        for solid in solids
        if is_known(deviation := result["balls"][solid.index]["regression_deviation_um"])
    ]
    if len(points) >= len("xyz"):
        table = np.array(points)
        terms = np.column_stack([np.ones(len(table)), table[:, :2]])
        offset, slope_x, slope_y = np.linalg.lstsq(terms, table[:, 2], rcond=None)[0]
        z = offset + slope_x * x + slope_y * y
        planes.append(_surface(x, y, z, PURPLE, name="regression plane", visible="legendonly", **look))
    return planes


def _cap_points(sides: int) -> int:
    return 1 + _cap_rings(sides) * sides


def _cap_rings(sides: int) -> int:
    return max(4, sides // 4)


def _mesh(vertices: Array, faces: Array) -> dict[str, Any]:
    x, y, z = vertices.reshape(-1, 3).T
    i, j, k = faces.reshape(-1, 3).T
    arrays = {"x": x, "y": y, "z": z, "i": i, "j": j, "k": k}
    packed = {name: _packed(values) for name, values in arrays.items()}
    return {"type": "mesh3d", **packed, "hoverinfo": "skip", "lighting": LIGHTING, "flatshading": False}


def _table(solids: list[_Solid]) -> Array:
    """(n, 1, 7) x, y, board, radius, centre, top, q of each ball."""
    rows = [(s.x_um, s.y_um, s.board_um, s.radius_um, s.centre_z_um, s.top_um, s.q) for s in solids]
    return np.array(rows, dtype=np.float64)[:, None, :]


def _caps(solids: list[_Solid], sides: int) -> dict[str, Any]:
    """Upper halves of the spheroids, cut off where the top is flat."""
    rings = _cap_rings(sides)
    slant, turn = np.meshgrid(
        np.linspace(0, np.pi / 2, rings + 1)[1:], np.arange(sides) * 2 * np.pi / sides, indexing="ij"
    )
    across = np.append(0.0, np.sin(slant).ravel())
    up = np.append(1.0, np.cos(slant).ravel())
    around = np.append(0.0, turn.ravel())
    x, y, board, radius, centre, top, q = np.moveaxis(_table(solids), 2, 0)
    # The apex is the measured top, whether the top is flat or not.
    z = np.minimum(centre + np.maximum(q * radius, top - centre) * up, top)
    vertices = np.stack([x + radius * across * np.cos(around), y + radius * across * np.sin(around), board + z], axis=2)
    one = np.arange(sides)
    two = (one + 1) % sides
    faces = [np.column_stack([np.zeros(sides, dtype=np.int64), 1 + one, 1 + two])]
    for ring in range(rings - 1):
        inner, outer = 1 + ring * sides, 1 + (ring + 1) * sides
        faces += [
            np.column_stack([inner + one, outer + one, outer + two]),
            np.column_stack([inner + one, outer + two, inner + two]),
        ]
    return _mesh(vertices, _repeated(np.concatenate(faces), len(solids), vertices.shape[1]))


def _skirts(solids: list[_Solid], sides: int) -> dict[str, Any]:
    """The spheroids from the equator down to the board."""
    levels = SKIRT_LEVELS
    x, y, board, radius, centre, _top, q = np.moveaxis(_table(solids), 2, 0)
    down, turn = np.meshgrid(np.linspace(0.0, 1.0, levels), np.arange(sides) * 2 * np.pi / sides, indexing="ij")
    deepest = np.arcsin(np.clip(centre / (q * radius), 0.0, 1.0))
    slant = deepest * down.ravel()
    z = centre - q * radius * np.sin(slant)
    across = radius * np.cos(slant)
    around = turn.ravel()
    vertices = np.stack([x + across * np.cos(around), y + across * np.sin(around), board + z], axis=2)
    one = np.arange(sides)
    two = (one + 1) % sides
    faces = []
    for level in range(levels - 1):
        upper, lower = level * sides, (level + 1) * sides
        faces += [
            np.column_stack([upper + one, lower + one, lower + two]),
            np.column_stack([upper + one, lower + two, upper + two]),
        ]
    return _mesh(vertices, _repeated(np.concatenate(faces), len(solids), vertices.shape[1]))


def _repeated(faces: Any, count: int, points: int) -> Any:  # noqa: ANN401 - (n, 3) integers
    """The faces of one ball for all."""
    return (faces[None, :, :] + points * np.arange(count)[:, None, None]).reshape(-1, 3)


def _apexes(solids: list[_Solid], balls: list[dict[str, Any]]) -> dict[str, Any]:
    """A point on every top: what is named, pointed at and chosen."""
    return {
        "type": "scatter3d",
        "mode": "markers",
        "name": "apex",
        "x": [round(solid.x_um, 2) for solid in solids],
        "y": [round(solid.y_um, 2) for solid in solids],
        # A little above the top: half of a mark on it would be inside the ball.
        "z": [round(solid.board_um + solid.top_um + 0.06 * solid.radius_um, 3) for solid in solids],
        "text": [literal(balls[solid.index]["name"]) for solid in solids],
        "customdata": [[solid.index, balls[solid.index]["top_um"]] for solid in solids],
        "marker": {"size": 3, "color": [_apex_color(balls[solid.index]["verdict"]) for solid in solids]},
        "hovertemplate": "%{text}: height %{customdata[1]:.2f} µm<extra></extra>",
        "showlegend": False,
    }


def _apex_color(verdict: str) -> str:
    return {"pass": "#ffffff", "fail": FAIL, "undecided": "#E69F00"}[verdict]


def _rings(
    result: dict[str, Any],
    places: list[tuple[float, float] | None],
    drawn: set[int],
    board: Any,  # noqa: ANN401
) -> dict[str, Any] | None:
    """Balls without a height, and places without a ball: circles on the board."""
    turn = np.linspace(0.0, 2.0 * math.pi, 25)
    common_um = ball_radius(result)
    points: dict[str, list[float | None]] = {"x": [], "y": [], "z": []}
    for index, (ball, place) in enumerate(zip(result["balls"], places, strict=True)):
        if place is None or index in drawn:
            continue
        radius_um = ball["diameter_um"] / 2 if is_known(ball["diameter_um"]) else common_um
        x, y = place[0] + radius_um * np.cos(turn), place[1] + radius_um * np.sin(turn)
        z = np.broadcast_to(board(x, y), x.shape) + 2.0
        for name, values in (("x", x), ("y", y), ("z", z)):
            points[name] += [*values.round(1).tolist(), None]
    if not points["x"]:
        return None
    look = {"line": {"color": FAIL, "width": 4}, "hoverinfo": "skip", "connectgaps": False}
    return {"type": "scatter3d", "mode": "lines", "name": "no ball, or no height: on the board", **points, **look}
