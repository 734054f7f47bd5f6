"""The mesh of all balls, and what it says about them: tops and outlines are those of the rendered surface."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np
from atlas import COLUMNS, TILE, rows_of
from ball_surface import normals_of, surface_mm
from balls import Ball, BallTruth
from ply import Mesh

if TYPE_CHECKING:
    from numpy.typing import NDArray

POLAR, AZIMUTH = 220, 360
"""Points from pole to pole, and around."""


def mesh_balls(balls: list[Ball], squash: float) -> tuple[Mesh, list[BallTruth]]:
    """One mesh of all balls, texture coordinates in the atlas; and their truth."""
    polar, azimuth = np.meshgrid(np.linspace(0, np.pi, POLAR), np.linspace(0, 2 * np.pi, AZIMUTH + 1), indexing="ij")
    directions = np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], -1)
    meshes, truths = [], []
    for index, ball in enumerate(balls):
        points, normals = surface_mm(ball, squash, directions), normals_of(ball, squash, directions)
        row, col = divmod(ball.number - 1, COLUMNS)
        u = (col + (0.5 + azimuth / (2 * np.pi) * (TILE[1] - 1)) / TILE[1]) / COLUMNS
        v = (row + (0.5 + polar / np.pi * (TILE[0] - 1)) / TILE[0]) / rows_of(len(balls))
        faces = _faces() + index * POLAR * (AZIMUTH + 1)
        meshes.append(Mesh(points.reshape(-1, 3), normals.reshape(-1, 3), np.stack([u, v], -1).reshape(-1, 2), faces))
        truths.append(_truth(ball, points))
    return Mesh(*(np.vstack(arrays) for arrays in zip(*meshes, strict=True))), truths


def _faces() -> NDArray[np.int64]:
    across = AZIMUTH + 1
    corner = (np.arange(POLAR - 1)[:, None] * across + np.arange(across - 1)[None]).ravel()
    upper = np.stack([corner, corner + across, corner + 1], -1)
    lower = np.stack([corner + 1, corner + across, corner + across + 1], -1)
    return np.vstack([upper, lower])


def _truth(ball: Ball, points: NDArray[np.float64]) -> BallTruth:
    """Top and silhouette above the board; `points` (polar, azimuth, 3)."""
    height = points[..., 2] - ball.board_z_mm
    above = height > 0
    # Where each meridian meets the board.
    below, meridian = np.clip(above.argmin(0), 1, POLAR - 1), np.arange(AZIMUTH + 1)
    upper, lower = height[below - 1, meridian], height[below, meridian]
    share = np.clip(upper / np.maximum(upper - lower, 1e-9), 0, 1)[:, None]
    foot = points[below - 1, meridian, :2] * (1 - share) + points[below, meridian, :2] * share
    hull = cv2.convexHull(np.vstack([points[above][:, :2], foot]).astype(np.float32))
    x, y = hull[:, 0].astype(float).T
    x_next, y_next = np.roll(x, -1), np.roll(y, -1)
    cross = x * y_next - x_next * y
    area = 0.5 * np.sum(cross)
    x_centre, y_centre = np.sum((x + x_next) * cross) / (6 * area), np.sum((y + y_next) * cross) / (6 * area)
    diameter = 2 * np.sqrt(abs(area) / np.pi)
    return BallTruth(ball, float(points[..., 2].max()), float(x_centre), float(y_centre), float(diameter))
