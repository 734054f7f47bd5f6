"""The surface of a ball, whatever its defect: points and normals for directions from its centre."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np
from setup_records import Bulge, Coined, Oval, Tilted

if TYPE_CHECKING:
    from balls import Ball
    from numpy.typing import NDArray

COINED_EDGE_MM = 0.004
"""Rounding of the edge of a coined top."""
NORMAL_STEP = 1e-4
"""Half step (radians) of the differences that give normals."""


def surface_mm(ball: Ball, squash: float, directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (mm, shape of `directions`) in unit directions (..., 3) from the centre of a ball."""
    axes = _axes(ball, squash)
    stretch = np.broadcast_to(_stretch(ball, directions), directions.shape[:-1])
    centre = [ball.x_mm, ball.y_mm, ball.centre_z_mm]
    points: NDArray[np.float64] = (directions @ axes.T) * np.expand_dims(stretch, -1) + centre
    if isinstance(ball.defect, Coined):
        cut, edge, z = ball.centre_z_mm + axes[2, 2] - ball.defect.depth_mm, COINED_EDGE_MM, points[..., 2]
        points[..., 2] = np.where(z < cut - 10 * edge, z, -edge * np.logaddexp(-z / edge, -cut / edge))
    return points


def _axes(ball: Ball, squash: float) -> NDArray[np.float64]:
    """Matrix (3, 3) that takes the unit sphere to an ellipsoid."""
    defect, radius = ball.defect, ball.radius_mm
    if isinstance(defect, Tilted):
        tilt, direction = np.deg2rad([defect.tilt_deg, defect.direction_deg])
        turn = cv2.Rodrigues(np.array([-np.sin(direction), np.cos(direction), 0]) * tilt)[0]
        return np.asarray(turn @ np.diag([radius, radius, defect.q * radius]) @ turn.T)
    if isinstance(defect, Oval):
        angle = np.deg2rad(defect.direction_deg)
        cos, sin = np.cos(angle), np.sin(angle)
        turn = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
        return np.asarray(turn @ np.diag([radius * defect.along, radius * defect.across, radius]) @ turn.T)
    return np.diag([radius, radius, radius * squash])


def _stretch(ball: Ball, directions: NDArray[np.float64]) -> NDArray[np.float64] | float:
    """Factor of the radius in each direction."""
    bulge = ball.defect
    if not isinstance(bulge, Bulge):
        return 1.0
    polar, azimuth = np.deg2rad([bulge.polar_deg, bulge.azimuth_deg])
    middle = np.array([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)])
    angle = np.arccos(np.clip(directions @ middle, -1, 1))
    return np.asarray(1.0 + bulge.height * np.exp(-0.5 * (angle / np.deg2rad(bulge.width_deg)) ** 2))


def normals_of(ball: Ball, squash: float, directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Outward unit normals, shape of `directions`."""
    helper = np.where(np.abs(directions[..., 2:]) < 0.9, [0, 0, 1.0], [1.0, 0, 0])
    first = unit(np.cross(directions, helper))

    def slope(tangent: NDArray[np.float64]) -> NDArray[np.float64]:
        ahead, behind = unit(directions + NORMAL_STEP * tangent), unit(directions - NORMAL_STEP * tangent)
        return surface_mm(ball, squash, ahead) - surface_mm(ball, squash, behind)

    normals = unit(np.cross(slope(first), slope(np.cross(directions, first))))
    return np.asarray(normals * np.sign((normals * directions).sum(-1, keepdims=True)))


def unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Vectors (..., 3) of length 1."""
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))
