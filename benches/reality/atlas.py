"""How the solder of each ball differs: an atlas of factors, one tile a ball."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates

if TYPE_CHECKING:
    from balls import Ball
    from numpy.typing import NDArray
    from setup_records import Setup

TILE = (256, 512)
"""Texels of a ball: from pole to pole, around."""
COLUMNS = 5
DIFFUSE, ROUGHNESS, WEIGHT = 0, 1, 2
"""Layers of the atlas: factors of diffuse albedo, of roughness, of the metallic weight."""
VOXEL_MM, VOXELS = 0.008, 128
"""Blocks of noise that the oxide of all balls is cut from."""
OXIDE_SCALES_UM = ((10.0, 0.6), (40.0, 0.8))
"""Sizes of oxide patches (um), and how much each counts."""


def rows_of(count: int) -> int:
    """Rows of tiles for so many balls."""
    return -(-count // COLUMNS)


def material_atlas(setup: Setup, balls: list[Ball]) -> NDArray[np.float32]:
    """Factors (3, rows of texels, columns of texels)."""
    atlas = np.ones((3, rows_of(len(balls)) * TILE[0], COLUMNS * TILE[1]), np.float32)
    random = np.random.default_rng([setup.seed, 21])
    factors = [[float(1 + s * random.uniform(-1, 1)) for s in setup.solder.ball_spread] for _ in balls]
    blocks = [_noise_block(random) for _ in range(2)]
    spread = setup.solder.oxide_spread
    places = _sphere() * (setup.part.diameter_mm / 2 / VOXEL_MM)
    for ball, (roughness, diffuse, weight) in zip(balls, factors, strict=True):
        tile = _tile(atlas, ball)
        where = places + random.uniform(0, VOXELS, 3)[:, None, None]
        first, second = (
            np.clip(map_coordinates(block, where, order=1, mode="grid-wrap"), -2.5, 2.5) for block in blocks
        )
        tile[DIFFUSE] = diffuse * (1 + spread[0] * first)
        tile[ROUGHNESS] = roughness * (1 + spread[1] * (0.5 * first + 0.866 * second))
        tile[WEIGHT] = weight * (1 - spread[2] * first)
    if setup.solder.dirty:
        random = np.random.default_rng([setup.seed, 55])
        for ball in balls:
            _soil(_tile(atlas, ball), random)
    return atlas


def _tile(atlas: NDArray[np.float32], ball: Ball) -> NDArray[np.float32]:
    row, col = divmod(ball.number - 1, COLUMNS)
    return atlas[:, row * TILE[0] : (row + 1) * TILE[0], col * TILE[1] : (col + 1) * TILE[1]]


def _sphere() -> NDArray[np.float64]:
    """Unit vectors (3, polar, azimuth) of the texels of a tile."""
    polar, azimuth = np.meshgrid(np.linspace(0, np.pi, TILE[0]), np.linspace(0, 2 * np.pi, TILE[1]), indexing="ij")
    return np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)])


def _noise_block(random: np.random.Generator) -> NDArray[np.float32]:
    total: NDArray[np.float32] = np.zeros((VOXELS,) * 3, np.float32)
    for scale_um, share in OXIDE_SCALES_UM:
        white = random.standard_normal((VOXELS,) * 3).astype(np.float32)
        smooth = gaussian_filter(white, scale_um * 1e-3 / VOXEL_MM, mode="wrap")
        total = total + share * smooth / smooth.std()
    return np.asarray(total / total.std())


def _soil(tile: NDArray[np.float32], random: np.random.Generator) -> None:
    """Scratches (rougher), flux (matte) and burnt spots (dark), in place."""
    high, wide = tile.shape[1:]
    for _ in range(random.integers(2, 7)):
        start = random.uniform([0, 10], [wide, high * 0.55])
        end = start + random.uniform(-90, 90, 2)
        mask = np.zeros((high, wide), np.float32)
        cv2.line(mask, _texel(start), _texel(end), 1.0, int(random.integers(1, 3)), cv2.LINE_AA)
        tile[ROUGHNESS] *= 1 + 1.5 * mask
        tile[WEIGHT] *= 1 - 0.25 * mask
        tile[DIFFUSE] *= 1 + 0.3 * mask
    for _ in range(random.integers(0, 3)):
        middle = random.uniform([0, 0], [wide, high * 0.5])
        axes = int(random.uniform(25, 90)), int(random.uniform(10, 30))
        mask = np.zeros((high, wide), np.float32)
        cv2.ellipse(mask, _texel(middle), axes, random.uniform(0, 180), 0, 360, 1.0, -1)
        mask = cv2.GaussianBlur(mask, (0, 0), 5)
        tile[WEIGHT] *= 1 - 0.7 * mask
        tile[DIFFUSE] *= 1 + 0.1 * mask
    for _ in range(random.integers(0, 3)):
        middle = random.uniform([0, 0], [wide, high * 0.5])
        mask = np.zeros((high, wide), np.float32)
        cv2.circle(mask, _texel(middle), int(random.uniform(4, 14)), 1.0, -1)
        mask = cv2.GaussianBlur(mask, (0, 0), 2)
        tile[DIFFUSE] *= 1 - 0.7 * mask
        tile[WEIGHT] *= 1 - 0.3 * mask


def _texel(place: NDArray[np.float64]) -> tuple[int, int]:
    return int(place[0]), int(place[1])
