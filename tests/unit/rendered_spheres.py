"""A small ray tracer for tests: a mirror or matt ball on a grey board, lamps with an extent, a telecentric camera.

Rays meet the sphere, are reflected by the law of reflection, and see a lamp, the lit board (with the ball's shadow on
it) or the dark room. Nothing of the package is used.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

Array = NDArray[np.float64]


def unit(vectors: Array) -> Array:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def mirrored_share(cosine: Array, index: complex) -> Array:
    """Fresnel's equations by Snell's law; the refractive index of a metal is complex."""
    inner = np.sqrt(1.0 - (1.0 - cosine**2) / index**2)
    across = (cosine - index * inner) / (cosine + index * inner)
    along = (inner - index * cosine) / (inner + index * cosine)
    return 0.5 * (np.abs(across) ** 2 + np.abs(along) ** 2)


def ring(count: int, elevation_deg: float, azimuth0_deg: float = 10.0) -> Array:
    azimuth = np.radians(azimuth0_deg + 360.0 / count * np.arange(count))
    elevation = np.radians(elevation_deg)
    return np.column_stack(
        [np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.full(count, np.sin(elevation))]
    )


def add_lamp(
    picture: Array,
    light: Array,
    ball: tuple[float, float, float],
    lamp_deg: float,
    level: float,
    near: bool,
    fine: int = 30,
) -> None:
    """Add a lamp as the ball mirrors it, finely sampled: a share of a per cent of a pixel is seen in it."""
    height, width = picture.shape
    cx, cy, radius = ball

    def angle(x: Array, y: Array) -> Array:
        nx, ny = (x - cx) / radius, (y - cy) / radius
        nz = np.sqrt(np.maximum(1.0 - nx**2 - ny**2, 0.0))
        mirrored = np.stack([2 * nz * nx, 2 * nz * ny, 2 * nz**2 - 1], axis=-1)
        way = np.broadcast_to(light, mirrored.shape)
        if near:
            way = unit(light - np.stack([x, y, radius * (1.0 + nz)], axis=-1))
        return np.where(nx**2 + ny**2 < 1, np.arccos(np.clip(np.sum(mirrored * way, axis=-1), -1, 1)), np.pi)

    x, y = np.meshgrid(np.arange(width) + 0.5 - width / 2.0, height / 2.0 - np.arange(height) - 0.5)
    row, col = np.unravel_index(angle(x, y).argmin(), picture.shape)
    half = int(radius * np.radians(lamp_deg)) + 3
    step = (np.arange(fine) + 0.5) / fine
    rows, cols = np.arange(row - half, row + half + 1), np.arange(col - half, col + half + 1)
    x, y = np.meshgrid((cols[:, None] + step).ravel() - width / 2.0, height / 2.0 - (rows[:, None] + step).ravel())
    inside = angle(x, y) < np.radians(lamp_deg / 2)
    cover = inside.reshape(len(rows), fine, len(cols), fine).mean(axis=(1, 3))
    picture[rows[0] : rows[-1] + 1, cols[0] : cols[-1] + 1] += level * cover


def render(
    lights: Array,
    *,
    ball: tuple[float, float, float],
    size: tuple[int, int] = (300, 300),
    kind: str = "mirror",
    lamp_deg: float = 2.0,
    near: bool = False,
    board: float = 0.5,
    room: float = 0.02,
    lamp_level: float = 40.0,
    albedo: float = 0.7,
    exposure: float = 180.0,
    noise: float = 1.0,
    intensities: Array | None = None,
    blur_px: float = 0.0,
    seed: int = 0,
    samples: int = 5,
    bits: int = 8,
    refraction: complex | None = None,
) -> NDArray[np.uint8]:
    """Return (L, H, W) images; `ball` is x, y, radius in pixels from the image centre, y up; it rests on the board.

    `lights` are unit directions, or positions in pixels with `near`; `lamp_deg` is the whole angle of a lamp.
    A mirror reflects 0.6 at any angle, or as Fresnel's equations say of a refractive index.
    """
    height, width = size
    step = (np.arange(samples) + 0.5) / samples
    cols = (np.arange(width)[:, None] + step).ravel() - width / 2.0
    rows = height / 2.0 - (np.arange(height)[:, None] + step).ravel()
    x, y = np.meshgrid(cols, rows)
    cx, cy, radius = ball
    centre = np.array([cx, cy, radius])
    inside = (x - cx) ** 2 + (y - cy) ** 2 < radius**2
    rise = np.sqrt(np.maximum(radius**2 - (x - cx) ** 2 - (y - cy) ** 2, 0.0))
    points = np.stack([x, y, np.where(inside, radius + rise, 0.0)], axis=-1)
    normals = np.where(inside[..., None], (points - centre) / radius, [0.0, 0.0, 1.0])
    mirrored = np.stack(
        [2 * normals[..., 2] * normals[..., 0], 2 * normals[..., 2] * normals[..., 1], 2 * normals[..., 2] ** 2 - 1],
        axis=-1,
    )
    rng = np.random.default_rng(seed)
    images = []
    power = np.ones(len(lights)) if intensities is None else intensities
    for index, light in enumerate(lights):

        def to_light(at: Array, light: Array = light) -> tuple[Array, Array]:
            if not near:
                return np.broadcast_to(light, at.shape), np.ones(at.shape[:-1])
            way = light - at
            distance = np.linalg.norm(way, axis=-1)
            return way / distance[..., None], (np.linalg.norm(light) / distance) ** 2

        def board_level(at: Array, index: int = index) -> Array:
            way, fall = to_light(at)
            toward = np.sum((centre - at) * way, axis=-1)
            miss = np.linalg.norm(centre - at - toward[..., None] * way, axis=-1)
            lit = ~((toward > 0) & (miss < radius))
            return board * (room + power[index] * fall * way[..., 2] * lit)

        way, fall = to_light(points)
        if kind == "mirror":
            seen = np.full(inside.shape, room)
            down = inside & (mirrored[..., 2] < -1e-3)
            reach = np.where(down, -points[..., 2] / np.where(down, mirrored[..., 2], -1.0), 0.0)
            ground = points + reach[..., None] * mirrored
            ground[..., 2] = 0.0
            seen = np.where(down, board_level(ground), seen)
            share = 0.6 if refraction is None else mirrored_share(normals[..., 2], refraction)
            level = np.where(inside, share * seen, board_level(points * [1, 1, 0]))
        else:
            shade = albedo * (room + power[index] * fall * np.maximum(np.sum(normals * way, axis=-1), 0.0))
            level = np.where(inside, shade, board_level(points * [1, 1, 0]))
        picture = level.reshape(height, samples, width, samples).mean(axis=(1, 3))
        if kind == "mirror":
            add_lamp(picture, light, ball, lamp_deg, 0.6 * (lamp_level * power[index] - room), near)
        if blur_px > 0:
            picture = gaussian_filter(picture, blur_px)
        picture = exposure * picture + rng.normal(0.0, noise, picture.shape)
        full = 2**bits - 1
        images.append(np.clip(np.rint(picture * full / 255), 0, full).astype(np.uint8 if bits == 8 else np.uint16))
    return np.stack(images)
