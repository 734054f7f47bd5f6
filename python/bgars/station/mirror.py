"""Reflection on a mirror ball: from a pixel to the direction that it shows, and back.

Points are (x, y, z) in pixels of the board plane: x right, y up, z toward the camera, origin = image centre there.
The ball rests on the board. The camera is telecentric, or a pinhole on the optical axis.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["Sphere", "image_of", "reflected", "sphere_of_outline"]

Array = NDArray[np.float64]

ROUNDS = 25
"""Fixed-point steps from a light to its highlight: each gains a factor of distance over radius."""


class Sphere(NamedTuple):
    """A ball in space."""

    centre_px: Array
    radius_px: float


def sphere_of_outline(outline_px: Array, camera_px: float = math.inf) -> Sphere:
    """Return the ball, resting on the board, whose outline is a circle (x, y, radius) of the image.

    Under a pinhole at height D a sphere of radius R that touches the board appears, at the scale of the board, with
    radius ``D R / sqrt(D^2 - 2 D R)`` around ``x (D - R) / (D - 2 R)``.

    Examples
    --------
    >>> sphere_of_outline(np.array([10.0, 0.0, 100.0])).centre_px.tolist()
    [10.0, 0.0, 100.0]
    >>> round(sphere_of_outline(np.array([10.0, 0.0, 100.0]), 4000.0).radius_px, 2)
    97.53
    """
    x, y, r = outline_px
    if math.isinf(camera_px):
        return Sphere(np.array([x, y, r]), float(r))
    radius = -(r**2) / camera_px + math.sqrt(r**4 / camera_px**2 + r**2)
    scale = (camera_px - 2.0 * radius) / (camera_px - radius)
    return Sphere(np.array([x * scale, y * scale, radius]), float(radius))


def reflected(points_px: Array, sphere: Sphere, camera_px: float = math.inf) -> tuple[Array, Array]:
    """Return what points of the image show in the mirror: where they meet the ball, and the direction reflected there.

    Parameters
    ----------
    points_px : (..., 2)
        In the image; points beside the ball take its rim.

    Returns
    -------
    hits_px : (..., 3)
    directions : (..., 3)
        Unit vectors, from the ball to what is seen.
    """
    centre, radius = sphere
    foot = np.concatenate([points_px, np.zeros((*points_px.shape[:-1], 1))], axis=-1)
    way = np.zeros_like(foot)
    way[..., 2] = -1.0
    if not math.isinf(camera_px):
        way = _unit(foot - np.array([0.0, 0.0, camera_px]))
    offset = foot - centre
    along = np.sum(offset * way, axis=-1)
    inside = along**2 - (np.sum(offset**2, axis=-1) - radius**2)
    hits = foot + (-along - np.sqrt(np.maximum(inside, 0.0)))[..., None] * way
    normals = _unit(hits - centre)
    return hits, _unit(way - 2.0 * np.sum(way * normals, axis=-1, keepdims=True) * normals)


def image_of(directions: Array, nearness: Array, sphere: Sphere, camera_px: float = math.inf) -> Array:
    """Return (L, 2) places of the highlights of lights in the image.

    Parameters
    ----------
    directions : (L, 3)
        Unit vectors from the origin to the lights.
    nearness : (L,)
        One over their distances from the origin, 1 / px; 0 = infinitely far.
    """
    centre, radius = sphere
    eye = np.array([0.0, 0.0, camera_px])
    hits = np.broadcast_to(centre, directions.shape)
    view = np.broadcast_to(np.array([0.0, 0.0, 1.0]), directions.shape)
    for _ in range(ROUNDS):
        if not math.isinf(camera_px):
            view = _unit(eye - hits)
        # The light stands at direction / nearness: seen from a point q it is in direction - nearness q.
        normals = _unit(_unit(directions - nearness[:, None] * hits) + view)
        hits = centre + radius * normals
    if math.isinf(camera_px):
        return np.array(hits[:, :2])
    scale = camera_px / (camera_px - hits[:, 2])
    return np.array(hits[:, :2] * scale[:, None])


def _unit(vectors: Array) -> Array:
    unit: Array = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    return unit
