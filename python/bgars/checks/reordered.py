"""Images that are in another order than their lights, whichever that is: sorted as text, by time, by another lamp.

Values of matt pixels under all lights span three dimensions, those of the table of lights but for a linear map. So with
both made orthonormal they differ by a rotation, a mirror, and the order of their rows. The means of the rows give all
of the rotation but one angle; that is tried all round, and each time rows are paired, the nearest two first, and the
rotation is fitted again (P. H. Schoenemann, A generalized solution of the orthogonal Procrustes problem, 1966). On an
even ring many orders fit alike; `geometry` tells them apart.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bgars.checks.moments import lit_everywhere

if TYPE_CHECKING:
    from bgars.checks.view import View

__all__ = ["TRIED", "image_order"]

Array = NDArray[np.float64]
Order = NDArray[np.intp]

FEWEST, MOST_LIGHTS = 6, 64
"""Of fewer lights, nearly any order fits; of more, pairing is dear."""
MIN_PIXELS, MOST_PIXELS = 100, 2000
ANGLES = 72
TRIED = 2 * ANGLES
"""Orders of which the best is taken, at most: one from each angle, mirrored or not."""
ROUNDS = 4
BETTER = 0.5
"""Of the misfit in the given order: the right one leaves far less."""
MOST_LEFT = 0.15
"""Misfit that the right order may leave: the sum of squares of what separates two sets of orthonormal columns, up to 6.
Matt parts leave some hundredths; an order that only mixes what one odd image or cast shadows do leaves more."""
MOVED_DEG = 15.0
MIN_MOVED = 3
"""Images whose light moves by more: the error of a table is no other order, and two alone are a swap."""


def image_order(view: View) -> Order | None:
    """Return the light of each image in the order that fits best; None where the given one does about as well.

    Parameters
    ----------
    view : View
    """
    count = len(view.lights)
    if not FEWEST <= count <= MOST_LIGHTS:
        return None
    lit = lit_everywhere(view, view.lights, matt=False)
    if int(lit.sum()) < MIN_PIXELS:
        return None
    relative = view.values[:, lit].astype(np.float64)
    relative /= np.maximum(relative.mean(axis=0), 1e-9)
    spread = relative.std(axis=0)
    most = min(MOST_PIXELS, len(spread))
    chosen = np.argpartition(spread, -most)[-most:]
    seen = np.linalg.svd(relative[:, chosen], full_matrices=False)[0][:, :3]
    stated = np.linalg.svd(view.lights, full_matrices=False)
    table = stated[0] @ stated[2]
    given = np.arange(count)
    best, least = given, _misfit(seen, table)
    limit = min(BETTER * least, MOST_LEFT)
    for start in _starts(seen, table):
        order = _paired(seen @ start, table)
        for _ in range(ROUNDS):
            again = _paired(seen @ _rotation(seen, table[order]), table)
            if np.array_equal(again, order):
                break
            order = again
        misfit = _misfit(seen, table[order])
        if misfit < least - 1e-12:
            best, least = order, misfit
    moved = np.einsum("ij,ij->i", view.lights, view.lights[best]) < np.cos(np.radians(MOVED_DEG))
    return best if least < limit and int(moved.sum()) >= MIN_MOVED else None


def _starts(seen: Array, table: Array) -> list[Array]:
    """Rotations (3, 3) that bring the mean row of one to that of the other, at angles all round, and mirrored."""
    one, two = _frame(seen.mean(axis=0)), _frame(table.mean(axis=0))
    starts = []
    for angle in 2.0 * np.pi / ANGLES * np.arange(ANGLES):
        c, s = np.cos(angle), np.sin(angle)
        for mirror in (1.0, -1.0):
            turn = np.array([[1.0, 0.0, 0.0], [0.0, c, -s * mirror], [0.0, s, c * mirror]])
            starts.append(one @ turn @ two.T)
    return starts


def _frame(axis: Array) -> Array:
    """(3, 3) orthonormal columns, the first along an axis."""
    frame = np.linalg.svd(np.asarray(axis)[:, None])[0]
    return np.asarray(frame * np.where(frame[:, :1].T @ axis < 0.0, [-1.0, 1.0, 1.0], 1.0))


def _rotation(seen: Array, table: Array) -> Array:
    """(3, 3) rotation or mirror that brings rows to rows best."""
    u, _, vt = np.linalg.svd(seen.T @ table)
    rotation: Array = u @ vt
    return rotation


def _misfit(seen: Array, table: Array) -> float:
    return float(np.square(seen @ _rotation(seen, table) - table).sum())


def _paired(seen: Array, table: Array) -> Order:
    """Row of the table for each row that is seen, every row once: of what is left, always the nearest two."""
    distance = np.square(seen[:, None] - table[None]).sum(axis=2)
    order = np.zeros(len(seen), dtype=np.intp)
    for _ in range(len(seen)):
        row, column = divmod(int(distance.argmin()), len(table))
        order[row] = column
        distance[row] = distance[:, column] = np.inf
    return order
