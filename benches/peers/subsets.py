"""Which lights a pixel keeps, as a number (bit k: light k), and least squares by set; plain numpy in float64."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

MIN_KEPT = 3
MIN_CONDITIONING = 1e-6
"""Least 27 det(G) / trace(G)^3 of a set that fixes a normal, as in bgars."""


def kept_codes(images: NDArray[np.uint8], threshold: float) -> NDArray[np.uint8]:
    """The published filter: sort, and drop what is over the first gap above the third value; (H, W) codes."""
    values = images.reshape(len(images), -1)
    ordered = np.sort(values, axis=0)
    gaps = np.diff(ordered.astype(np.int16), axis=0)[MIN_KEPT - 1 :] > threshold
    first = np.argmax(gaps, axis=0) + MIN_KEPT - 1
    rank = np.where(gaps.any(axis=0), first, len(images) - 1)
    cut = np.take_along_axis(ordered, rank[None], axis=0)
    return np.packbits(values <= cut, axis=0, bitorder="little")[0].reshape(images.shape[1:])


def lights_of(code: int, count: int) -> NDArray[np.intp]:
    """Indices of the lights of a set."""
    return np.flatnonzero([code >> light & 1 for light in range(count)])


def is_solvable(directions: NDArray[np.float64]) -> bool:
    """Whether these lights fix a normal."""
    gram = directions.T @ directions
    third = np.trace(gram) / 3.0
    return bool(third > 0 and np.linalg.det(gram) / third**3 >= MIN_CONDITIONING)


def subset_inverses(directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """(2^L, 3, 3) inverses of L_K^T L_K; zeros where the set does not fix a normal."""
    count = len(directions)
    inverses = np.zeros((1 << count, 3, 3))
    for code in range(1 << count):
        kept = directions[lights_of(code, count)]
        if is_solvable(kept):
            inverses[code] = np.linalg.inv(kept.T @ kept)
    return inverses


def solve_by_set(
    images: NDArray[np.uint8], directions: NDArray[np.float64], codes: NDArray[np.uint8]
) -> NDArray[np.float64]:
    """(H, W, 3) unit normals: one pseudo-inverse for all pixels that keep the same lights; NaN where there is none."""
    values, flat = images.reshape(len(images), -1), codes.ravel()
    normals = np.full((flat.size, 3), np.nan)
    by_code = np.argsort(flat, kind="stable")  # a radix sort: pixels of a set come together
    starts = np.concatenate([[0], np.cumsum(np.bincount(flat, minlength=1 << len(images)))])
    for code in np.flatnonzero(np.diff(starts)):
        lights = lights_of(int(code), len(images))
        if not is_solvable(directions[lights]):
            continue
        pixels = by_code[starts[code] : starts[code + 1]]
        scaled = np.linalg.pinv(directions[lights]) @ values[np.ix_(lights, pixels)].astype(np.float64)
        length = np.sqrt((scaled**2).sum(axis=0))
        good = scaled[2] > 0
        normals[pixels[good]] = (scaled[:, good] / length[good]).T
    return normals.reshape(*codes.shape, 3)


def estimate(images: NDArray[np.uint8], directions: NDArray[np.float64], threshold: float) -> NDArray[np.float64]:
    """The whole of it, as one writes it in numpy."""
    return solve_by_set(images, directions, kept_codes(images, threshold))
