"""A light stack of any size: a rendered scene tiled with every other tile mirrored, or spheres rendered here."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import bgars
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

LIGHTS = 8
SCENES = ("G_grid_10x10_large", "D2_grid_5x5_defects_bow", "C_grid_4x4_paper")
"""Scenes to take, the first that is there: with noise, so that the kept lights change from pixel to pixel."""
TILE_PX = 640
"""Side of the rendered tile: no divisor of the sizes asked for."""


class Stack(NamedTuple):
    """Images (L, H, W) uint8, unit directions (L, 3), and where they come from."""

    images: NDArray[np.uint8]
    directions: NDArray[np.float64]
    source: str


def data_folder() -> Path:
    """$BGARS_DATA, or the folder beside the repository where it usually is."""
    given = os.environ.get("BGARS_DATA")
    return Path(given) if given else Path(__file__).parents[2].parent / "shared" / "data"


def make_stack(rows: int, cols: int) -> Stack:
    """A stack of 8 lights; each pixel keeps its 8 values together, so every pixel is one the scene has."""
    for name in SCENES:
        folder = data_folder() / "scenes" / name
        if folder.is_dir():
            capture = bgars.read_capture(folder)
            tile = np.asarray(capture.images)
            if tile.dtype == np.uint8 and len(tile) == LIGHTS:
                return Stack(_tiled(tile, rows, cols), capture.rig.directions, f"scene {name}, tiled and mirrored")
    directions = bgars.LightRig.ring(LIGHTS).directions
    images = sphere_stack(directions, np.dtype(np.uint8), rows, cols)
    return Stack(images, directions, "spheres with a highlight and noise, tiled")


def sphere_stack(directions: NDArray[np.float64], dtype: np.dtype, rows: int, cols: int) -> NDArray[np.generic]:
    """Rendered spheres, tiled: images (L, H, W) of any pixel type, floats up to 1, and any number of lights."""
    is_integer = dtype.kind == "u"
    per_level = (np.iinfo(dtype).max if is_integer else 1.0) / 255.0
    tile = np.stack([image * per_level for image in _spheres(directions)])
    return _tiled((tile.round() if is_integer else tile).astype(dtype), rows, cols)


def _tiled(tile: NDArray[np.generic], rows: int, cols: int) -> NDArray[np.generic]:
    height, width = tile.shape[1:]
    images = np.zeros((len(tile), rows, cols), dtype=tile.dtype)
    for i, top in enumerate(range(0, rows, height)):
        for j, left in enumerate(range(0, cols, width)):
            part = tile[:, :: -1 if i % 2 else 1, :: -1 if j % 2 else 1][:, : rows - top, : cols - left]
            images[:, top : top + part.shape[1], left : left + part.shape[2]] = part
    return images


def _spheres(directions: NDArray[np.float64]) -> Iterator[NDArray[np.float64]]:
    """Spheres of different sizes on a plane, 0 to 255: diffuse plus a Blinn-Phong lobe, attached shadows, noise."""
    random = np.random.default_rng(7)
    y, x = np.mgrid[0:TILE_PX, 0:TILE_PX].astype(np.float64)
    normals = np.zeros((TILE_PX, TILE_PX, 3))
    normals[..., 2] = 1.0
    for col in range(40, TILE_PX, 80):
        for row in range(40, TILE_PX, 80):
            radius_px = random.uniform(20.0, 38.0)
            u, v = (x - col) / radius_px, (row - y) / radius_px
            inside = u * u + v * v < 0.98
            normals[inside] = np.stack([u, v, np.sqrt(np.maximum(1.0 - u * u - v * v, 0.0))], axis=-1)[inside]
    for light in directions:
        half = light + np.array([0.0, 0.0, 1.0])
        half /= np.linalg.norm(half)
        grey = 110.0 * np.maximum(normals @ light, 0.0) + 220.0 * np.maximum(normals @ half, 0.0) ** 60
        yield np.clip(grey + random.normal(2.0, 1.5, grey.shape), 0.0, 255.0)
