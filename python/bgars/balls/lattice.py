"""The square lattice that most balls stand on."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Lattice", "fit_lattice"]

ON_LATTICE = 0.3
"""Farthest from its place, in pitches, that a ball still belongs to it."""
GROWTH = 2.0
"""How much farther each round looks for balls of the lattice than the one before."""
MAX_ROUNDS = 12


class Lattice(NamedTuple):
    """A square lattice, x right and y up in pixels; rows count downward.

    Attributes
    ----------
    x_px, y_px : float
        Place (0, 0).
    pitch_px : float
        Distance of neighbours.
    angle_rad : float
        Direction of a row, counter-clockwise.
    row, col : (N,) int64
        Place of each ball; meaningless where `on` is False.
    on : (N,) bool
        True where the ball stands on the lattice, and no better one on the same place.
    """

    x_px: float
    y_px: float
    pitch_px: float
    angle_rad: float
    row: NDArray[np.int64]
    col: NDArray[np.int64]
    on: NDArray[np.bool_]

    def place(self, row: int, col: int) -> tuple[float, float]:
        """(x, y) of a place."""
        cosine, sine = math.cos(self.angle_rad), math.sin(self.angle_rad)
        return (
            self.x_px + self.pitch_px * (col * cosine + row * sine),
            self.y_px + self.pitch_px * (col * sine - row * cosine),
        )


def fit_lattice(
    x_px: NDArray[np.float64], y_px: NDArray[np.float64], *, pitch_px: float | None = None
) -> Lattice | None:
    """Fit a square lattice by least squares, growing from its densest part; None for fewer than two balls.

    The pitch is the median distance of nearest neighbours (unless given), the direction their mean over quarter turns;
    balls are numbered from a seed outward, so that a rough pitch is enough for a large array.

    Parameters
    ----------
    x_px, y_px : (N,) float64
        Centres, x right, y up.
    pitch_px : float, optional
        Distance of neighbours where it is known roughly.
    """
    count = len(x_px)
    if count < 2:  # noqa: PLR2004 - a pitch needs two
        return None
    points = x_px + 1j * y_px
    apart = points[None, :] - points[:, None]
    distance = np.abs(apart)
    np.fill_diagonal(distance, np.inf)
    nearest = distance.min(axis=1)
    if pitch_px is None:
        pitch_px = float(np.median(nearest))
    close = np.abs(distance / pitch_px - 1.0) < ON_LATTICE
    if not close.any():
        # No two balls are neighbours: the nearest pair gives the direction only.
        close = distance == distance.min()
    turn = np.sum((apart[close] / distance[close]) ** 4)
    basis = pitch_px * np.exp(0.25j * np.angle(turn))
    seed = int(
        np.argmax(
            close.sum(axis=1) - 1e-3 * np.abs(points - np.median(points.real) - 1j * np.median(points.imag)) / pitch_px
        )
    )
    origin = points[seed]
    reach = GROWTH * pitch_px
    step = np.zeros(count, np.complex128)
    for _ in range(MAX_ROUNDS):
        near = np.abs(points - points[seed]) <= reach
        step = (points - origin) / basis
        step = np.rint(step.real) + 1j * np.rint(step.imag)
        for _ in range(3):
            use = near & (np.abs(points - origin - step * basis) < ON_LATTICE * abs(basis))
            if use.sum() < 2 or np.ptp(step[use].real) + np.ptp(step[use].imag) == 0:  # noqa: PLR2004
                break
            weight = 1.0 / (1.0 + (np.abs(points - origin - step * basis)[use] / (0.05 * abs(basis))) ** 2)
            mean_step = np.sum(weight * step[use]) / weight.sum()
            mean_point = np.sum(weight * points[use]) / weight.sum()
            lever = step[use] - mean_step
            basis = np.sum(weight * np.conj(lever) * (points[use] - mean_point)) / np.sum(weight * np.abs(lever) ** 2)
            origin = mean_point - mean_step * basis
        if near.all():
            break
        reach *= GROWTH
    step = (points - origin) / basis
    rounded = np.rint(step.real) + 1j * np.rint(step.imag)
    residual = np.abs(step - rounded)
    on = residual < ON_LATTICE
    order = np.argsort(residual)
    taken: set[complex] = set()
    for ball in order:
        if on[ball]:
            on[ball] = rounded[ball] not in taken
            taken.add(complex(rounded[ball]))
    left, top = rounded[on].real.min(), rounded[on].imag.max()
    first = origin + (left + 1j * top) * basis
    return Lattice(
        x_px=float(first.real),
        y_px=float(first.imag),
        pitch_px=float(abs(basis)),
        angle_rad=float(np.angle(basis)),
        row=np.rint(top - rounded.imag).astype(np.int64),
        col=np.rint(rounded.real - left).astype(np.int64),
        on=on,
    )
