"""What is to be measured, in pixels: balls, lights, irradiances; and what stands in the way."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bgars.errors import InputError
from bgars.inspection.radiance import Radiance

if TYPE_CHECKING:
    from bgars.records.capture import Capture
    from bgars.records.found_balls import FoundBalls
    from bgars.records.rig import LightRig

__all__ = ["Problem", "make_problem", "thread_count"]

Array = NDArray[np.float64]

NEARBY_RADII = 7.0
"""Balls this many radii away may hide or shadow the board around a ball."""
FINDER_SAFETY = 1.5
"""Uncertainties of the finder count this much larger: they are its own word."""


@dataclass(frozen=True)
class Problem:
    """Balls and lights in pixels.

    Attributes
    ----------
    radiance : Radiance
    table : (N, 5) float64
        x, y, z (0), radius, q (1) of every ball found.
    u_centre, u_radius : (N,) float64
        The finder's uncertainties, with a margin.
    bridged : (N,) bool
    extra : (M, 5) float64
        Stand-ins for the solder of bridges: they hide and shadow, and are not measured.
    vectors : (L, 3) float64
        Directions, or positions.
    near : bool
    irradiance : (N, L) float64
        Of the board at each ball, relative.
    pitch_um : float
    u_rig_deg : (L,) float64 or None
        Standard uncertainty of each light's direction, where it was declared.
    camera_distance_mm : float or None
        Of the camera from the board, where it was declared; inf for a telecentric lens.
    u_pixel_pitch : float or None
        Relative standard uncertainty of the pixel pitch, where it was declared.
    q, u_q : float, float or None
        Usual vertical over horizontal radius of balls like these, and its standard uncertainty, where it was declared.
    """

    radiance: Radiance
    table: Array
    u_centre: Array
    u_radius: Array
    bridged: NDArray[np.bool_]
    extra: Array
    vectors: Array
    near: bool
    irradiance: Array
    pitch_um: float
    u_rig_deg: Array | None = None
    camera_distance_mm: float | None = None
    u_pixel_pitch: float | None = None
    q: float = 1.0
    u_q: float | None = None

    def stand_ins(self, table: Array) -> Array:
        """Stand-ins for bridges as high as balls usually are here."""
        rows = self.extra.copy()
        rows[:, 2] = rows[:, 3] * float(np.median(table[:, 2] / table[:, 3]))
        return rows

    def neighbours(self) -> list[Array]:
        """Per ball the (m, 5) balls and stand-ins near it, itself too."""
        everything = np.concatenate([self.table, self.extra])
        x, y, radius = everything[:, 0], everything[:, 1], everything[:, 3]
        reaches = NEARBY_RADII * np.maximum(self.table[:, 3], np.median(self.table[:, 3]))
        rows = zip(self.table[:, 0], self.table[:, 1], reaches, strict=True)
        return [everything[np.hypot(x - ball_x, y - ball_y) < reach + radius] for ball_x, ball_y, reach in rows]


def make_problem(capture: Capture, found: FoundBalls, roundness: tuple[float, float] | None = None) -> Problem:
    """Bring capture and found balls to pixels.

    Raises
    ------
    InputError
        No pixel pitch; a ball outside the image; an uncertainty or radius that is not above 0.
    """
    if capture.pixel_pitch_um is None:
        msg = "capture.pixel_pitch_um: needed to measure balls in micrometres, got None"
        raise InputError(msg)
    radiance = Radiance(capture)
    if capture.images.shape[0] != len(capture.rig):
        msg = f"capture: {capture.images.shape[0]} images but {len(capture.rig)} lights; they must be equal in number"
        raise InputError(msg)
    for ball in found.balls:
        for name in ("radius_px", "u_centre_px", "u_radius_px"):
            value = getattr(ball, name)
            if not (np.isfinite(value) and value > 0):
                msg = f"found: ball {ball.name}: {name} must be finite and above 0, got {value:g}"
                raise InputError(msg)
        inside = abs(ball.x_px) <= radiance.width / 2 and abs(ball.y_px) <= radiance.height / 2
        if not inside:
            msg = (
                f"found: ball {ball.name}: its centre must lie in the image of {radiance.width} x {radiance.height} "
                f"pixels, got ({ball.x_px:g}, {ball.y_px:g}) from the image centre"
            )
            raise InputError(msg)
    table = np.array([(ball.x_px, ball.y_px, 0.0, ball.radius_px, 1.0) for ball in found.balls]).reshape(-1, 5)
    names = {ball.name: index for index, ball in enumerate(found.balls)}
    joined = {name for pair in found.bridges for name in pair}
    rig = capture.rig
    vectors = rig.directions if rig.positions_um is None else rig.positions_um / capture.pixel_pitch_um
    return Problem(
        radiance,
        table,
        FINDER_SAFETY * np.array([ball.u_centre_px for ball in found.balls]),
        FINDER_SAFETY * np.array([ball.u_radius_px for ball in found.balls]),
        np.array([ball.kind == "bridged" or ball.name in joined for ball in found.balls], dtype=np.bool_),
        _stand_ins(table, [(names[a], names[b]) for a, b in found.bridges if a in names and b in names]),
        vectors.copy(),
        rig.is_near,
        _irradiance(rig, table, capture.pixel_pitch_um),
        float(capture.pixel_pitch_um),
        rig.u_deg,
        capture.camera_distance_mm,
        None if capture.pixel_pitch_u_um is None else capture.pixel_pitch_u_um / capture.pixel_pitch_um,
        *(roundness or (1.0, None)),
    )


def _stand_ins(table: Array, pairs: list[tuple[int, int]]) -> Array:
    """Balls along each bridge, a radius apart."""
    rows = []
    for first, second in pairs:
        one, two = table[first], table[second]
        count = max(2, int(np.hypot(*(two - one)[:2]) / min(one[3], two[3])))
        rows += [one + (two - one) * step / count for step in range(1, count)]
    return np.array(rows).reshape(-1, 5)


def _irradiance(rig: LightRig, table: Array, pitch_um: float) -> Array:
    """(N, L) irradiance of a level board at every ball."""
    if rig.positions_um is None or rig.intensity_distance_um is None:
        return np.repeat((rig.intensities * rig.directions[:, 2])[None, :], len(table), axis=0)
    way = rig.positions_um[None, :, :] - np.column_stack([table[:, :2] * pitch_um, np.zeros(len(table))])[:, None, :]
    distance = np.linalg.norm(way, axis=2)
    irradiance: Array = rig.intensities * (rig.intensity_distance_um / distance) ** 2 * way[..., 2] / distance
    return irradiance


def thread_count(threads: int | None) -> int:
    """Threads to work on: as asked for, else RAYON_NUM_THREADS, else one per core.

    Raises
    ------
    InputError
        Fewer than one.
    """
    if threads is None:
        asked = os.environ.get("RAYON_NUM_THREADS", "")
        return int(asked) if asked.isdigit() and int(asked) > 0 else os.cpu_count() or 1
    if threads < 1:
        msg = f"threads: must be at least 1, got {threads}"
        raise InputError(msg)
    return threads
