"""Tiles of rows, rendered by a pool of threads: bounded memory, the same bits for any tiles and threads."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bgars.simulate.blur import blur
from bgars.simulate.shading import Finish, reflected
from bgars.simulate.shadows import Beam, beam_at, is_lit
from bgars.simulate.solids import Array, Points

if TYPE_CHECKING:
    from collections.abc import Callable

    from bgars.records.rig import LightRig
    from bgars.simulate.camera import Camera
    from bgars.simulate.material import Material
    from bgars.simulate.sensor import Sensor
    from bgars.simulate.surface import Patch, World

__all__ = ["Frames", "Studio", "render"]

EIGHT_BITS = 8
TILE_PIXELS = 1 << 17
"""Samples of a tile: about 1 MB an array, so that a tile's working set stays near the caches."""


@dataclass(frozen=True)
class Studio:
    """Everything that a tile needs.

    `finishes` holds the factors of each solid (the board is last); `floor_um` is no higher than the lowest board.
    """

    world: World
    rig: LightRig
    material: Material
    camera: Camera
    sensor: Sensor
    shape: tuple[int, int]
    finishes: Finish
    floor_um: float


@dataclass(frozen=True, eq=False)
class Frames:
    """What rendering fills in: images and, at pixel centres, truth."""

    images: NDArray[np.uint8] | NDArray[np.uint16]
    normals: NDArray[np.float32]
    height_px: NDArray[np.float32]
    labels: NDArray[np.int16]
    lit: NDArray[np.bool_]

    @classmethod
    def blank(cls, lights: int, shape: tuple[int, int], bit_depth: int) -> Frames:
        """Allocate."""
        stack = (lights, *shape)
        return cls(
            images=np.zeros(stack, np.uint8) if bit_depth == EIGHT_BITS else np.zeros(stack, np.uint16),
            normals=np.zeros((*shape, 3), dtype=np.float32),
            height_px=np.zeros(shape, dtype=np.float32),
            labels=np.zeros(shape, dtype=np.int16),
            lit=np.zeros(stack, dtype=np.bool_),
        )


def render(
    studio: Studio,
    *,
    threads: int | None = None,
    tile_rows: int | None = None,
    progress: Callable[[float], object] | None = None,
) -> Frames:
    """Render all lights; `threads` and `tile_rows` change the speed, not one bit of the result."""
    rows, cols = studio.shape
    frames = Frames.blank(len(studio.rig), studio.shape, studio.camera.bit_depth)
    step = tile_rows or max(TILE_PIXELS // cols, 1)
    starts = range(0, rows, step)
    workers = threads or default_threads()
    with ThreadPoolExecutor(max_workers=workers) as pool:
        tiles = [pool.submit(_render_tile, studio, frames, start, min(start + step, rows)) for start in starts]
        try:
            for done, tile in enumerate(tiles, start=1):
                tile.result()
                if progress is not None:
                    progress(done / len(tiles))
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return frames


def default_threads() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _render_tile(studio: Studio, frames: Frames, first: int, last: int) -> None:
    """Fill rows `first` to `last` of the frames."""
    camera, lights = studio.camera, len(studio.rig)
    rows, cols = studio.shape
    x_um, y_um = camera.centres_um(cols, down=False), camera.centres_um(rows, down=True)[first:last]
    centre = studio.world.look(x_um, y_um)
    inside = slice(first, last)
    frames.normals[inside] = np.stack(centre.normal, axis=2)
    frames.height_px[inside] = centre.z_um / camera.pixel_pitch_um
    frames.labels[inside] = studio.world.labels[centre.owner]
    direct = camera.supersample == 1 and camera.halo_px == 0
    signals = [] if direct else _box_filtered(studio, first, last)
    albedo = _board_albedo(studio, centre, (first, 0)) if direct else 1.0
    for light in range(lights):
        beam = beam_at(studio.rig, light, centre)
        lit = is_lit(studio.world, studio.rig, light, centre, beam, studio.floor_um)
        frames.lit[light, inside] = lit
        signal = _signal(studio, centre, beam, lit, albedo) if direct else signals[light]
        frames.images[light, inside] = studio.sensor.expose(signal, light, first)


def _box_filtered(studio: Studio, first: int, last: int) -> list[Array]:
    """Signals of all lights, averaged over the samples of a pixel, then blurred."""
    camera, lights = studio.camera, len(studio.rig)
    rows, cols = studio.shape
    halo, count = camera.halo_px, camera.supersample
    pitch_um = camera.pixel_pitch_um
    # A halo continues the grid of pixel centres beyond the image, where the blur reaches.
    x_um = (np.arange(-halo, cols + halo) + 0.5 - cols / 2) * pitch_um
    y_um = (rows / 2 - np.arange(first - halo, last + halo) - 0.5) * pitch_um
    sums = [np.zeros((len(y_um), len(x_um))) for _ in range(lights)]
    shifts_um = ((np.arange(count) + 0.5) / count - 0.5) * pitch_um
    for down_um in shifts_um:
        for right_um in shifts_um:
            patch = studio.world.look(x_um + right_um, y_um - down_um)
            albedo = _board_albedo(studio, patch, (first - halo, -halo))
            for light in range(lights):
                beam = beam_at(studio.rig, light, patch)
                lit = is_lit(studio.world, studio.rig, light, patch, beam, studio.floor_um)
                sums[light] += _signal(studio, patch, beam, lit, albedo)
    return [blur(total / count**2, camera.blur_px, halo) for total in sums]


def _signal(studio: Studio, patch: Patch, beam: Beam, lit: NDArray[np.bool_], albedo: Array | float) -> Array:
    """Light of the lit samples, as a fraction of full scale; `albedo` is the board's factor at every sample."""
    signal = np.zeros(patch.z_um.shape)
    on_board = patch.owner < 0
    board = studio.world.board
    for is_board in (True, False):
        chosen = (on_board if is_board else ~on_board) & lit
        where = np.flatnonzero(chosen)
        if not where.size:
            continue
        if is_board:
            finish = Finish(i_d=albedo.take(where) if isinstance(albedo, np.ndarray) else albedo)
        else:
            owner = patch.owner.take(where)
            finish = Finish(*(np.asarray(factor)[owner] for factor in _factors(studio.finishes)))
        normal = Points(*(component.take(where) for component in patch.normal))
        toward = Points(*(_pick(component, where) for component in beam.toward))
        material = board.material if is_board else studio.material
        signal.put(where, reflected(material, finish, normal, toward) * _pick(beam.irradiance, where))
    return signal


def _factors(finish: Finish) -> tuple[Array | float, Array | float, Array | float]:
    return finish.i_d, finish.i_s, finish.roughness


def _pick(values: Array, where: NDArray[np.intp]) -> Array:
    return values.ravel() if values.size == 1 else values.take(where)


def _board_albedo(studio: Studio, patch: Patch, corner: tuple[int, int]) -> Array | float:
    """The board's factor at every sample; `corner` is the image place of the first."""
    board = studio.world.board
    if board.texture is not None:
        return board.texture.factor(patch.x_um, patch.y_um)
    if board.albedo_map is not None:
        rows, cols = studio.shape
        row = np.clip(np.arange(corner[0], corner[0] + len(patch.y_um)), 0, rows - 1)
        col = np.clip(np.arange(corner[1], corner[1] + len(patch.x_um)), 0, cols - 1)
        return board.albedo_map[row][:, col]
    return 1.0
