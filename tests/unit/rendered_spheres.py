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
    cx, cy, radius = ball
    inside = np.add.outer((rows - cy) ** 2, (cols - cx) ** 2) < radius**2
    at_row, at_col = np.nonzero(inside)
    # Rays are rows of these, of the ball's and of the board's alone: no ray is computed for both.
    ball_x, ball_y = cols[at_col], rows[at_row]
    rise = np.sqrt(np.maximum(radius**2 - (ball_x - cx) ** 2 - (ball_y - cy) ** 2, 0.0))
    normals = (ball_x - cx) / radius, (ball_y - cy) / radius, rise / radius
    row, col = np.nonzero(~inside)
    board_x, board_y = cols[col], rows[row]
    rng = np.random.default_rng(seed)
    images = []
    power = np.ones(len(lights)) if intensities is None else intensities
    for index, light in enumerate(lights):

        def to_light(x: Array, y: Array, z: Array, light: Array = light) -> tuple[Array, Array, Array, Array]:
            ways = (light[0] - x, light[1] - y, light[2] - z) if near else np.split(light, 3)
            distance = np.sqrt(ways[0] ** 2 + ways[1] ** 2 + ways[2] ** 2) if near else np.ones(1)
            fall = (np.linalg.norm(light) / distance) ** 2 if near else distance
            return ways[0] / distance, ways[1] / distance, ways[2] / distance, fall

        def board_level(x: Array, y: Array, index: int = index) -> Array:
            way_x, way_y, way_z, fall = to_light(x, y, np.zeros(1))
            toward = (cx - x) * way_x + (cy - y) * way_y + radius * way_z
            miss_x, miss_y, miss_z = cx - x - toward * way_x, cy - y - toward * way_y, radius - toward * way_z
            lit = ~((toward > 0) & (np.sqrt(miss_x**2 + miss_y**2 + miss_z**2) < radius))
            level: Array = board * (room + power[index] * fall * way_z * lit)
            return level

        if kind == "mirror":
            seen = np.full(len(rise), room)
            normal_x, normal_y, normal_z = normals
            down = 2 * normal_z**2 - 1 < -1e-3
            reach = -(radius + rise[down]) / (2 * normal_z[down] ** 2 - 1)
            slope = reach * 2 * normal_z[down]
            seen[down] = board_level(ball_x[down] + slope * normal_x[down], ball_y[down] + slope * normal_y[down])
            on_ball = (0.6 if refraction is None else mirrored_share(normal_z, refraction)) * seen
        else:
            way_x, way_y, way_z, fall = to_light(ball_x, ball_y, radius + rise)
            cosine = normals[0] * way_x + normals[1] * way_y + normals[2] * way_z
            on_ball = albedo * (room + power[index] * fall * np.maximum(cosine, 0.0))
        level = np.zeros(inside.shape)
        level[inside], level[~inside] = on_ball, board_level(board_x, board_y)
        picture = level.reshape(height, samples, width, samples).mean(axis=(1, 3))
        if kind == "mirror":
            add_lamp(picture, light, ball, lamp_deg, 0.6 * (lamp_level * power[index] - room), near)
        if blur_px > 0:
            picture = gaussian_filter(picture, blur_px)
        picture = exposure * picture + rng.normal(0.0, noise, picture.shape)
        full = 2**bits - 1
        images.append(np.clip(np.rint(picture * full / 255), 0, full).astype(np.uint8 if bits == 8 else np.uint16))
    return np.stack(images)
