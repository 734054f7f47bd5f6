"""Spheroids of the 3-D view, as shadows and silhouettes gave them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from bgars.report.html.mesh import mesh_trace, repeated
from bgars.report.html.words import is_known

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["Solid", "cap_points", "caps", "disc_faces", "skirts", "solids_of"]

SKIRT_LEVELS = 3


@dataclass(frozen=True)
class Solid:
    """A ball that is measured whole; heights above the board under it."""

    index: int
    x_um: float
    y_um: float
    board_um: float
    radius_um: float
    centre_z_um: float
    top_um: float
    q: float


def solids_of(result: dict[str, Any], board: Callable[[float, float], Any]) -> list[Solid]:
    """The balls of which all that a spheroid needs was measured."""
    return [
        Solid(
            index, ball["x_um"], ball["y_um"], float(board(ball["x_um"], ball["y_um"])),
            ball["diameter_um"] / 2, ball["centre_z_um"], ball["top_um"], ball["aspect_ratio"] or 1.0,
        )
        for index, ball in enumerate(result["balls"])
        if _is_whole(ball)
    ]  # fmt: skip


def _is_whole(ball: dict[str, Any]) -> bool:
    lengths = (ball[name] for name in ("x_um", "y_um", "diameter_um", "centre_z_um", "top_um"))
    return (
        ball["present"]
        and all(map(is_known, lengths))
        and ball["diameter_um"] > 0
        and (ball["aspect_ratio"] or 1.0) > 0
    )


def cap_points(sides: int) -> int:
    """Vertices of a cap."""
    return 1 + _cap_rings(sides) * sides


def _cap_rings(sides: int) -> int:
    return max(4, sides // 4)


def _table(solids: list[Solid]) -> Array:
    """(7, n, 1) x, y, board, radius, centre, top, q of each ball."""
    rows = [(s.x_um, s.y_um, s.board_um, s.radius_um, s.centre_z_um, s.top_um, s.q) for s in solids]
    return np.moveaxis(np.array(rows, dtype=np.float64)[:, None, :], 2, 0)


def disc_faces(rings: int, sides: int) -> NDArray[np.int64]:
    """Triangles of a disc: its centre is point 0, then the points of each ring."""
    one = np.arange(sides)
    two = (one + 1) % sides
    faces = [np.column_stack([np.zeros(sides, dtype=np.int64), 1 + one, 1 + two])]
    for ring in range(rings - 1):
        inner, outer = 1 + ring * sides, 1 + (ring + 1) * sides
        faces += [
            np.column_stack([inner + one, outer + one, outer + two]),
            np.column_stack([inner + one, outer + two, inner + two]),
        ]
    return np.concatenate(faces)


def caps(solids: list[Solid], sides: int, **options: Any) -> dict[str, Any]:  # noqa: ANN401 - plotly's schema
    """Upper halves of the spheroids, cut off where the top is flat."""
    rings = _cap_rings(sides)
    slant, turn = np.meshgrid(
        np.linspace(0, np.pi / 2, rings + 1)[1:], np.arange(sides) * 2 * np.pi / sides, indexing="ij"
    )
    across = np.append(0.0, np.sin(slant).ravel())
    up = np.append(1.0, np.cos(slant).ravel())
    around = np.append(0.0, turn.ravel())
    x, y, board, radius, centre, top, q = _table(solids)
    # The apex is the measured top, whether the top is flat or not.
    z = np.minimum(centre + np.maximum(q * radius, top - centre) * up, top)
    vertices = np.stack([x + radius * across * np.cos(around), y + radius * across * np.sin(around), board + z], axis=2)
    return mesh_trace(vertices, repeated(disc_faces(rings, sides), len(solids), vertices.shape[1]), **options)


def skirts(solids: list[Solid], sides: int, from_across: float, **options: Any) -> dict[str, Any]:  # noqa: ANN401
    """The spheroids down to the board, from a ring above the equator (a part of the radius; 1 = the equator) on."""
    levels = SKIRT_LEVELS + (from_across < 1)
    x, y, board, radius, centre, _top, q = _table(solids)
    down, turn = np.meshgrid(np.arange(levels), np.arange(sides) * 2 * np.pi / sides, indexing="ij")
    steps = (down.ravel() - (from_across < 1)) / (SKIRT_LEVELS - 1)
    deepest = np.arcsin(np.clip(centre / (q * radius), 0.0, 1.0))
    slant = np.where(steps < 0, -np.arccos(from_across), deepest * steps)
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
    return mesh_trace(vertices, repeated(np.concatenate(faces), len(solids), vertices.shape[1]), **options)
