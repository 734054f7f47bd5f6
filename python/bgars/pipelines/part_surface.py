"""From the normals of an inspection to the part's surface: integrated, and held by the heights that shadows gave."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from bgars.records.anchors import Anchors
from bgars.records.part_surface import PartSurface
from bgars.surface.integrate import integrate_normals
from bgars.surface.part_anchors import anchors_from_part

if TYPE_CHECKING:
    from bgars.records.height_map import HeightMap
    from bgars.records.normal_field import NormalField
    from bgars.records.part_result import PartResult
    from bgars.records.pixels import FloatArray

__all__ = ["part_surface"]

MOST_SAMPLES = 2_000_000
"""Balls are thinned until the map has at most so many samples."""
GRAIN_UM = 1 / 64
"""Heights are rounded to this: far below their noise, and half the size of a compressed file."""


def part_surface(
    result: PartResult, balls: NormalField, board: NormalField | None, board_step_px: int, *, threads: int | None = None
) -> PartSurface | None:
    """Integrate the normals of an inspection to metric heights; None where no ball has a measured height.

    Parameters
    ----------
    result : PartResult
        Whose ball tops and board hold the surface.
    balls : NormalField
        Of all pixels of balls.
    board : NormalField or None
        Of every `board_step_px`-th row and column, at least.
    board_step_px : int
        Distance of its pixels.
    threads : int, optional
        Largest number of threads.

    Notes
    -----
    Each ball is a region of its own and is moved as a whole onto the spheroid of its shadows, so that its shape is that
    of its normals alone; balls without a height float freely and are left out. See :func:`bgars.anchors_from_part`.
    """
    pitch_um, shape = result.pixel_pitch_um, balls.mask.shape
    if not any(
        ball.present and math.isfinite(ball.top_um) and math.isfinite(ball.diameter_um) for ball in result.balls
    ):
        return None
    known = anchors_from_part(result, (shape[0], shape[1]))
    regions = np.zeros(shape, np.int32) if known.regions is None else np.asarray(known.regions, np.int32)
    step = max(1, math.ceil(math.sqrt(regions.size / MOST_SAMPLES)))
    on_ball = (regions > 0) & balls.mask
    height_um = np.full(shape, np.nan, np.float32)
    if np.isfinite(known.height_um[on_ball]).any():
        anchors = Anchors(height_um=np.where(on_ball, known.height_um, np.nan), regions=regions)
        found = integrate_normals(balls, mask=on_ball, anchors=anchors, threads=threads)
        height_um = _held(found)
    return PartSurface(
        shape_px=(shape[0], shape[1]),
        pixel_pitch_um=pitch_um,
        ball_step_px=step,
        board_step_px=board_step_px,
        ball_height_um=_rounded(height_um[::step, ::step]),
        ball_measured=(balls.is_measured & np.isfinite(height_um))[::step, ::step].copy(),
        board_height_um=_board(known, regions, board, board_step_px, pitch_um, threads),
    )


def _board(
    known: Anchors,
    regions: np.ndarray[tuple[int, ...], np.dtype[np.int32]],
    field: NormalField | None,
    step: int,
    pitch_um: float,
    threads: int | None,
) -> FloatArray:
    """The board on its own coarse grid; the foot of a ball, which has no anchor, is left out."""
    height_um = known.height_um[::step, ::step]
    free = (regions[::step, ::step] == 0) & np.isfinite(height_um)
    seen = free if field is None else free & field.mask[::step, ::step]
    if field is None or not seen.any():
        return np.full(height_um.shape, np.nan, np.float32)
    found = integrate_normals(
        np.ascontiguousarray(field.normals[::step, ::step]),
        mask=seen,
        anchors=Anchors(height_um=np.where(seen, height_um, np.nan), reach_px={0: max(known.reach_px[0] / step, 1.0)}),
        pixel_pitch_um=step * pitch_um,
        threads=threads,
    )
    return _rounded(_held(found))


def _held(found: HeightMap) -> FloatArray:
    """Heights in um, NaN where no anchor holds the component."""
    height_um = np.full(found.mask.shape, np.nan, np.float32) if found.height_um is None else found.height_um.copy()
    floating = np.array([part.anchor_pixels == 0 for part in found.components] + [True])
    height_um[floating[found.labels]] = np.nan
    return height_um


def _rounded(height_um: FloatArray) -> FloatArray:
    rounded: FloatArray = (np.rint(height_um / GRAIN_UM) * GRAIN_UM).astype(np.float32)
    return rounded
