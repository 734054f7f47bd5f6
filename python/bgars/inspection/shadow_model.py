r"""The shadow of a spheroid on the board: signed distance to its edge, derivatives, points on the edge.

A ray from the board point P to the light meets the spheroid with horizontal semi-axis R and vertical semi-axis q R when
it passes its centre closer than R, in a space where heights are divided by q (the spheroid becomes a sphere there).
With
w = P - C and u the unit vector to the light,

    D = |w - (w . u) u|,    d = (D - R) / |grad D|

is the distance of P to the edge of the shadow on the board, positive outside, exact at the edge. On a flat board and
for
a distant light, D = R is an ellipse with centre c_xy - c_z l_xy / l_z and semi-axes R and R / l_z.
For a near light u points from P to the lamp, and the edge is the cut of its tangent cone with the board.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bgars.inspection.board import Board

__all__ = [
    "Balls",
    "Edge",
    "Lights",
    "Nearby",
    "Rays",
    "edge_at",
    "light_derivatives",
    "near_edge",
    "rays",
]

Array = NDArray[np.float64]

BALL_TERMS = 5
DESCENTS = 3
"""Newton steps from the tangent point down to a bowed board; one is exact on a plane."""


@dataclass(frozen=True)
class Balls:
    """Parameters of balls, arrays of one shape, in pixels.

    Attributes
    ----------
    x, y, z : ndarray
        Centre; z above the board under it.
    radius : ndarray
        Horizontal semi-axis.
    q : ndarray
        Vertical over horizontal semi-axis.
    """

    x: Array
    y: Array
    z: Array
    radius: Array
    q: Array

    @classmethod
    def from_table(cls, table: Array) -> Balls:
        """(N, 5) rows x, y, z, radius, q."""
        return cls(*np.ascontiguousarray(table.T))

    def spread(self, extra: int) -> Balls:
        """The same with `extra` trailing axes of length 1."""
        index = (...,) + (None,) * extra
        return Balls(self.x[index], self.y[index], self.z[index], self.radius[index], self.q[index])

    def take(self, index: NDArray[np.intp]) -> Balls:
        """Entries along the first axis."""
        return Balls(self.x[index], self.y[index], self.z[index], self.radius[index], self.q[index])


@dataclass(frozen=True)
class Lights:
    """Lights, arrays of one shape: unit vectors, or positions in pixels where `near`."""

    x: Array
    y: Array
    z: Array
    near: bool

    @classmethod
    def from_table(cls, table: Array, near: bool) -> Lights:
        """(L, 3) rows."""
        x, y, z = np.ascontiguousarray(table.T)
        return cls(x, y, z, near)

    def spread(self, before: int, after: int) -> Lights:
        """The same with leading and trailing axes of length 1."""
        index = (None,) * before + (...,) + (None,) * after
        return Lights(self.x[index], self.y[index], self.z[index], self.near)

    def take(self, index: NDArray[np.intp]) -> Lights:
        """Entries along the first axis."""
        return Lights(self.x[index], self.y[index], self.z[index], self.near)


class Rays(NamedTuple):
    """The rays from board points to a light, as they pass a ball (scaled space).

    `distance` D to the centre; `outward` unit vector from the centre to the closest point; `along` the way from the
    board to that point; `lever` = 1 - along / (way to the lamp), 1 for distant lights; `turn` how far that point
    moves when
    the light's vector changes by 1; `gradient_x`, `gradient_y` of D on the board; `toward_x`, `toward_y`, `toward_z`
    of u.
    """

    distance: Array
    outward_x: Array
    outward_y: Array
    outward_z: Array
    along: Array
    lever: Array
    turn: Array
    gradient_x: Array
    gradient_y: Array
    toward_x: Array
    toward_y: Array
    toward_z: Array

    @property
    def slope(self) -> Array:
        """Length of the gradient of D on the board."""
        return np.hypot(self.gradient_x, self.gradient_y)

    @property
    def curvature(self) -> Array:
        """Of the edge on the board, 1 / px, where the rays graze the ball."""
        along = (self.toward_y * self.gradient_x - self.toward_x * self.gradient_y) / self.slope
        bent: Array = (1.0 - along**2) / (self.distance * self.slope)
        return bent


def rays(x: Array, y: Array, balls: Balls, lights: Lights, board: Board) -> Rays:
    """Rays from board points (x, y) past balls to lights; everything broadcasts."""
    if board.is_flat:
        ground: Array | float = 0.0
        under: Array | float = 0.0
    else:
        ground, under = board.height(x, y), board.height(balls.x, balls.y)
    across_x, across_y = x - balls.x, y - balls.y
    drop = (ground - under - balls.z) / balls.q
    if lights.near:
        to_x, to_y, to_z = lights.x - x, lights.y - y, (lights.z - ground) / balls.q
        inverse = 1.0 / np.sqrt(to_x * to_x + to_y * to_y + to_z * to_z)
        to_x, to_y, to_z = to_x * inverse, to_y * inverse, to_z * inverse
    else:
        to_z = lights.z / balls.q
        inverse = 1.0 / np.sqrt(lights.x * lights.x + lights.y * lights.y + to_z * to_z)
        to_x, to_y, to_z = lights.x * inverse, lights.y * inverse, to_z * inverse
    along = -(across_x * to_x + across_y * to_y + drop * to_z)
    foot_x, foot_y, foot_z = across_x + along * to_x, across_y + along * to_y, drop + along * to_z
    distance = np.sqrt(foot_x * foot_x + foot_y * foot_y + foot_z * foot_z)
    inverse_distance = 1.0 / np.maximum(distance, 1e-9)
    out_x, out_y, out_z = foot_x * inverse_distance, foot_y * inverse_distance, foot_z * inverse_distance
    turn = along * inverse
    lever = 1.0 - turn if lights.near else np.ones(turn.shape)
    if board.is_flat:
        gradient_x, gradient_y = lever * out_x, lever * out_y
    else:
        slope_x, slope_y = board.slopes(x, y)
        rise = out_z / balls.q
        gradient_x, gradient_y = lever * (out_x + rise * slope_x), lever * (out_y + rise * slope_y)
    return Rays(distance, out_x, out_y, out_z, along, lever, turn, gradient_x, gradient_y, to_x, to_y, to_z)


class Nearby(NamedTuple):
    """Signed distance to an edge around points on it, to second order: (M,) constants of M points.

    With P the displacement on the board from a point on the edge, p its component across the rays (heights over q) and
    k = lever, ``D^2 = D0^2 + 2 D0 grad . P + k^2 |p|^2`` is exact on a plane; along the normal of the edge
    ``D = D0 + slope d + bend d^2 / 2``.
    """

    centre: Array
    first_x: Array
    first_y: Array
    second_xx: Array
    second_xy: Array
    second_yy: Array
    inverse_slope: Array
    half_bend: Array

    def distance(self, dx: Array, dy: Array) -> Array:
        """Signed distance to the edge at displacements (..., M), positive outside."""
        square = dx * (self.first_x + self.second_xx * dx + self.second_xy * dy) + dy * (
            self.first_y + self.second_yy * dy
        )
        square += self.centre * self.centre
        distance: Array = (np.sqrt(np.maximum(square, 0.0)) - self.centre) * self.inverse_slope
        return distance - self.half_bend * distance * distance


def near_edge(beam: Rays, x: Array, y: Array, balls: Balls, board: Board) -> Nearby:
    """Constants for the distance around points of an edge, (M,) each."""
    slope_x, slope_y = board.slopes(x, y)
    slope_x, slope_y = slope_x / balls.q, slope_y / balls.q
    along_x, along_y = beam.toward_x + slope_x * beam.toward_z, beam.toward_y + slope_y * beam.toward_z
    square = beam.lever**2
    xx = square * (1.0 + slope_x**2 - along_x**2)
    yy = square * (1.0 + slope_y**2 - along_y**2)
    xy = square * (slope_x * slope_y - along_x * along_y)
    slope = beam.slope
    normal_x, normal_y = beam.gradient_x / slope, beam.gradient_y / slope
    across = xx * normal_x**2 + 2.0 * xy * normal_x * normal_y + yy * normal_y**2
    bend = (across - slope**2) / beam.distance
    double = 2.0 * beam.distance
    return Nearby(
        beam.distance,
        double * beam.gradient_x,
        double * beam.gradient_y,
        xx,
        2.0 * xy,
        yy,
        1.0 / slope,
        0.5 * bend / slope,
    )


class Edge(NamedTuple):
    """Points on the edge of a shadow: where, and the height above the board of the tangent point that throws them."""

    x: Array
    y: Array
    tangent_height: Array


def edge_at(angle: Array, balls: Balls, lights: Lights, board: Board) -> Edge:
    """Points of the shadow's edge by the angle of their tangent point on the terminator.

    Parameters
    ----------
    angle : ndarray, radians
        0 = top of the terminator, which throws the far tip; +-pi/2 = the points at the height of the centre.
    """
    under = 0.0 if board.is_flat else board.height(balls.x, balls.y)
    if lights.near:
        to_x, to_y, to_z = lights.x - balls.x, lights.y - balls.y, (lights.z - under - balls.z) / balls.q
    else:
        to_x, to_y, to_z = lights.x, lights.y, lights.z / balls.q
    length = np.sqrt(to_x * to_x + to_y * to_y + to_z * to_z)
    to_x, to_y, to_z = to_x / length, to_y / length, to_z / length
    level = np.maximum(np.hypot(to_x, to_y), 1e-9)
    side_x, side_y = -to_y / level, to_x / level
    up_x, up_y, up_z = -to_z * to_x / level, -to_z * to_y / level, level
    if lights.near:
        forward = balls.radius * balls.radius / length
        ring = balls.radius * np.sqrt(np.maximum(1.0 - (balls.radius / length) ** 2, 0.0))
    else:
        forward, ring = np.zeros(()), balls.radius
    cosine, sine = ring * np.cos(angle), ring * np.sin(angle)
    tangent_x = balls.x + forward * to_x + cosine * up_x + sine * side_x
    tangent_y = balls.y + forward * to_y + cosine * up_y + sine * side_y
    tangent_z = under + balls.z + balls.q * (forward * to_z + cosine * up_z)
    if lights.near:
        ray_x, ray_y, ray_z = lights.x - tangent_x, lights.y - tangent_y, lights.z - tangent_z
    else:
        ray_x, ray_y, ray_z = lights.x, lights.y, lights.z
    way = tangent_z / ray_z
    if not board.is_flat:
        for _ in range(DESCENTS):
            way = (
                way + (tangent_z - way * ray_z - board.height(tangent_x - way * ray_x, tangent_y - way * ray_y)) / ray_z
            )
    ground = 0.0 if board.is_flat else board.height(tangent_x, tangent_y)
    return Edge(tangent_x - way * ray_x, tangent_y - way * ray_y, tangent_z - ground)


def light_derivatives(beam: Rays, balls: Balls, tangents: tuple[Array, Array]) -> Array:
    """(..., 2) derivatives of D by turning each light along its two tangents, in radians.

    `tangents`: two arrays (..., 3), the change of direction (distant) or position (near) per radian.
    """
    parts = [
        beam.turn
        * (beam.outward_x * way[..., 0] + beam.outward_y * way[..., 1] + beam.outward_z * way[..., 2] / balls.q)
        for way in tangents
    ]
    return np.stack(parts, axis=-1)
