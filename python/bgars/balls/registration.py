"""A layout laid over the balls that were found."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from bgars.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bgars.ball_records import BallLayout

__all__ = ["Registration", "register"]

LARGEST_TURN_DEG = 15.0
TURN_STEP_DEG = 0.5
MATCH = 0.3
"""Farthest from its place, in distances of nearest places, that a ball still belongs to it."""
WRONG_SCALE = 0.1
MIN_MATCHED = 0.5
ROUNDS = 8


class Registration(NamedTuple):
    """Places in the image and which ball stands on which.

    Attributes
    ----------
    x_px, y_px : (M,) float64
        The layout's places, x right and y up, origin at the image centre.
    ball : (M,) int64
        Index of the ball on each place, -1 for none.
    scale_px_per_um, angle_rad : float
        Of the layout in the image.
    """

    x_px: NDArray[np.float64]
    y_px: NDArray[np.float64]
    ball: NDArray[np.int64]
    scale_px_per_um: float
    angle_rad: float


def register(
    x_px: NDArray[np.float64], y_px: NDArray[np.float64], layout: BallLayout, pixel_pitch_um: float
) -> Registration:
    """Turn, shift and scale a layout onto the balls: the shift that most balls vote for, then least squares.

    Parameters
    ----------
    x_px, y_px : (N,) float64
        Centres of the balls.
    layout : BallLayout
        Where they should be.
    pixel_pitch_um : float
        Size of a pixel.

    Raises
    ------
    InputError
        Fewer than half of the balls are on places of the layout, or its scale is off by more than a tenth.
    """
    places = layout.places()
    nominal = np.array([(x + 1j * y) for *_, x, y in places]) / pixel_pitch_um
    nominal = nominal - (nominal.real.min() + nominal.real.max() + 1j * (nominal.imag.min() + nominal.imag.max())) / 2
    points = x_px + 1j * y_px
    apart = np.abs(nominal[:, None] - nominal)
    np.fill_diagonal(apart, np.inf)
    spacing = float(np.median(apart.min(axis=1))) if len(nominal) > 1 else 1.0 / MATCH
    if not len(points):
        return Registration(nominal.real, nominal.imag, np.full(len(nominal), -1), 1.0 / pixel_pitch_um, 0.0)
    reach = MATCH * spacing
    turn, shift = _vote(points, nominal, reach) if len(nominal) > 1 else (1.0 + 0.0j, points[np.argmin(np.abs(points))])
    for _ in range(ROUNDS):
        placed = nominal * turn + shift
        ball = _nearest(points, placed, reach)
        on = np.flatnonzero(ball >= 0)
        if len(on) < 2:  # noqa: PLR2004 - a turn needs two
            break
        weight = 1.0 / (1.0 + (np.abs(points[ball[on]] - placed[on]) / (0.1 * reach)) ** 2)
        centre = np.sum(weight * nominal[on]) / weight.sum()
        target = np.sum(weight * points[ball[on]]) / weight.sum()
        lever = nominal[on] - centre
        size = np.sum(weight * np.abs(lever) ** 2)
        if size > 0:
            turn = np.sum(weight * np.conj(lever) * (points[ball[on]] - target)) / size
        shift = target - turn * centre
    placed = nominal * turn + shift
    ball = _nearest(points, placed, reach)
    matched = int((ball >= 0).sum())
    if matched < MIN_MATCHED * len(points):
        keys = "positions" if layout.positions else "rows, cols, pitch_um"
        msg = (
            f"layout: {keys}: must fit the image at its pixel_pitch_um of {pixel_pitch_um:g}, but only {matched} of "
            f"{len(points)} balls are on the {len(nominal)} places"
        )
        raise InputError(msg)
    if abs(abs(turn) - 1.0) > WRONG_SCALE:
        raise InputError(_wrong_scale(layout, abs(turn), pixel_pitch_um))
    return Registration(placed.real, placed.imag, ball, abs(turn) / pixel_pitch_um, float(np.angle(turn)))


def _wrong_scale(layout: BallLayout, ratio: float, pixel_pitch_um: float) -> str:
    """What to say where distances in the image are so many times those of the layout."""
    at = f"within {WRONG_SCALE:.0%} of the image's at its pixel_pitch_um of {pixel_pitch_um:g}"
    if layout.pitch_um is None:
        return f"layout: positions: distances must be {at}, which are {ratio:.3g} times as long"
    return f"layout: pitch_um: must be {at}, which is {ratio * layout.pitch_um:.4g}, got {layout.pitch_um:g}"


def _vote(points: NDArray[np.complex128], nominal: NDArray[np.complex128], reach: float) -> tuple[complex, complex]:
    """Turn and shift that lay most places on balls; among equals the least turn, then the shift nearest to none."""
    best = (-1, 0.0, 0.0, 1.0 + 0.0j, 0.0j)
    count = round(LARGEST_TURN_DEG / TURN_STEP_DEG)
    for step in sorted(range(-count, count + 1), key=abs):
        turn = complex(np.exp(1j * math.radians(step * TURN_STEP_DEG)))
        shifts = (points[:, None] - nominal * turn).ravel()
        cells = np.rint(shifts.real / reach) + 1j * np.rint(shifts.imag / reach)
        kinds, votes = np.unique(cells, return_counts=True)
        for kind in kinds[votes >= max(votes.max() - 2, 1)][:50]:
            near = np.abs(shifts - kind * reach) < 1.5 * reach
            shift = complex(np.median(shifts[near].real) + 1j * np.median(shifts[near].imag))
            hits = int((_nearest(points, nominal * turn + shift, reach) >= 0).sum())
            score = (hits, -abs(step), -round(abs(shift) / reach), turn, shift)
            if score[:3] > best[:3]:
                best = score
    return best[3], best[4]


def _nearest(points: NDArray[np.complex128], placed: NDArray[np.complex128], reach: float) -> NDArray[np.int64]:
    """Index of the ball nearest to each place within reach, one place a ball; -1 for none."""
    distance = np.abs(placed[:, None] - points)
    ball = np.full(len(placed), -1, np.int64)
    for place, point in sorted(
        np.argwhere(distance < reach).tolist(), key=lambda pair: float(distance[pair[0], pair[1]])
    ):
        if ball[place] < 0 and point not in ball:
            ball[place] = point
    return ball
