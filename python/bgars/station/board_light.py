"""The light that a matt board sends up to a ball that rests on it, with the ball's own shadow on the board."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

__all__ = ["board_light"]

Array = NDArray[np.float64]

RINGS, AROUND = 24, 48
"""Points of the board: rings that end far away, and points on each."""
FARTHEST_RAD = math.radians(87.0)
NORMALS = 400
"""Normals for which the sum over the board is made; a polynomial carries it to all others."""


def board_light(normals: Array, direction: Array) -> Array:
    """Return irradiance (N,) of points of a ball by the board, a share of that of a facet that sees nothing else.

    An endless, evenly lit board without a shadow gives (1 - n_z) / 2. `normals` (N, 3) point up, `direction` to a lamp
    far away.

    Examples
    --------
    >>> light = board_light(np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]]), np.array([0.7, 0.0, 0.71]))
    >>> bool(light[0] > light[1]), bool(abs(light[0] - 0.5) < 0.05)
    (True, True)
    """
    # Radii in units of the ball's; equal steps of the angle that they are seen under from its middle.
    edges = np.tan(np.linspace(0.0, FARTHEST_RAD, RINGS + 1))
    radii = 0.5 * (edges[1:] + edges[:-1])
    areas = np.repeat(math.pi * np.diff(edges**2) / AROUND, AROUND)
    turns = (np.arange(AROUND) + 0.5) * 2.0 * math.pi / AROUND
    board = np.column_stack(
        [np.outer(radii, np.cos(turns)).ravel(), np.outer(radii, np.sin(turns)).ravel(), np.zeros(RINGS * AROUND)]
    )
    toward = np.array([0.0, 0.0, 1.0]) - board
    along = toward @ direction
    shadowed = (along > 0) & (np.sum(toward**2, axis=1) - along**2 < 1.0)
    few = _hemisphere()
    seen = board[~shadowed]
    # From unit vectors above the middle of the ball to points of the board, of which z is 0.
    turned = few @ seen.T
    square = np.sum(seen**2, axis=1) - 2.0 * turned + 2.0 * (1.0 + few[:, 2:])
    cosines = np.maximum(turned - 1.0 - few[:, 2:], 0.0) * (1.0 + few[:, 2:]) / square**2
    light = cosines @ areas[~shadowed] / math.pi
    terms, *_ = np.linalg.lstsq(_powers(few), light, rcond=None)
    found: Array = _powers(normals) @ terms
    return found


def _hemisphere() -> Array:
    """(K, 3) unit vectors, evenly spread over the upper half (golden angle)."""
    index = np.arange(NORMALS) + 0.5
    up = index / NORMALS
    turn = math.pi * (1.0 + math.sqrt(5.0)) * index
    flat = np.sqrt(1.0 - up**2)
    return np.column_stack([flat * np.cos(turn), flat * np.sin(turn), up])


def _powers(normals: Array) -> Array:
    """(N, 20) products of the components up to the third degree."""
    x, y, z = normals.T
    return np.column_stack([x**i * y**j * z**k for i in range(4) for j in range(4 - i) for k in range(4 - i - j)])
