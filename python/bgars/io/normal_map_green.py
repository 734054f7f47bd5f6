"""Which way green points in a normal map, and whether red and green are exchanged: the curl of its field tells.

Slopes ``p = dz/dx`` and ``q = dz/dy`` of a surface have ``dp/dy = dq/dx``. With green (or red) the wrong way round the
two are opposite: their correlation is +1 on a noiseless surface of the right handedness, -1 on its mirror image, and 0
where there is no torsion (a cylinder, a plane) or only noise. With red and green exchanged it is ``dp/dx`` and
``dq/dy`` that agree, up to their sign, and the first two differ by what the curvatures along x and y do.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bgars.records.pixels import BoolArray, FloatArray

__all__ = ["Curl", "curl_of"]

LEAST_N_Z = 0.2
"""Slopes of steeper normals are mostly error."""
LARGEST_PART = 0.95
"""Of the derivatives: beyond are jumps, where the surface is not seen."""
SURE_SIGMA = 6.0
"""Of a sum of products of independent noise: once in a billion maps."""
LEAST_AGREEMENT = 0.1
LEAST_CELLS = 64
LESS_CURL = 0.5
"""Of the curl as it is stored, absolute and as a share of the derivatives, that an exchange may leave. Noise that is
alike in red and green leaves as much of one as of the other; codes that hide one of the derivatives change one of the
two measures, not both."""
LITTLE_CURL = 0.05
"""The same where the curvatures that an exchange implies are smaller than the torsion, which are three times as large
on a surface that is turned at random: errors of the map would then have to spare one of the two by so much."""


class Curl(NamedTuple):
    """What the curl of a field says.

    Attributes
    ----------
    agreement : float
        From -1, green points down, to 1, green points up; 0 where that cannot be told.
    exchanged : bool
        Red is y and green is x; `agreement` holds once they are put right.
    """

    agreement: float
    exchanged: bool


class Pair(NamedTuple):
    """Two derivatives that are equal, up to their sign, under one order of red and green.

    Attributes
    ----------
    agreement : float
        From -1, opposite, to 1, equal.
    sigma : float
        By how many standard deviations it differs from 0.
    power : float
        Sum of their squares.
    residual : (cells,) float64
        Square of what is left of the two.
    """

    agreement: float
    sigma: float
    power: float
    residual: NDArray[np.float64]


def curl_of(normals: FloatArray, usable: BoolArray) -> Curl:
    """Which way green points, and whether it is exchanged with red.

    Derivatives are taken at pixels and at blocks of 2, 4, 8 and 16 of them: codes of 8 bits hide a gentle surface at
    pixels, and a fine relief vanishes in blocks. The scale that is surest counts.
    """
    use = usable & (normals[..., 2] > LEAST_N_Z)
    n_z = np.where(use, normals[..., 2], 1.0)
    p, q = (np.where(use, -normals[..., axis] / n_z, 0.0).astype(np.float64) for axis in (0, 1))
    best = {False: 0.0, True: 0.0}
    surest = {False: SURE_SIGMA, True: SURE_SIGMA}
    exchanged = contradicted = False
    while min(use.shape) > 1:
        derivatives = _at_one_scale(p, q, use)
        pairs = _pairs(derivatives)
        for key, pair in zip((False, True), pairs, strict=True):
            if pair.sigma > surest[key] and abs(pair.agreement) > LEAST_AGREEMENT:
                best[key], surest[key] = pair.agreement, pair.sigma
        # Without their means: those of a bowl agree in both orders, and a slope that drifts adds to one of them.
        stored, other = _pairs(derivatives - derivatives.mean(axis=1, keepdims=True))
        sigma = _sigma(stored.residual - other.residual)
        exchanged |= sigma > SURE_SIGMA and _fits_better(stored, other) and _fits_better(*pairs)
        contradicted |= sigma < -SURE_SIGMA
        p, q, use = _halved(p, use), _halved(q, use), _halved(use.astype(np.float64), use) > 1.0 - 1e-9
    exchanged = exchanged and not contradicted and best[True] != 0.0
    return Curl(best[exchanged], exchanged)


def _fits_better(stored: Pair, other: Pair) -> bool:
    """Whether an exchange of red and green leaves far less of the curl."""
    part = LESS_CURL if other.power < stored.power else LITTLE_CURL
    less = float(other.residual.sum()) < part * float(stored.residual.sum())
    return less and 1.0 - abs(other.agreement) < part * (1.0 - abs(stored.agreement))


def _at_one_scale(p: NDArray[np.float64], q: NDArray[np.float64], use: BoolArray) -> NDArray[np.float64]:
    """Derivatives of p along x and y and of q along x and y, (4, cells); zeros where there are too few."""
    cells = use[:-1, :-1] & use[:-1, 1:] & use[1:, :-1] & use[1:, 1:]
    found = np.stack([*_derivatives(p, cells), *_derivatives(q, cells)])
    if found.shape[1] < LEAST_CELLS:
        return np.zeros((4, 1))
    size = np.abs(found).max(axis=0)
    return found[:, size <= np.quantile(size, LARGEST_PART)]


def _pairs(derivatives: NDArray[np.float64]) -> tuple[Pair, Pair]:
    """Those that agree as red and green are stored, and those that agree if they are exchanged."""
    p_x, p_y, q_x, q_y = derivatives
    return _pair(p_y, q_x), _pair(p_x, q_y)


def _derivatives(slope: NDArray[np.float64], cells: BoolArray) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Along x and y (up), in cells of four values."""
    along_x = (slope[:-1, 1:] + slope[1:, 1:] - slope[:-1, :-1] - slope[1:, :-1]) / 2.0
    along_y = (slope[:-1, :-1] + slope[:-1, 1:] - slope[1:, :-1] - slope[1:, 1:]) / 2.0
    return along_x[cells], along_y[cells]


def _pair(one: NDArray[np.float64], two: NDArray[np.float64]) -> Pair:
    products = one * two
    squares = one**2 + two**2
    total, power = float(products.sum()), float(squares.sum())
    agreement = 2.0 * total / power if power else 0.0
    return Pair(agreement, abs(_sigma(products)), power, squares - math.copysign(2.0, total) * products)


def _sigma(values: NDArray[np.float64]) -> float:
    """By how many standard deviations a sum of values differs from 0."""
    spread = math.sqrt(float(np.sum(values**2)))
    return float(values.sum()) / spread if spread else 0.0


def _halved(values: NDArray[np.float64], use: BoolArray) -> NDArray[np.float64]:
    """Means of blocks of two by two."""
    rows, cols = (size // 2 * 2 for size in use.shape)
    upper, lower = values[0:rows:2, :cols], values[1:rows:2, :cols]
    columns = upper + lower
    blocks: NDArray[np.float64] = (columns[:, ::2] + columns[:, 1::2]) / 4.0
    return blocks
