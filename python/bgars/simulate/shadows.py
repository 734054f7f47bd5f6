"""Which samples a light reaches: attached shadows by N.L, cast shadows by exact rays."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bgars.simulate.checks import require
from bgars.simulate.solids import Array, Bounds, Points
from bgars.simulate.surface import Patch, World, window

if TYPE_CHECKING:
    from bgars.records.rig import LightRig

__all__ = ["Beam", "beam_at", "check_lights", "is_lit"]


class Beam(NamedTuple):
    """Light at the samples of a patch.

    `toward` is the unit vector to the light and `ray` the vector that the shadow test walks along, for
    0 < t < `length`: the light itself is at ``t = 1`` when it is near.
    """

    toward: Points
    ray: Points
    length: float
    irradiance: Array


def beam_at(rig: LightRig, light: int, patch: Patch) -> Beam:
    """Direction and irradiance of one light at every sample.

    Distant: irradiance = intensity on a plane that faces the light. Near: intensity (d0 / d)^2.
    """
    intensity = float(rig.intensities[light])
    if rig.positions_um is None or rig.intensity_distance_um is None:
        distant = Points(*(np.full((1, 1), part) for part in rig.directions[light]))
        return Beam(distant, distant, np.inf, np.full((1, 1), intensity))
    place = rig.positions_um[light]
    ray = Points(place[0] - patch.x_um[None, :], place[1] - patch.y_um[:, None], place[2] - patch.z_um)
    square = ray.x * ray.x + ray.y * ray.y + ray.z * ray.z
    distance = np.sqrt(square)
    toward = Points(ray.x / distance, ray.y / distance, ray.z / distance)
    return Beam(toward, ray, 1.0, intensity * float(rig.intensity_distance_um[light]) ** 2 / square)


def is_lit(world: World, rig: LightRig, light: int, patch: Patch, beam: Beam, floor_um: float) -> NDArray[np.bool_]:
    """(R, C) bool: the facet faces the light and nothing stands between."""
    normal, toward = patch.normal, beam.toward
    lit: NDArray[np.bool_] = normal.x * toward.x + normal.y * toward.y + normal.z * toward.z > 0.0
    for index, solid in enumerate(world.solids):
        rows, cols = window(patch.x_um, patch.y_um, *_shadow_box(rig, light, solid.bounds, floor_um))
        if rows.start >= rows.stop or cols.start >= cols.stop:
            continue
        start = Points(patch.x_um[None, cols], patch.y_um[rows, None], patch.z_um[rows, cols])
        ray = Points(*(part if part.size == 1 else _cut(part, rows, cols) for part in beam.ray))
        shaded = solid.blocks(start, ray, beam.length)
        # Convex: no shadow on itself; asking would only find rounding.
        shaded &= patch.owner[rows, cols] != index
        lit[rows, cols] &= ~shaded
    return lit


def _cut(part: Array, rows: slice, cols: slice) -> Array:
    return part[rows if part.shape[0] > 1 else slice(None), cols if part.shape[1] > 1 else slice(None)]


def _shadow_box(rig: LightRig, light: int, box: Bounds, floor_um: float) -> tuple[float, float, float, float]:
    """x0, x1, y0, y1 around a solid and its shadow down to the lowest board."""
    if rig.positions_um is None:
        toward = rig.directions[light]
        fall = (box.top - floor_um) / toward[2]
        shift_x, shift_y = -fall * toward[0], -fall * toward[1]
        return (
            box.x0 + min(shift_x, 0.0),
            box.x1 + max(shift_x, 0.0),
            box.y0 + min(shift_y, 0.0),
            box.y1 + max(shift_y, 0.0),
        )
    place = rig.positions_um[light]
    # Corners of the top, thrown on the floor: no lower point of the box is thrown farther.
    scale = (place[2] - floor_um) / (place[2] - box.top)
    xs = [box.x0, box.x1, *(place[0] + (x - place[0]) * scale for x in (box.x0, box.x1))]
    ys = [box.y0, box.y1, *(place[1] + (y - place[1]) * scale for y in (box.y0, box.y1))]
    return min(xs), max(xs), min(ys), max(ys)


def check_lights(world: World, rig: LightRig, x_um: Array, y_um: Array) -> None:
    """Refuse lights below the board anywhere in the image, or below the top of a ball.

    With ``N.L > 0`` everywhere on a plane or a bow (a quadric), the board casts no shadow on what is in the image.
    """
    corners_x, corners_y = np.meshgrid(x_um[[0, -1]], y_um[[0, -1]])
    z_um = world.board.height_um(corners_x, corners_y)
    normal = Points(*(np.broadcast_to(part, z_um.shape) for part in world.board.normal(corners_x, corners_y)))
    tops = max((solid.bounds.top for solid in world.solids), default=float(z_um.max()))
    for light in range(len(rig)):
        if rig.positions_um is None:
            toward = rig.directions[light]
            facing = normal.x * toward[0] + normal.y * toward[1] + normal.z * toward[2]
            name = f"rig.directions[{light}]"
            require(bool(toward[2] > 0), name, "must point above the board (z > 0)", float(toward[2]))
        else:
            place = rig.positions_um[light]
            name = f"rig.positions_um[{light}]"
            require(bool(place[2] > tops), name, f"must be above the highest ball ({tops:g} um); z is", float(place[2]))
            facing = (
                normal.x * (place[0] - corners_x) + normal.y * (place[1] - corners_y) + normal.z * (place[2] - z_um)
            )
        rule = "must shine on the board's upper side in the whole image; smallest N.L"
        require(bool((facing > 0).all()), name, rule, float(facing.min()))
