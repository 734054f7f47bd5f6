"""A layout laid over the balls that were found, whatever way up the part lies."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from bgars.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bgars.records.ball_layout import BallLayout

    Points = NDArray[np.complex128]

__all__ = ["Registration", "register"]

MATCH = 0.3
"""Farthest from its place, in distances of nearest places, that a ball still belongs to it."""
WRONG_SCALE = 0.1
"""Relative difference of the places' scale and the image's from which on the recipe is not that of the part."""
MIN_MATCHED = 0.6
"""Of the balls: every other ball of a square lattice is one, too, turned by 45 degrees and wider, with half of them."""
NEIGHBOURS, NEIGHBOURS_OF_PLACE = 6, 12
"""Nearest balls and places whose directions are compared; of places more, because balls may be missing."""
BLOCK = 256
"""Points whose distances to all others are in memory at once."""
SOME_BALLS = 200
TURNS, SCALES = 180, 35
"""Cells of a turn of 2 degrees, and of 4 % from half to twice the scale: balls stand off their places by less."""
PEAKS, SHIFTS = 16, 8
"""Most turns and shifts that are tried."""
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
    """Turn, shift and scale a layout onto the balls: what most pairs and balls vote for, then least squares.

    Of equally good turns the smallest is taken: a square part that lies a quarter turn off cannot be told from one
    that does not.

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
        Too few of the balls are on places of the layout at any turn, or its scale is off by more than a tenth.
    """
    places = layout.places()
    nominal = np.array([(x + 1j * y) for *_, x, y in places]) / pixel_pitch_um
    nominal = nominal - (nominal.real.min() + nominal.real.max() + 1j * (nominal.imag.min() + nominal.imag.max())) / 2
    points = x_px + 1j * y_px
    if not len(points):
        return Registration(nominal.real, nominal.imag, np.full(len(nominal), -1), 1.0 / pixel_pitch_um, 0.0)
    turn, shift, reach = 1.0 + 0.0j, points[np.argmin(np.abs(points))], 1.0
    if len(nominal) > 1:
        reach = MATCH * float(np.median(np.abs(_to_neighbours(nominal, 1))))
        turn, shift = _vote(points, nominal, reach)
    for _ in range(ROUNDS):
        placed = nominal * turn + shift
        ball = _nearest(points, placed, reach * abs(turn))
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
    ball = _nearest(points, placed, reach * abs(turn))
    matched = int((ball >= 0).sum())
    if matched < MIN_MATCHED * len(points):
        keys = "positions" if layout.positions else "rows, cols, pitch_um"
        msg = (
            f"layout: {keys}: must fit the image at its pixel_pitch_um of {pixel_pitch_um:g}, but only {matched} of "
            f"{len(points)} balls are on the {len(nominal)} places at any turn of the part"
        )
        raise InputError(msg)
    if abs(abs(turn) - 1.0) > WRONG_SCALE:
        raise InputError(_wrong_scale(layout, abs(turn), pixel_pitch_um))
    return Registration(placed.real, placed.imag, ball, abs(turn) / pixel_pitch_um, float(np.angle(turn)))


def _wrong_scale(layout: BallLayout, ratio: float, pixel_pitch_um: float) -> str:
    """What to say where distances in the image are so many times those of the layout."""
    at = f"within {100 * WRONG_SCALE:.0f} % of the image's at its pixel_pitch_um of {pixel_pitch_um:g}"
    if layout.pitch_um is None:
        return f"layout: positions: distances must be {at}, which are {ratio:.3g} times as long"
    return f"layout: pitch_um: must be {at}, which is {ratio * layout.pitch_um:.4g}, got {layout.pitch_um:g}"


def _to_neighbours(points: Points, count: int, every: int = 1) -> Points:
    """Vectors from every so many points to their nearest others: `count` each, or more where some are equally far."""
    found = []
    count = min(count, len(points) - 1)
    for first in range(0, len(points), every * BLOCK):
        here = points[first : first + every * BLOCK : every]
        vectors = points - here[:, None]
        # Rounded, so that which of the equally far ones are taken is no chance: all of them.
        apart = np.round(np.abs(vectors), 6)
        # A point is the nearest to itself.
        farthest = np.partition(apart, count, axis=1)[:, count]
        apart[np.arange(len(here)), first + every * np.arange(len(here))] = np.inf
        found.append(vectors[apart <= farthest[:, None]])
    return np.concatenate(found)


def _turns(points: Points, nominal: Points) -> list[complex]:
    """Turns with scale that carry neighbours in the layout to neighbours in the image, most frequent first."""
    if len(points) < 2:  # noqa: PLR2004 - a direction needs two
        return [1.0 + 0.0j]
    here = _to_neighbours(points, NEIGHBOURS, math.ceil(len(points) / SOME_BALLS))
    there = np.unique(np.round(_to_neighbours(nominal, NEIGHBOURS_OF_PLACE), 3))
    there = there[:: math.ceil(len(there) / SOME_BALLS)]
    ratio = (here[:, None] / there).ravel()
    ratio = ratio[np.abs(np.log2(np.abs(ratio))) < 1.0]
    cell_turn = np.rint(np.angle(ratio) * (TURNS / (2.0 * math.pi))).astype(int) % TURNS
    cell_scale = np.rint((np.log2(np.abs(ratio)) + 1.0) * (SCALES / 2.0)).astype(int)
    votes = np.zeros((TURNS, SCALES + 3))
    np.add.at(votes, (cell_turn, cell_scale + 1), 1.0)
    # Cells overlap, so that a peak on a border is not halved.
    votes = votes + np.roll(votes, 1, axis=0) + np.roll(votes, -1, axis=0)
    votes[:, 1:-1] += votes[:, :-2] + votes[:, 2:]
    turns = [1.0 + 0.0j]
    for _ in range(PEAKS):
        turn, scale = (int(index) for index in np.unravel_index(np.argmax(votes), votes.shape))
        if votes[turn, scale] <= 0:
            break
        apart = np.abs((cell_turn - turn + TURNS // 2) % TURNS - TURNS // 2)
        near = (apart <= 1) & (np.abs(cell_scale + 1 - scale) <= 1)
        if near.any():
            middle = np.exp(np.median(np.log(np.abs(ratio[near]))))
            unit = np.mean(ratio[near] / np.abs(ratio[near]))
            turns.append(complex(middle * unit / abs(unit)))
        votes[np.arange(turn - 2, turn + 3) % TURNS, max(scale - 2, 0) : scale + 3] = 0.0
    return turns


def _vote(points: Points, nominal: Points, reach: float) -> tuple[complex, complex]:
    """Turn with scale, and shift, that lay most places on balls.

    Among equals the right scale, then the least turn, then the shift nearest to none.
    """
    some = points[:: math.ceil(len(points) / SOME_BALLS)]
    best: tuple[tuple[float, ...], complex, complex] = ((-1.0,), 1.0 + 0.0j, 0.0j)
    for turn in _turns(points, nominal):
        shifts = (some[:, None] - nominal * turn).ravel()
        for kind in _frequent(shifts / reach):
            near = np.abs(shifts - kind * reach) < 1.5 * reach
            shift = complex(np.median(shifts[near].real) + 1j * np.median(shifts[near].imag))
            placed = nominal * turn + shift
            place, ball = _pairs(placed, points, reach * abs(turn))
            hits = len(np.unique(ball[np.unique(place, return_index=True)[1]]))
            right = abs(abs(turn) - 1.0) <= WRONG_SCALE
            degrees = abs(round(math.degrees(float(np.angle(turn))), 1))
            score = (float(hits), float(right), -degrees, -float(round(abs(shift) / reach)))
            if score > best[0]:
                best = (score, turn, shift)
    return best[1], best[2]


def _frequent(shifts: Points) -> Points:
    """Cells of size 1 around which most shifts lie, best first; neighbours count: a peak may lie on a corner."""
    x, y = (np.rint(part).astype(np.int64) for part in (shifts.real, shifts.imag))
    x_low, y_low = x.min() - 1, y.min() - 1
    width = int(y.max() - y_low) + 2
    keys, votes = np.unique((x - x_low) * width + (y - y_low), return_counts=True)
    total = np.zeros(len(keys))
    for step in (i * width + j for i in (-1, 0, 1) for j in (-1, 0, 1)):
        at = np.searchsorted(keys, keys + step).clip(0, len(keys) - 1)
        total += np.where(keys[at] == keys + step, votes[at], 0)
    best = keys[np.argsort(-total, kind="stable")[:SHIFTS]]
    cells: Points = best // width + x_low + 1j * (best % width + y_low)
    return cells


def _nearest(points: Points, placed: Points, reach: float) -> NDArray[np.int64]:
    """Index of the ball nearest to each place within reach, one place a ball; -1 for none."""
    ball = np.full(len(placed), -1, np.int64)
    taken = np.zeros(len(points), np.bool_)
    for place, point in zip(*(index.tolist() for index in _pairs(placed, points, reach)), strict=True):
        if ball[place] < 0 and not taken[point]:
            ball[place], taken[point] = point, True
    return ball


def _pairs(places: Points, points: Points, reach: float) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Places and points within reach of each other, the nearest pair first.

    A place is compared with the points of a strip as wide, which are few: ``scipy.spatial`` takes longer to import.
    """
    by_x = np.argsort(points.real, kind="stable")
    x = points.real[by_x]
    first, end = np.searchsorted(x, places.real - reach), np.searchsorted(x, places.real + reach, "right")
    place = np.repeat(np.arange(len(places)), end - first)
    point = by_x[np.arange(len(place)) - np.repeat(np.cumsum(end - first) - end, end - first)]
    apart = np.abs(points[point] - places[place])
    near = np.flatnonzero(apart <= reach)
    near = near[np.lexsort((point[near], place[near], apart[near]))]
    return place[near], point[near]
