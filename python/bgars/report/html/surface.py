"""The integrated surface in the 3-D view: the height map, read around each ball and over the board."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from bgars.report.html.mesh import grid_trace, repeated
from bgars.report.html.solids import disc_faces

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bgars.records.part_surface import PartSurface
    from bgars.report.html.solids import Solid

    Array = NDArray[np.float64]

__all__ = ["OUTERMOST", "BallMesh", "ball_mesh", "board_trace", "mesh_sides"]

POINTS_OF_ALL = 40_000
"""What the balls may cost together; under 65,536 an index takes two bytes."""
FEWEST_SIDES, MOST_SIDES = 10, 48
OUTERMOST = 0.97
"""Where a ball is read to, of its radius: further out a pixel shows the rim."""
MOST_BOARD_SAMPLES = 200
"""Samples of the board along the longer side of the image: six a pitch of 32 x 32 balls, enough to go around each."""


@dataclass(frozen=True)
class BallMesh:
    """Balls as triangles.

    Attributes
    ----------
    vertices : (n, points, 3)
        Of each ball; um.
    measured, prior : (m, 3) integer
        Faces between measured samples, and those with one at least that is drawn from a prior.
    """

    vertices: Array
    measured: NDArray[np.int64]
    prior: NDArray[np.int64]


def mesh_sides(count: int) -> int:
    """Directions in which each of so many balls is read; rings are half as many."""
    return int(np.clip(math.sqrt(2 * POINTS_OF_ALL / max(count, 1)), FEWEST_SIDES, MOST_SIDES)) // 2 * 2


def ball_mesh(solids: list[Solid], surface: PartSurface, sides: int) -> BallMesh:
    """Read the balls' height map at the centre and on rings around it, closer together toward the rim."""
    rings = sides // 2
    slant, turn = np.meshgrid(
        np.arcsin(OUTERMOST) * np.arange(1, rings + 1) / rings, 2 * np.pi * np.arange(sides) / sides, indexing="ij"
    )
    across = np.append(0.0, np.sin(slant).ravel())
    around = np.append(0.0, turn.ravel())
    centres = np.array([(solid.x_um, solid.y_um, solid.radius_um) for solid in solids])[:, None, :]
    x = centres[..., 0] + centres[..., 2] * across * np.cos(around)
    y = centres[..., 1] + centres[..., 2] * across * np.sin(around)
    z, measured = _read(surface, x, y)
    faces = disc_faces(rings, sides)
    every = repeated(faces, len(solids), x.shape[1])
    known = np.isfinite(z).ravel()[every].all(axis=1)
    sure = measured.ravel()[every].all(axis=1)
    vertices = np.stack([x, y, np.nan_to_num(z)], axis=2)
    return BallMesh(vertices, every[known & sure], every[known & ~sure])


def _read(surface: PartSurface, x: Array, y: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Heights between samples, the mean of the known ones around, and whether all of these are measured."""
    rows, cols = surface.ball_height_um.shape
    step, pitch = surface.ball_step_px, surface.pixel_pitch_um
    row = (surface.shape_px[0] / 2 - 0.5 - y / pitch) / step
    col = (x / pitch + surface.shape_px[1] / 2 - 0.5) / step
    total, weight = np.zeros(x.shape), np.zeros(x.shape)
    measured = np.ones(x.shape, np.bool_)
    first_row, first_col = np.floor(row), np.floor(col)
    for down in (0, 1):
        for right in (0, 1):
            at_row, at_col = first_row + down, first_col + right
            share = (1 - abs(row - at_row)) * (1 - abs(col - at_col))
            inside = (at_row >= 0) & (at_row < rows) & (at_col >= 0) & (at_col < cols)
            place = np.where(inside, at_row, 0).astype(np.int64), np.where(inside, at_col, 0).astype(np.int64)
            height = surface.ball_height_um[place].astype(np.float64)
            known = inside & np.isfinite(height) & (share > 0)
            total += np.where(known, share * height, 0.0)
            weight += np.where(known, share, 0.0)
            measured &= ~known | surface.ball_measured[place]
    z = np.divide(total, weight, out=np.full(x.shape, np.nan), where=weight > 0)
    return z, measured & (weight > 0)


def board_trace(surface: PartSurface, low: Array, high: Array, color: str, **options: Any) -> dict[str, Any] | None:  # noqa: ANN401
    """The board between low (x, y) and high, thinned; None where nothing of it is known there."""
    height_um, pitch = surface.board_height_um, surface.pixel_pitch_um
    x = (surface.board_step_px * np.arange(height_um.shape[1]) + 0.5 - surface.shape_px[1] / 2) * pitch
    y = (surface.shape_px[0] / 2 - surface.board_step_px * np.arange(height_um.shape[0]) - 0.5) * pitch
    cols, rows = np.flatnonzero((x >= low[0]) & (x <= high[0])), np.flatnonzero((y >= low[1]) & (y <= high[1]))
    thin = max(1, math.ceil(max(len(cols), len(rows)) / MOST_BOARD_SAMPLES))
    rows, cols = rows[::thin], cols[::thin]
    z = height_um[np.ix_(rows, cols)].astype(np.float64)
    if min(z.shape) < len(("one", "two")) or not np.isfinite(z).any():
        return None
    return grid_trace(np.asarray(x[cols], np.float64), np.asarray(y[rows], np.float64), z, color, **options)
