"""A still of the 3-D view: what is seen before it is opened, on paper, and where a browser draws no 3-D."""

from __future__ import annotations

from base64 import b64encode
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from bgars.report.color_ramp import rgb_of, viridis
from bgars.report.html.mesh import LIGHTING, unpacked
from bgars.report.painter import Painter

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["Still", "still_of"]

WIDTH_PX, MOST_HEIGHT_PX = 1160, 640
MARGIN = 0.03
LABEL_ROOM = 0.06
INK = "#77828d"
"""Legible on a white page and on a dark one."""
TO_LIGHT = np.array([-0.45, -0.45, 0.77])
LEAST_DEPTH = 1e-3
LEAST_SHAPE = 0.05
"""Height over width of a picture that is worth looking at, or the other way round."""


@dataclass(frozen=True)
class _View:
    """The camera of the figure: positions in um to places in the picture, and how far away they are."""

    middle: Array
    per_um: Array
    eye: Array
    axes: Array

    @classmethod
    def of(cls, scene: dict[str, Any]) -> _View:
        ranges = np.array([scene[f"{name}axis"]["range"] for name in "xyz"], dtype=np.float64)
        ratio = np.array([scene["aspectratio"][name] for name in "xyz"])
        eye, centre = (np.array([scene["camera"][key][name] for name in "xyz"]) for key in ("eye", "center"))
        forward = (centre - eye) / np.linalg.norm(centre - eye)
        right = np.cross(forward, (0.0, 0.0, 1.0))
        right /= np.linalg.norm(right)
        axes = np.stack([right, np.cross(right, forward), forward])
        return cls(ranges.mean(axis=1), ratio / (ranges[:, 1] - ranges[:, 0]), eye, axes)

    def __call__(self, points_um: Array) -> tuple[Array, Array]:
        """(..., 2) places, y up, and (...) depth."""
        seen = ((points_um - self.middle) * self.per_um - self.eye) @ self.axes.T
        depth = np.maximum(seen[..., 2], LEAST_DEPTH)
        return seen[..., :2] / depth[..., None], depth


@dataclass(frozen=True)
class Still:
    """A picture: PNG, width and height in pixels."""

    png: bytes
    width: int
    height: int

    @property
    def data_uri(self) -> str:
        """The file as an address that holds its content."""
        return f"data:image/png;base64,{b64encode(self.png).decode('ascii')}"


def still_of(figure: dict[str, Any]) -> Still | None:
    """Draw what the figure shows at first, on a transparent ground; None where its numbers are no part's.

    The board lies under everything and the planes over it: the camera looks down, and no apex is above the seating
    plane.
    """
    scene = figure["layout"]["scene"]
    view = _View.of(scene)
    shown = [trace for trace in figure["data"] if trace.get("visible", True) is True]
    grids = [trace for trace in shown if trace["type"] == "surface"]
    boards, planes = ([t for t in grids if ("opacity" in t) == is_plane] for is_plane in (False, True))
    layers = [_triangles(*_grid_faces(trace), view, ordered=False) for trace in boards]
    meshes = [_mesh_faces(trace) for trace in shown if trace["type"] == "mesh3d"]
    solids = [(corners, colors) for corners, colors in meshes if len(corners)]
    if solids:
        corners, colors = (np.concatenate([each[at] for each in solids]) for at in (0, 1))
        layers.append(_triangles(corners, colors, view, ordered=True))
    lines = [np.column_stack([_numbers(t[name]) for name in "xyz"]) for t in shown if t.get("mode") == "lines"]
    frame = _frame(scene)
    outline, _ = view(frame)
    sheets = [(view(corners)[0], color) for corners, color in map(_plane, planes)]
    places = np.concatenate(
        [outline, *(sheet for sheet, _ in sheets), *(each.corners.reshape(-1, 2) for each in layers)]
    )
    low, high = places.min(axis=0), places.max(axis=0)
    sides = high - low
    if not (np.isfinite(sides).all() and sides.min() > LEAST_SHAPE * sides.max()):
        return None
    painter, size = _canvas(low, high)
    _label(painter, outline, frame)
    for layer in layers[: len(boards)]:
        painter.polygons(layer.corners, layer.colors)
    for points in lines:
        for piece in _pieces(view(points)[0]):
            painter.line(piece, "#d55e00", 2.8)
    for layer in layers[len(boards) :]:
        painter.polygons(layer.corners, layer.colors)
    for sheet, color in sheets:
        painter.sheet(sheet, color, 0.15, 0.7)
    return Still(painter.png(), *size)


@dataclass(frozen=True)
class _Layer:
    corners: Array
    colors: Array


def _triangles(corners_um: Array, colors: Array, view: _View, *, ordered: bool) -> _Layer:
    """Shaded polygons (m, k, 2), the farthest first."""
    places, depth = view(corners_um)
    normal = np.cross(corners_um[:, 1] - corners_um[:, 0], corners_um[:, 2] - corners_um[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    towards = view.eye / view.per_um + view.middle - corners_um[:, 0]
    facing = (normal * towards).sum(axis=1, keepdims=True)
    if ordered:  # solids: what looks away is hidden
        seen = facing[:, 0] > 0
        places, depth, normal, colors = places[seen], depth[seen], normal[seen], colors[seen]
    else:
        normal *= np.sign(facing)
    shade = LIGHTING["ambient"] + LIGHTING["diffuse"] * np.maximum(normal @ TO_LIGHT, 0.0)
    order = np.argsort(-depth.mean(axis=1)) if ordered else slice(None)
    return _Layer(places[order], np.clip(colors * shade[:, None], 0.0, 1.0)[order])


def _mesh_faces(trace: dict[str, Any]) -> tuple[Array, Array]:
    """Corners (m, 3, 3) in um and colours (m, 3)."""
    points = np.column_stack([unpacked(trace[name]) for name in "xyz"]).astype(np.float64)
    faces = np.column_stack([unpacked(trace[name]) for name in "ijk"]).astype(np.int64)
    if "intensity" not in trace:
        return points[faces], np.broadcast_to(rgb_of(trace["color"]), (len(faces), 3))
    values = unpacked(trace["intensity"]).astype(np.float64)
    low, high = float(values.min()), float(values.max())
    level = (values[faces[:, 0]] - low) / (high - low) if high > low else np.full(len(faces), 0.5)
    return points[faces], viridis(level)


def _grid_faces(trace: dict[str, Any]) -> tuple[Array, Array]:
    x, y = np.meshgrid(unpacked(trace["x"]), unpacked(trace["y"]))
    points = np.stack([x, y, unpacked(trace["z"])], axis=2).astype(np.float64)
    one, two, three, four = points[:-1, :-1], points[:-1, 1:], points[1:, 1:], points[1:, :-1]
    corners = np.stack([one, two, three, four], axis=2).reshape(-1, 4, 3)
    corners = corners[np.isfinite(corners[..., 2]).all(axis=1)]
    return corners, np.broadcast_to(rgb_of(trace["colorscale"][0][1]), (len(corners), 3))


def _plane(trace: dict[str, Any]) -> tuple[Array, tuple[float, float, float]]:
    x, y, z = (unpacked(trace[name]).astype(np.float64) for name in "xyz")
    around = ((0, 0), (0, -1), (-1, -1), (-1, 0))
    return np.array([(x[col], y[row], z[row, col]) for row, col in around]), rgb_of(trace["colorscale"][0][1])


def _numbers(values: list[float | None]) -> Array:
    return np.array([np.nan if value is None else value for value in values], dtype=np.float64)


def _pieces(places: Array) -> list[Array]:
    """Lines between gaps."""
    return [piece[np.isfinite(piece[:, 0])] for piece in np.split(places, np.flatnonzero(np.isnan(places[:, 0])))]


def _frame(scene: dict[str, Any]) -> Array:
    """Front left, front right, back right, at the lowest height."""
    (left, right), (front, back), (low, _) = (scene[f"{name}axis"]["range"] for name in "xyz")
    return np.array([(left, front, low), (right, front, low), (right, back, low)])


def _canvas(low: Array, high: Array) -> tuple[Painter, tuple[int, int]]:
    """A picture of the places between two corners with room for labels, true to scale."""
    low, high = low - MARGIN * (high - low), high + MARGIN * (high - low)
    low[1] -= LABEL_ROOM * (high[1] - low[1])
    high[0] += 2.2 * LABEL_ROOM * (high[0] - low[0])
    wide, tall = high - low
    width = WIDTH_PX if tall * WIDTH_PX <= MOST_HEIGHT_PX * wide else int(MOST_HEIGHT_PX * wide / tall)
    size = width, max(1, int(width * tall / wide))
    return Painter.of(low, high, size), size


def _label(painter: Painter, outline: Array, frame: Array) -> None:
    """How wide and how deep the board is that is drawn."""
    painter.line(outline, INK, 1.7)
    for at, name in ((0, "x"), (1, "y")):
        length_mm = float(np.abs(frame[at + 1] - frame[at]).max()) / 1000.0
        middle = outline[at : at + 2].mean(axis=0) - painter.per_px * (0.0, 0.0 if at else 30.0)
        words = f"  {name}: {length_mm:.3g} mm" if at else f"{name}: {length_mm:.3g} mm"
        painter.text(words, middle, "la" if at else "ma", INK, 18.0)
