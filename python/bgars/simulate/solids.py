"""Balls and bridges as convex solids in world coordinates: their tops seen from above, and what rays hit.

A solid is convex, so it never shadows its own lit points, and a ray meets it in one interval.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from bgars.simulate.scene import Scene

__all__ = ["Array", "Bounds", "Cylinder", "Points", "Solid", "Spheroid", "solids_of"]

Array = NDArray[np.float64]
BRIDGE_ID = -1


class Points(NamedTuple):
    """Coordinates or vector components; arrays that broadcast."""

    x: Array
    y: Array
    z: Array


class Bounds(NamedTuple):
    """Box around the part of a solid above its board."""

    x0: float
    x1: float
    y0: float
    y1: float
    top: float


class Solid(Protocol):
    """What a scene is made of, besides its board."""

    @property
    def label(self) -> int:
        """Ball number from 1, or -1 for a bridge."""

    @property
    def bounds(self) -> Bounds:
        """Box around it."""

    def top_um(self, x_um: Array, y_um: Array) -> Array:
        """Height of the highest point above x, y; -inf beside the solid."""

    def normal(self, at: Points) -> Points:
        """Outward unit normal at points of the top."""

    def blocks(self, start: Points, toward: Points, length: float) -> NDArray[np.bool_]:
        """Whether ``start + t toward`` with 0 < t < length meets the solid; ``toward.z > 0``."""


@dataclass(frozen=True)
class Spheroid:
    """A ball: ``(x - x0)^2 + (y - y0)^2 + ((z - z0) / q)^2 <= R^2`` and ``z <= cut``."""

    label: int
    x_um: float
    y_um: float
    z_um: float
    radius_um: float
    q: float
    cut_um: float

    @property
    def bounds(self) -> Bounds:
        """Box around it."""
        reach = self.radius_um
        return Bounds(self.x_um - reach, self.x_um + reach, self.y_um - reach, self.y_um + reach, self.cut_um)

    def top_um(self, x_um: Array, y_um: Array) -> Array:
        """Height of the top, -inf outside the silhouette."""
        across, up = x_um - self.x_um, y_um - self.y_um
        inside = self.radius_um**2 - across * across - up * up
        top = np.minimum(self.z_um + self.q * np.sqrt(np.maximum(inside, 0.0)), self.cut_um)
        return np.where(inside > 0.0, top, -np.inf)

    def normal(self, at: Points) -> Points:
        """Gradient of the spheroid's equation; (0, 0, 1) on the flat."""
        across, up, high = at.x - self.x_um, at.y - self.y_um, (at.z - self.z_um) / self.q**2
        length = np.sqrt(across * across + up * up + high * high)
        flat = at.z >= self.cut_um if self.cut_um < self.z_um + self.q * self.radius_um else np.zeros_like(length, bool)
        return Points(
            np.where(flat, 0.0, across / length), np.where(flat, 0.0, up / length), np.where(flat, 1.0, high / length)
        )

    def blocks(self, start: Points, toward: Points, length: float) -> NDArray[np.bool_]:
        """Exact ray-spheroid test, in coordinates where the spheroid is a sphere."""
        across, up, high = start.x - self.x_um, start.y - self.y_um, (start.z - self.z_um) / self.q
        rise = toward.z / self.q
        square = toward.x * toward.x + toward.y * toward.y + rise * rise
        half = across * toward.x + up * toward.y + high * rise
        rest = across * across + up * up + high * high - self.radius_um**2
        root = half * half - square * rest
        spread = np.sqrt(np.maximum(root, 0.0))
        enter, leave = (-half - spread) / square, (-half + spread) / square
        leave = np.minimum(leave, (self.cut_um - start.z) / toward.z)
        return np.asarray((root > 0.0) & (np.maximum(enter, 0.0) < np.minimum(leave, length)))


@dataclass(frozen=True)
class Cylinder:
    """A bridge: a cylinder from a to b, cut off at right angles inside the balls."""

    label: int
    ends: tuple[int, int]
    start: tuple[float, float, float]
    axis: tuple[float, float, float]
    length_um: float
    radius_um: float

    @property
    def bounds(self) -> Bounds:
        """Box around it."""
        far = [a + u * self.length_um for a, u in zip(self.start, self.axis, strict=True)]
        reach = self.radius_um
        return Bounds(
            min(self.start[0], far[0]) - reach,
            max(self.start[0], far[0]) + reach,
            min(self.start[1], far[1]) - reach,
            max(self.start[1], far[1]) + reach,
            max(self.start[2], far[2]) + reach,
        )

    def top_um(self, x_um: Array, y_um: Array) -> Array:
        """Height of the top: where a vertical line leaves the cylinder."""
        zero = np.zeros_like(x_um * y_um)
        _, leave = self._interval(Points(x_um + zero, y_um + zero, zero), Points(zero, zero, zero + 1.0))
        return leave

    def normal(self, at: Points) -> Points:
        """From the axis straight out."""
        x, y, z, _ = self._beside(at.x - self.start[0], at.y - self.start[1], at.z - self.start[2])
        return Points(x / self.radius_um, y / self.radius_um, z / self.radius_um)

    def blocks(self, start: Points, toward: Points, length: float) -> NDArray[np.bool_]:
        """Exact ray-cylinder test."""
        enter, leave = self._interval(start, toward)
        return np.asarray(np.maximum(enter, 0.0) < np.minimum(leave, length))

    def _beside(self, x: Array, y: Array, z: Array) -> tuple[Array, Array, Array, Array]:
        """Part of a vector at right angles to the axis, and the part along it."""
        along = x * self.axis[0] + y * self.axis[1] + z * self.axis[2]
        return x - along * self.axis[0], y - along * self.axis[1], z - along * self.axis[2], along

    def _interval(self, start: Points, toward: Points) -> tuple[Array, Array]:
        """Where rays enter and leave; leave = -inf where they miss."""
        px, py, pz, place = self._beside(start.x - self.start[0], start.y - self.start[1], start.z - self.start[2])
        dx, dy, dz, pace = self._beside(toward.x, toward.y, toward.z)
        # A ray along the axis has no square; bridges are level and lights above the board, so a tiny one will do.
        square = np.maximum(dx * dx + dy * dy + dz * dz, 1e-30)
        half = px * dx + py * dy + pz * dz
        root = half * half - square * (px * px + py * py + pz * pz - self.radius_um**2)
        spread = np.sqrt(np.maximum(root, 0.0))
        enter, leave = (-half - spread) / square, (-half + spread) / square
        # The slab between the two ends.
        pace = np.where(np.abs(pace) < 1e-15, 1e-15, pace)  # noqa: PLR2004 - at right angles to the axis
        near, far = (0.0 - place) / pace, (self.length_um - place) / pace
        enter = np.maximum(enter, np.minimum(near, far))
        leave = np.minimum(leave, np.maximum(near, far))
        return enter, np.where((root > 0.0) & (leave > enter), leave, -np.inf)


def solids_of(scene: Scene) -> list[Solid]:
    """Place the balls and bridges of a scene on its board, in world coordinates."""
    solids: list[Solid] = []
    centres: dict[str, tuple[int, tuple[float, float, float], float]] = {}
    for label, ball in enumerate(scene.balls, start=1):
        if not ball.present:
            continue
        ground_um = float(scene.board.height_um(np.array(ball.x_um), np.array(ball.y_um)))
        centre = (ball.x_um, ball.y_um, ground_um + ball.centre_z_um)
        centres[ball.name] = (label, centre, ground_um)
        solids.append(Spheroid(label, *centre, ball.radius_um, ball.aspect_ratio, ground_um + ball.top_um))
    heights = {ball.name: ball.centre_z_um for ball in scene.balls}
    for bridge in scene.bridges:
        (first, start, ground_a), (second, end, ground_b) = centres[bridge.first], centres[bridge.second]
        z_um = bridge.z_um if bridge.z_um is not None else (heights[bridge.first] + heights[bridge.second]) / 2
        start, end = (*start[:2], ground_a + z_um), (*end[:2], ground_b + z_um)
        length_um = math.dist(start, end)
        axis = tuple((b - a) / length_um for a, b in zip(start, end, strict=True))
        solids.append(
            Cylinder(BRIDGE_ID, (first, second), start, (axis[0], axis[1], axis[2]), length_um, bridge.radius_um)
        )
    return solids
