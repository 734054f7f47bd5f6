"""The 3-D view of the page: the part's integrated surface where there is one, its spheroids, board and planes.

What is measured is coloured. What is a prior is rose; what is only drawn is grey: below the equator no light of the
camera's comes back.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from bgars.report.html.charts import BLUE, FAIL, PURPLE, literal
from bgars.report.html.mesh import grid_trace, mesh_trace, packed
from bgars.report.html.picture import COLORS, ball_radius, deviations, drawn_places
from bgars.report.html.solids import Solid, cap_points, caps, skirts, solids_of
from bgars.report.html.surface import OUTERMOST, ball_mesh, board_trace, mesh_sides
from bgars.report.html.words import is_known

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from bgars.records.part_surface import PartSurface
    from bgars.report.html.source import PageSource

    Array = NDArray[np.float64]
    Board = Callable[[Any, Any], Any]

__all__ = ["ViewWords", "scene_chart", "view_words"]

GREY, BOARD, PLAIN, PRIOR = "#b4b8bd", "#8fa58a", "#7a8aa0", "#d8899a"
SIDES_OF_ALL = 250.0
"""Sides of a spheroid, times the root of their number: what all of them may cost."""
FEWEST_SIDES, MOST_SIDES = 10, 32
BOARD_POINTS = 25
MARGIN_RADII = 2.5
MANY = 200
"""Balls above which dots on their tops would hide them."""


def scene_chart(result: dict[str, Any], surface: PartSurface | None = None) -> dict[str, Any] | None:
    """The figure; None when no ball has a place."""
    balls = result["balls"]
    places = drawn_places(balls)
    known = np.array([place for place in places if place], dtype=np.float64).reshape(-1, 2)
    if not len(known):
        return None
    board = _board_of(result)
    solids = solids_of(result, board)
    name, values = deviations(result)
    coloured = [solid for solid in solids if is_known(values[solid.index])]
    plain = [solid for solid in solids if not is_known(values[solid.index])]
    colors = np.array([values[solid.index] for solid in coloured], dtype=np.float64)
    traces = []
    if surface is not None and solids:
        traces += _integrated(coloured, plain, colors, surface)
        margin_um = MARGIN_RADII * ball_radius(result)
        low, high = known.min(axis=0) - margin_um, known.max(axis=0) + margin_um
        traces.append(board_trace(surface, low, high, BOARD, name="board, integrated normals"))
    is_meshed = any(traces)
    if not is_meshed:
        traces.append(_fitted_board(known, ball_radius(result), board))
    sides = int(np.clip(SIDES_OF_ALL / math.sqrt(max(len(solids), 1)), FEWEST_SIDES, MOST_SIDES))
    shown = {"visible": "legendonly"} if is_meshed else {}
    if coloured:
        look = {"intensity": packed(np.repeat(colors, cap_points(sides))), "coloraxis": "coloraxis", **shown}
        title = "fitted spheroids" if is_meshed else "balls, measured (equator up)"
        traces.append(caps(coloured, sides, name=title, **look))
    if plain:
        title = "spheroids without a plane" if is_meshed else "balls without a plane"
        traces.append(caps(plain, sides, name=title, color=PLAIN, **shown))
    if solids:
        title = "rim and below the equator" if is_meshed else "below the equator"
        across = OUTERMOST if is_meshed else 1.0
        sides = mesh_sides(len(solids)) if is_meshed else sides  # rims must meet
        traces.append(skirts(solids, sides, across, color=GREY, name=f"{title}: drawn, not measured"))
        traces.append(_apexes(solids, balls))
    ring = _rings(result, places, {solid.index for solid in solids}, board)
    traces += [ring, *_planes(result, solids, known)]
    bar = {"title": {"text": f"{name} (µm)", "side": "right"}, "thickness": 14, "len": 0.75}
    layout = {
        "scene": _frame(known, result, solids, board),
        "coloraxis": {"colorscale": COLORS.title(), "colorbar": bar},
        "legend": {"orientation": "h", "y": 0, "yanchor": "top", "x": 0},
        "margin": {"l": 0, "r": 0, "t": 8, "b": 8},
    }
    return {"data": [trace for trace in traces if trace], "layout": layout}


@dataclass(frozen=True)
class ViewWords:
    """What the 3-D view shows, in words.

    Attributes
    ----------
    meshed : bool
        Whether it is the integrated surface; else spheroids.
    sampling : str
        How densely the surface was read.
    keys : tuple of (str, str)
        Colours and what they stand for.
    """

    meshed: bool
    sampling: str
    keys: tuple[tuple[str, str], ...]


def view_words(source: PageSource) -> ViewWords:
    """Say what is drawn, how finely, and what the colours mean."""
    surface = source.surface
    solids = solids_of(source.result, lambda _x, _y: 0.0)
    grey = (GREY, "drawn, not measured: below the equator")
    plane = ((BLUE, "seating plane"),) if source.result["seatings"] else ()
    if surface is None or not solids:
        return ViewWords(False, "", ((BOARD, "board, fitted"), grey, *plane))
    sides = mesh_sides(len(solids))
    ball_um, board_um = (step * surface.pixel_pitch_um for step in (surface.ball_step_px, surface.board_step_px))
    sampling = (
        f"Each ball is read from a height map with a sample every {ball_um:g} µm, on {sides // 2} rings in {sides} "
        f"directions, out to {OUTERMOST:g} of its radius; the board's samples are {board_um:g} µm apart or more."
    )
    grey = (GREY, "drawn, not measured: rim and below the equator")
    keys = (
        (BOARD, "board, integrated"), (PRIOR, "from a prior, not measured"), grey, *plane,
    )  # fmt: skip
    return ViewWords(True, sampling, keys)


def _integrated(
    coloured: list[Solid], plain: list[Solid], colors: Array, surface: PartSurface
) -> list[dict[str, Any] | None]:
    """The balls of the height map; what is a prior in a colour of its own."""
    sides = mesh_sides(len(coloured) + len(plain))
    traces: list[dict[str, Any] | None] = []
    for solids, title in ((coloured, "balls, integrated normals"), (plain, "balls without a plane")):
        if not solids:
            continue
        mesh = ball_mesh(solids, surface, sides)
        points = mesh.vertices.shape[1]
        look: dict[str, Any] = {"color": PLAIN}
        if solids is coloured:
            look = {"intensity": packed(np.repeat(colors, points)), "coloraxis": "coloraxis"}
        if len(mesh.measured):
            traces.append(mesh_trace(mesh.vertices, mesh.measured, name=title, **look))
        if len(mesh.prior):
            # Only the vertices that are needed: often a handful.
            used, faces = np.unique(mesh.prior, return_inverse=True)
            vertices = mesh.vertices.reshape(-1, 3)[used]
            traces.append(mesh_trace(vertices, faces, name="from a prior, not measured", color=PRIOR))
    return traces


def _frame(known: Array, result: dict[str, Any], solids: list[Solid], board: Board) -> dict[str, Any]:
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
    camera = {"eye": {"x": 0.5, "y": -1.75, "z": 1.1}, "center": {"x": 0.0, "y": 0.0, "z": -0.2}}
    return {
        "aspectmode": "manual",
        "aspectratio": ratio,
        "camera": camera,
        "domain": {"x": [0, 1], "y": [0.05, 1]},
        **axes,
    }


def _board_of(result: dict[str, Any]) -> Board:
    """The board's height at x, y; unknown terms count as 0."""
    c = np.array([value if is_known(value) else 0.0 for value in result["board_coefficients_um"]])
    return lambda x, y: c[0] + c[1] * x + c[2] * y + c[3] * x * x + c[4] * x * y + c[5] * y * y


def _rectangle(known: Array, margin_um: float, count: int) -> tuple[Array, Array]:
    low, high = known.min(axis=0) - margin_um, known.max(axis=0) + margin_um
    x, y = np.meshgrid(np.linspace(low[0], high[0], count), np.linspace(low[1], high[1], count))
    return x, y


def _fitted_board(known: Array, radius_um: float, board: Board) -> dict[str, Any]:
    x, y = _rectangle(known, MARGIN_RADII * radius_um, BOARD_POINTS)
    z = np.broadcast_to(board(x, y), x.shape)
    return grid_trace(x[0], y[:, 0], z, BOARD, name="board, fitted")


def _planes(result: dict[str, Any], solids: list[Solid], known: Array) -> list[dict[str, Any]]:
    """The worst seating plane, and the regression plane as the deviations from it say."""
    planes = []
    x, y = _rectangle(known, 2.0 * ball_radius(result), 2)
    look = {"opacity": 0.22}
    if result["seatings"]:
        seat = result["seatings"][0]
        if all(is_known(seat[key]) for key in ("slope_x", "slope_y", "offset_um")):
            z = seat["slope_x"] * x + seat["slope_y"] * y + seat["offset_um"]
            planes.append(grid_trace(x[0], y[:, 0], z, BLUE, name="seating plane", **look))
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
        planes.append(grid_trace(x[0], y[:, 0], z, PURPLE, name="regression plane", visible="legendonly", **look))
    return planes


def _apexes(solids: list[Solid], balls: list[dict[str, Any]]) -> dict[str, Any]:
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
        "marker": {
            "size": 3 if len(solids) <= MANY else 1.5,
            "color": [_apex_color(balls[solid.index]["verdict"]) for solid in solids],
        },
        "hovertemplate": "%{text}: height %{customdata[1]:.2f} µm<extra></extra>",
        "showlegend": False,
    }


def _apex_color(verdict: str) -> str:
    return {"pass": "#ffffff", "fail": FAIL, "undecided": "#E69F00"}[verdict]


def _rings(
    result: dict[str, Any],
    places: list[tuple[float, float] | None],
    drawn: set[int],
    board: Board,
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
    return {"type": "scatter3d", "mode": "lines", "name": "no ball or no height (on the board)", **points, **look}
