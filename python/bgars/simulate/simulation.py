"""The simulator: scene, rig, material and camera become a capture and its truth."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bgars.errors import InputError
from bgars.records.capture import Capture
from bgars.records.rig import LightRig
from bgars.records.scalar_checks import check_progress
from bgars.simulate.array import truncated_normal
from bgars.simulate.camera import Camera
from bgars.simulate.checks import require, whole
from bgars.simulate.material import Material
from bgars.simulate.render import Studio, render
from bgars.simulate.scene import Scene
from bgars.simulate.sensor import Sensor, stream_key
from bgars.simulate.shading import Finish
from bgars.simulate.shadows import check_lights
from bgars.simulate.surface import World
from bgars.simulate.truth import SimulatedTruth, SimulationSetup, ball_table, coplanarities

if TYPE_CHECKING:
    from collections.abc import Callable

    from bgars.simulate.board import Board
    from bgars.simulate.material import Variation
    from bgars.simulate.solids import Array, Solid

__all__ = ["simulate"]

MOST_THREADS = 64

VARIATION_KEY = 1 << 63
"""Sets the streams of the ball-to-ball variation apart from those of the noise."""
MAX_SEED = (1 << 63) - 1


def simulate(
    scene: Scene,
    rig: LightRig,
    material: Material,
    camera: Camera,
    *,
    seed: int = 0,
    threads: int | None = None,
    progress: Callable[[float], object] | None = None,
    tile_rows: int | None = None,
) -> tuple[Capture, SimulatedTruth]:
    """Photograph a scene under each light of a rig.

    A facet that the light reaches reads, as a fraction of full scale (Cook & Torrance 1982),

    ``E [ I_d N.L + sum_j I_s,j (D_j / D_j,0) G F / (N.V) ]``

    then gain, shot and read noise, black level, clipping, response, quantisation. One reflection only: no light goes
    from ball to ball or from board to ball. Attached shadows by ``N.L <= 0``, cast shadows by exact rays.

    Parameters
    ----------
    scene : Scene
        :meth:`Scene.plane`, :meth:`Scene.hemisphere`, :meth:`Scene.ball` or :meth:`Scene.ball_array`.
    rig : LightRig
        Distant lights, or near point lights with fall-off ``(d0 / d)^2``.
    material : Material
        Of balls and bridges; the board brings its own.
    camera : Camera
        Orthographic, along -z, centred on the origin.
    seed : int
        Of noise and of the variation from ball to ball. The same seed gives the same bits, for any `threads`.
    threads : int, optional
        Threads to render on; one per core by default.
    progress : callable, optional
        Called with the fraction done.
    tile_rows : int, optional
        Image rows in work at once on each thread, which bounds the memory; chosen for speed by default.

    Returns
    -------
    capture : Capture
        As :func:`bgars.read_capture` returns it.
    truth : SimulatedTruth
        Normals, heights, labels, lit masks at pixel centres; ball table; coplanarity.

    Raises
    ------
    InputError
        A light below the board, a map of another shape than the image, a seed or thread count out of range; scenes,
        materials and cameras check themselves when they are made.

    References
    ----------
    R. L. Cook, K. E. Torrance, A reflectance model for computer graphics, ACM Trans. Graph. 1 (1982) 7-24.
    B. Walter et al., Microfacet models for refraction through rough surfaces, EGSR 2007.

    Examples
    --------
    >>> import bgars
    >>> capture, truth = bgars.simulate(
    ...     bgars.Scene.hemisphere(900.0),
    ...     bgars.LightRig.ring(8, elevation_deg=45.0),
    ...     bgars.Material(i_d=0.5, i_s=1.0, hardness=40),
    ...     bgars.Camera(pixel_pitch_um=10.0),
    ... )
    >>> capture.images.shape, capture.images.dtype.name, float(truth.height_px.max()).__round__()
    ((8, 270, 270), 'uint8', 90)
    """
    check_progress(progress)
    for name, given, wanted in (
        ("scene", scene, Scene),
        ("rig", rig, LightRig),
        ("material", material, Material),
        ("camera", camera, Camera),
    ):
        if not isinstance(given, wanted):
            msg = f"{name}: must be a bgars.{wanted.__name__}, got {type(given).__name__}"
            raise InputError(msg)
    whole("seed", seed, 0, MAX_SEED)
    for name, count in (("threads", threads), ("tile_rows", tile_rows)):
        if count is not None:
            whole(name, count, 1)
    seed = int(seed)
    shape = camera.framed(scene.size_um)
    camera = replace(camera, shape=shape)
    board = scene.board
    if board.albedo_map is not None:
        require(board.albedo_map.shape == shape, "board.albedo_map", f"must be {shape}", board.albedo_map.shape)
    world = World.of(scene)
    x_um, y_um = camera.centres_um(shape[1], down=False), camera.centres_um(shape[0], down=True)
    check_lights(world, rig, x_um, y_um)
    sensor = Sensor(camera, seed)
    finishes = _finishes(material.variation, world.solids, seed)
    studio = Studio(world, rig, material, camera, sensor, shape, finishes, _floor_um(board, x_um, y_um, camera))
    # More threads only wait for each other.
    threads = None if threads is None else min(threads, MOST_THREADS)
    frames = render(studio, threads=threads, tile_rows=tile_rows, progress=progress)
    capture = Capture(
        images=frames.images,
        rig=rig,
        mask=np.ones(shape, dtype=np.bool_),
        pixel_pitch_um=camera.pixel_pitch_um,
        response=sensor.linear_levels(),
        black_level=camera.black_level,
        saturation=sensor.saturation_level,
        full_scale=camera.full_scale,
    )
    balls, seating, regression = coplanarities(ball_table(scene, material, world.solids, finishes))
    truth = SimulatedTruth(
        normals=frames.normals,
        ball_ids=frames.labels,
        mask=frames.labels > 0,
        height_um=(frames.height_px * camera.pixel_pitch_um).astype(np.float32),
        height_px=frames.height_px,
        lit=frames.lit,
        balls=balls,
        seating=seating,
        regression=regression,
        setup=SimulationSetup(scene, rig, material, camera, seed),
    )
    return capture, truth


def _finishes(variation: Variation, solids: list[Solid], seed: int) -> Finish:
    """Factors of each solid; each ball has its own stream, so another ball more changes none of the others."""
    factors = np.ones((3, len(solids) + 1))
    spread = np.array([variation.i_d, variation.i_s, variation.roughness])
    for index, solid in enumerate(solids):
        if solid.label > 0 and spread.any():
            random = np.random.Generator(np.random.Philox(key=stream_key(seed, VARIATION_KEY | solid.label)))
            factors[:, index] += spread * [truncated_normal(random) for _ in spread]
    return Finish(*factors)


def _floor_um(board: Board, x_um: Array, y_um: Array, camera: Camera) -> float:
    """A height that no board pixel is below, with room for samples beside the pixel centres."""
    reach_x, reach_y = (abs(float(place[0])) + (camera.halo_px + 1) * camera.pixel_pitch_um for place in (x_um, y_um))
    slope_x, slope_y = board.slopes
    bow = min(board.bow_um, board.bow_um * (1.0 - (reach_x**2 + reach_y**2) / board.bow_radius_um**2))
    return bow - abs(slope_x) * reach_x - abs(slope_y) * reach_y
