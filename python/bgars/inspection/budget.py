"""The error budget of every reading: what its uncertainty is made of, by cause.

Each prior of the fit is an independent source of error: a light that stands aside of its place, all lights raised
together, balls flatter than they are taken for, an image that is shifted. With b an unknown whose prior has the
standard deviation s, the share of the reading y that this source makes uncertain is ``Cov(y, b) / s``: of linear
estimates from independent normal sources, the variance of y is the sum of the squares of these shares and of what the
measured edges scatter (JCGM 100:2008, 5.1.2). What all balls share has one sign for all of them, so that differences of
balls, coplanarity above all, come out right.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bgars.inspection.board import SHAPE_TERMS
from bgars.inspection.bundle import LIGHT_TERMS
from bgars.inspection.common_terms import (
    AZIMUTH,
    COMMON_TERMS,
    EDGE_TERMS,
    ELEVATION,
    OUTLINE,
    OUTLINE_X,
    OUTLINE_Y,
    PERSPECTIVE,
    ROUNDNESS,
)

if TYPE_CHECKING:
    from bgars.inspection.bundle import Priors
    from bgars.inspection.settle import Settled

__all__ = ["Budget", "reading_budget"]

Array = NDArray[np.float64]

MOST_EXPLAINED = 0.995
"""Of a variance by priors: something always scatters."""
SCATTER_MODES = 6
"""Ways in which scatter that balls share, through lights and board, differs from ball to ball: shift, tilt, bow."""
SCATTER = "scatter of the edges"
OWN_SHAPE = "shape of this ball"
RELIEF = "relief of the board"
EACH_LIGHT = "direction of each light"
SHIFTS = "shifts of the images"
COMMON_SOURCES = {
    ELEVATION: "elevation of all lights together",
    AZIMUTH: "azimuth of all lights together",
    ROUNDNESS: "roundness of all balls together",
    PERSPECTIVE: "distance of the camera",
    **dict.fromkeys(EDGE_TERMS, "response, penumbra and reflected light at the edges"),
    **dict.fromkeys((OUTLINE, OUTLINE_X, OUTLINE_Y), "outlines of all balls together"),
}


class Budget(NamedTuple):
    """The uncertainty of one reading of N balls.

    `alone` (N,) standard uncertainty of each by itself, `alone_by` the same by cause; `shared` (N, M) what M
    independent sources of standard deviation 1 put the balls off by, `causes` (M,) their names.
    """

    alone: Array
    alone_by: dict[str, Array]
    shared: Array
    causes: tuple[str, ...]

    def total(self) -> Array:
        """(N,) standard uncertainties."""
        total: Array = np.sqrt(np.square(self.alone) + np.square(self.shared).sum(axis=1))
        return total

    def by_cause(self) -> dict[str, Array]:
        """(N,) standard uncertainties by cause, largest first."""
        parts = {name: np.square(part) for name, part in self.alone_by.items()}
        for column, name in enumerate(self.causes):
            parts[name] = parts.get(name, 0.0) + np.square(self.shared[:, column])
        order = sorted(parts, key=lambda name: -float(np.median(parts[name])))
        return {name: np.sqrt(parts[name]) for name in order}


def reading_budget(settled: Settled, priors: Priors, by_ball: Array) -> Budget:
    """Split the uncertainty of a reading.

    Parameters
    ----------
    settled : Settled
    priors : Priors
        Of the fit, of the same balls.
    by_ball : (N, 5) float64
        Derivatives of the reading by x, y, z, radius and q of its ball.
    """
    solution = settled.solution
    lights = len(solution.vectors)
    along = np.einsum("ni,nib->nb", by_ball, solution.lever)
    with_border = along @ solution.border
    first = LIGHT_TERMS * lights + SHAPE_TERMS
    columns, causes = [], []
    for axis, term in ((0, AZIMUTH), (1, ELEVATION)):
        for light in range(lights):
            apart = with_border[:, LIGHT_TERMS * light + axis] - with_border[:, first + term]
            columns.append(apart / priors.u_light_rad[light])
            causes.append(EACH_LIGHT)
            columns.append(with_border[:, LIGHT_TERMS * light + 2 + axis] / priors.u_shifts_px[light, axis])
            causes.append(SHIFTS)
    for term in range(COMMON_TERMS):
        u = float(priors.u_common[term])
        if term in settled.mixtures:
            mixture, odd = settled.mixtures[term], settled.odd[term]
            # The mean of what both parts make uncertain, each with its probability.
            u = float(1.0 / np.sqrt(odd / mixture.wide**2 + (1.0 - odd) / mixture.narrow**2))
        columns.append(with_border[:, first + term] / u)
        causes.append(COMMON_SOURCES[term])
    # Which of shifted images are the right ones nobody knows: where most are, or anywhere else that one is.
    away_px = np.sqrt(np.square(priors.shifts_px).mean(axis=0))
    for axis, spread_px in enumerate(away_px):
        columns.append(by_ball[:, axis] * spread_px)
        causes.append(SHIFTS)
    shared = np.array(columns).T
    # Mixtures are no normal distributions: where their shares come to more than the whole, they are cut to it.
    moved = by_ball[:, :2] * away_px
    whole = np.maximum((with_border * along).sum(axis=1) + np.square(moved).sum(axis=1), 1e-300)
    cut = np.sqrt(np.minimum(1.0, MOST_EXPLAINED * whole / np.square(shared).sum(axis=1)))
    shared = shared * cut[:, None]
    scattered = _modes([(with_border, along), (moved, moved), (-shared, shared)])
    shared, causes = np.column_stack([shared, scattered]), [*causes, *[SCATTER] * scattered.shape[1]]
    own_q = np.abs(np.einsum("ni,ni->n", by_ball, solution.alone[:, :, 4])) / priors.u_q
    relief = np.sqrt((np.square(by_ball) * solution.relief).sum(axis=1))
    alone = np.einsum("ni,nij,nj->n", by_ball, solution.alone, by_ball)
    # What the largest modes leave of the shared scatter counts as each ball's own.
    alone = alone + np.maximum(whole - np.square(shared).sum(axis=1), 0.0)
    scatter = np.sqrt(np.maximum(alone - np.square(own_q) - np.square(relief), 0.0))
    alone = np.sqrt(alone)
    return Budget(alone, {SCATTER: scatter, OWN_SHAPE: own_q, RELIEF: relief}, shared, tuple(causes))


def _modes(products: list[tuple[Array, Array]]) -> Array:
    """(N, SCATTER_MODES) largest modes of the symmetric sum of ``left right^T``, columns of the length of their roots.

    In the space that all columns span: its dimensions are those of lights and board, however many balls there are.
    """
    basis = np.linalg.qr(np.concatenate([right for _, right in products], axis=1))[0]
    inner = np.zeros((basis.shape[1], basis.shape[1]))
    for left, right in products:
        inner += np.einsum("ni,nb->ib", basis, left) @ np.einsum("ni,nb->bi", basis, right)
    values, vectors = np.linalg.eigh(inner)
    most = np.argsort(-values)[:SCATTER_MODES]
    modes: Array = (basis @ vectors[:, most]) * np.sqrt(np.maximum(values[most], 0.0))
    return modes
