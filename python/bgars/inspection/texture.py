r"""How far images are shifted against each other, by the board's own texture.

On a tile of board that all lights reach, image l is the texture T in the light of its lamp, shifted by s:

    I = T (a + b x + c y) - s . grad T,

to first order in s, which smoothing carries to two thirds of a pixel: least squares in five unknowns, tile by tile, and
the tiles' robust mean. Relief of height h adds T l . grad h, l the direction to the light, horizontal over vertical.
Where texture and relief are not alike that scatters from tile to tile. Where they are, as on bright ridges, all images
seem to move by c l, each away from its lamp or towards it, as no part moves: then nothing is claimed.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bgars.inspection.image_shifts import ImageShifts

if TYPE_CHECKING:
    from bgars.inspection.radiance import Radiance
    from bgars.inspection.shadow_map import ShadowMap

__all__ = ["texture_shifts"]

Array = NDArray[np.float64]

TILE_PX, MOST_TILES, FEWEST_TILES = 32, 96, 4
"""Side of a tile, how many are looked at, and of how few their scatter still says how good they are."""
TOGETHER = 12
"""Tiles that are worked on at once: their pixels under all lights fit a processor's cache."""
BORDER_PX = 4
"""Around a tile, for filters and gradients."""
LEAST_PIXELS = 192
"""Free board in a tile: of smoothed pixels every fifth along each axis speaks for itself, for five unknowns."""
LEAST_SIGNAL = 10.0
"""Energy of the gradients of a tile over that of their noise, by which shifts come out too small."""
SMOOTHINGS = 3
"""Binomial filters of three pixels: gradients rise over the noise, and change little within a shift."""
MODEL_PX, MODEL_SHARE = 0.01, 0.1
"""What relief leaves of boards that stand still, 0.003 to 0.02 px as rendered; what the first order, 4 %, and noise, up
to a part in ten, leave of shifts."""
MOST_RELIEF = 0.4
"""Share of the squared moves that relief explains, c l, from which on it is believed: of one image among eight that
moved it is an eighth, of half of a ring at most a fifth, of ridges along one direction a half, of others all."""
ROUNDS = 5
CAUCHY = 2.5
"""Scale of the Cauchy loss of tiles, in standard deviations."""
RIDGE = 1e-9


def texture_shifts(radiance: Radiance, shadows: ShadowMap, vectors: Array, threads: int) -> ImageShifts:
    """Shifts of images against where most of them show the board; u is infinite where there is too little texture.

    Parameters
    ----------
    radiance : Radiance
    shadows : ShadowMap
        Which board no ball hides or shadows, with margins.
    vectors : (L, 3) float64
        Towards the lights.
    threads : int
    """
    lights = radiance.lights
    unknown = ImageShifts(np.zeros((lights, 2)), np.full(lights, np.inf))
    free = ~shadows.hidden & ~shadows.count.any(axis=0)
    corners = _free_tiles(radiance, free, shadows.step)
    if len(corners) < FEWEST_TILES:
        return unknown
    with ThreadPoolExecutor(threads) as pool:
        some = np.array_split(corners, -(-len(corners) // TOGETHER))
        by_tile = list(pool.map(lambda few: _by_tile(radiance, shadows, free, few), some))
    moves, information = (np.concatenate(parts) for parts in zip(*by_tile, strict=True))
    if len(moves) < FEWEST_TILES:
        return unknown
    move_px, u_px = _together(moves, information)
    move_px -= np.median(move_px, axis=0)
    slant = vectors[:, :2] / vectors[:, 2:]
    by_relief = (move_px * slant).sum() ** 2 / max(float(np.square(slant).sum()), 1e-12)
    if by_relief > MOST_RELIEF * np.square(move_px).sum():
        return unknown
    return ImageShifts(move_px, np.sqrt(u_px**2 + MODEL_PX**2 + np.square(MODEL_SHARE * move_px).sum(axis=1)))


def _free_tiles(radiance: Radiance, free: NDArray[np.bool_], step: int) -> NDArray[np.intp]:
    """(K, 2) first row and column of the tiles with most free board; `free` by cells of so many pixels."""
    cells = max(TILE_PX // step, 1)
    first = -(-BORDER_PX // step)
    rows, cols = ((size - 2 * first) // cells for size in free.shape)
    if rows < 1 or cols < 1:
        return np.zeros((0, 2), np.intp)
    part = free[first : first + rows * cells, first : first + cols * cells]
    share = part.reshape(rows, cells, cols, cells).mean(axis=(1, 3))
    best = np.argsort(-share, axis=None, kind="stable")[:MOST_TILES]
    best = best[share.reshape(-1)[best] * TILE_PX**2 >= LEAST_PIXELS]
    corners = (np.column_stack(np.unravel_index(best, share.shape)) * cells + first) * step
    inside = (corners + TILE_PX + BORDER_PX <= [radiance.height, radiance.width]).all(axis=1)
    return corners[inside].astype(np.intp)


def _by_tile(
    radiance: Radiance, shadows: ShadowMap, free: NDArray[np.bool_], corners: NDArray[np.intp]
) -> tuple[Array, Array]:
    """(K, L, 2) shifts, x right and y up, and (K, L, 2, 2) their inverse covariances, of tiles that show texture."""
    side = np.arange(-BORDER_PX, TILE_PX + BORDER_PX)
    row, col = corners[:, :1, None] + side[:, None], corners[:, 1:, None] + side[None, :]
    pixels = row * radiance.width + col
    values = radiance.at(pixels).astype(np.float64)
    good = np.isfinite(values).all(axis=0) & free.reshape(-1)[shadows.pixels(row, col)]
    values = np.where(np.isfinite(values), values, 0.0)
    for _ in range(SMOOTHINGS):
        values, good = _smooth(values), _all_around(good)
    inner = (..., slice(1, -1), slice(1, -1))
    weight = _all_around(good).astype(np.float64)
    count = np.maximum(weight.sum(axis=(1, 2)), 1.0)
    level = (values[inner] * weight).sum(axis=(2, 3)) / count
    values = values / np.where(level > 0, level, 1.0)[..., None, None]
    texture = values.mean(axis=0)
    by_x, by_y = _gradient(texture)
    noise_x, noise_y = _gradient(values - texture)
    signal = ((by_x**2 + by_y**2) * weight).sum(axis=(1, 2))
    noise = ((noise_x**2 + noise_y**2) * weight).sum(axis=(2, 3)).mean(axis=0) / max(len(values) - 1, 1)
    texture, values = texture[inner], values[inner]
    place = np.linspace(-1.0, 1.0, texture.shape[-1])
    columns = [-by_x, -by_y, texture, texture * place, texture * place[:, None]]
    system = np.stack(columns, axis=-1).reshape(len(corners), -1, len(columns))
    weight = weight.reshape(len(corners), -1)
    weighted = system * weight[..., None]
    normal = weighted.swapaxes(1, 2) @ system
    size = np.sqrt(np.maximum(np.einsum("kii->ki", normal), 1e-30))
    inverse = np.linalg.inv(normal / (size[:, :, None] * size[:, None, :]) + RIDGE * np.eye(len(columns)))
    inverse /= size[:, :, None] * size[:, None, :]
    seen = values.reshape(len(values), len(corners), -1).transpose(1, 0, 2)
    solution = (seen @ weighted) @ inverse
    residual = seen - solution @ system.swapaxes(1, 2)
    variance = (weight[:, None] * residual**2).sum(axis=2) / np.maximum(count - len(columns), 1.0)[:, None]
    information = np.linalg.inv(inverse[:, :2, :2])[:, None] / np.maximum(variance, 1e-12)[..., None, None]
    textured = (count >= LEAST_PIXELS) & (signal > LEAST_SIGNAL * noise)
    return solution[textured, :, :2], information[textured]


def _together(moves: Array, information: Array) -> tuple[Array, Array]:
    """(L, 2) robust means over the tiles, and (L,) standard uncertainties by how much the tiles scatter."""
    weight = np.ones(moves.shape[:2])
    for _ in range(ROUNDS):
        weighted = information * weight[..., None, None]
        total = np.linalg.pinv(weighted.sum(axis=0))
        mean = np.einsum("lij,klij,klj->li", total, weighted, moves, optimize=True)
        off = moves - mean
        square = np.einsum("kli,klij,klj->kl", off, information, off, optimize=True) / 2.0
        scale = np.maximum((weight * square).sum(axis=0) / np.maximum(weight.sum(axis=0) - 1.0, 1.0), 1.0)
        weight = 1.0 / (1.0 + square / (CAUCHY**2 * scale))
    covariance = total * scale[:, None, None]
    return mean, np.sqrt(np.einsum("lii->l", covariance) / 2.0)


def _gradient(values: Array) -> tuple[Array, Array]:
    """Differences per pixel along x, right, and y, up; a pixel less on each side."""
    by_x = (values[..., 1:-1, 2:] - values[..., 1:-1, :-2]) / 2.0
    by_y = (values[..., :-2, 1:-1] - values[..., 2:, 1:-1]) / 2.0
    return by_x, by_y


def _smooth(values: Array) -> Array:
    """Binomial filter of three pixels along rows and columns; a pixel less on each side."""
    values = values[..., :-2, :] + 2.0 * values[..., 1:-1, :] + values[..., 2:, :]
    smooth: Array = (values[..., :-2] + 2.0 * values[..., 1:-1] + values[..., 2:]) / 16.0
    return smooth


def _all_around(good: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Where a pixel and its eight neighbours are good; a pixel less on each side."""
    good = good[..., :-2, :] & good[..., 1:-1, :] & good[..., 2:, :]
    around: NDArray[np.bool_] = good[..., :-2] & good[..., 1:-1] & good[..., 2:]
    return around
