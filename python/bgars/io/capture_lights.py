"""Which lights a capture folder describes, and how strong they are."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bgars.errors import FileFormatError, InputError
from bgars.files.light_files import read_intensities, read_numbers
from bgars.files.light_formats import LightTable, read_light_file
from bgars.files.light_formats.angles import read_angle_table
from bgars.files.light_names import light_name
from bgars.io.recipe import HIGHEST_RAD, RECIPE_NAME
from bgars.records.rig import LightRig

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from bgars.io.recipe import CaptureRecipe, LightsRecipe
    from bgars.records.capture import Capture

__all__ = ["Lights", "check_near_lights", "note_far_lights", "read_lights"]

UNIT_WITHIN = 0.01
"""Vectors whose lengths differ from 1, or from each other, by less are directions."""
STRONGEST = 10.0
"""Longest vector that can be a direction times an intensity; longer ones are positions, in whatever unit."""
FARTHEST_UM = 1e7
"""Ten metres: no lamp over a part is as far."""
SOURCES = ("directions", "angles_deg", "positions_mm", "lp", "ring")


@dataclass(frozen=True)
class Lights:
    """Lights as the files give them: intensities may have three columns still.

    Attributes
    ----------
    rig : LightRig
        The lights; `files` are the images that the file of the lights names, as it names them.
    intensities : (L, 1) or (L, 3) float64
        Of each light.
    source : str
        The file, or the key of the recipe.
    path : Path or None
        The file.
    pixel_pitch_um : float or None
        Where the file of the lights tells the scale.
    """

    rig: LightRig
    intensities: NDArray[np.float64]
    source: str
    path: Path | None = None
    pixel_pitch_um: float | None = None

    def take(self, indices: Sequence[int]) -> Lights:
        """Return the lights at `indices`, in that order."""
        rows = np.array(indices, dtype=np.intp)
        return replace(self, rig=self.rig.take(rows), intensities=self.intensities[rows])


def read_lights(folder: Path, recipe: CaptureRecipe, notes: list[str]) -> Lights:
    """Return the lights that a recipe describes, from whichever source it names; `notes` gets what is assumed."""
    lights = recipe.lights
    if lights is None:
        msg = (
            f"{folder / RECIPE_NAME}: lights: missing; add a [lights] table with directions, angles_deg, "
            f"positions_mm, lp or ring"
        )
        raise InputError(msg)
    key = next(name for name in SOURCES if getattr(lights, name) is not None)
    given = getattr(lights, key)
    path = folder / given if isinstance(given, str) else None
    source = f"{folder / RECIPE_NAME} (lights.{key})" if path is None else str(path)
    try:
        rig, strength, pitch_um = _rig(lights, path, recipe, notes)
    except InputError as error:
        msg = f"{source}: {error}"
        raise InputError(msg) from error
    if isinstance(lights.u_deg, list) and len(lights.u_deg) != len(rig):
        where_u = f"{folder / RECIPE_NAME} (lights.u_deg)"
        msg = f"{where_u}: {len(lights.u_deg)} uncertainties, but {source} gives {len(rig)} lights"
        raise InputError(msg)
    rig = rig.with_u_deg(lights.u_deg)
    if strength is not None and lights.intensities is None:
        _check_intensities(strength, source)
    elif strength is not None:
        notes.append(f"intensities in {Path(source).name} are not used: others are given")
        strength = None
    intensities = strength if strength is not None else _intensity_rows(folder, lights.intensities, len(rig), source)
    return Lights(rig, _relative(intensities, notes), source, path, pitch_um)


def _rig(
    lights: LightsRecipe, path: Path | None, recipe: CaptureRecipe, notes: list[str]
) -> tuple[LightRig, NDArray[np.float64] | None, float | None]:
    """Return the rig of a [lights] table, the intensities and the pixel pitch that its file gives."""
    if lights.ring is not None:
        return LightRig.ring(**lights.ring.model_dump()), None, None
    if lights.angles_deg is not None:
        of_angles = None if path is None or path.suffix.lower() == ".npy" else read_angle_table(path)
        if path is not None and of_angles is not None:
            notes.extend(f"{path.name}: {note}" for note in of_angles.notes)
            return LightRig.from_directions(of_angles.vectors, files=of_angles.files), None, None
        angles = lights.angles_deg if path is None else read_numbers(path, (2,), "azimuth and elevation in degrees")
        _refuse_radians(np.array(angles, dtype=np.float64).reshape(-1, 2)[:, 1])
        return LightRig.from_angles(angles), None, None
    if path is None:
        table = LightTable(np.array(lights.directions or lights.positions_mm, dtype=np.float64).reshape(-1, 3))
    else:
        table = read_light_file(path)
        notes.extend(f"{path.name}: {note}" for note in table.notes)
        if table.kind == "camera_mm":
            return _near_rig(table, path, recipe, notes)
    by_header = lights.positions_mm is None and path is not None and _are_positions(table, recipe)
    if by_header and path is not None:
        notes.append(
            f"{path.name}: positions in the unit of its header, so near lights (origin: image centre on the board)"
        )
    if lights.positions_mm is not None or by_header:
        _refuse_unit_lengths(table)
        distance_um = None if lights.intensity_distance_mm is None else lights.intensity_distance_mm * 1000.0
        rig = LightRig.from_positions(table.vectors * 1000.0, intensity_distance_um=distance_um)
        return replace(rig, files=table.files), table.intensities, None
    vectors, strength = (table.vectors, None) if path is None else _unit(table, path, notes)
    return LightRig.from_directions(vectors, files=table.files), strength, None


def _refuse_radians(elevations_deg: NDArray[np.float64]) -> None:
    if len(elevations_deg) and (np.abs(elevations_deg) <= HIGHEST_RAD).all():
        highest = float(np.abs(elevations_deg).max())
        msg = f"angles are in degrees, but no elevation is above {highest:.3g}, which looks like radians"
        raise InputError(msg)


def _are_positions(table: LightTable, recipe: CaptureRecipe) -> bool:
    """Whether a header gives the unit of positions, and the scale is known that near lights need."""
    is_stated = table.kind == "positions_mm" and not table.free_length and recipe.pixel_pitch_um is not None
    return is_stated and not _are_unit(table)


def _are_unit(table: LightTable) -> bool:
    lengths = np.linalg.norm(table.vectors, axis=1)
    return len(lengths) > 1 and bool((np.abs(lengths - 1.0) < UNIT_WITHIN).all())


def _refuse_unit_lengths(table: LightTable) -> None:
    if _are_unit(table):
        msg = "positions_mm: all are 1 mm from the image centre, so they are directions: write directions = ..."
        raise InputError(msg)


def check_near_lights(capture: Capture, where: str, station: str | None = None) -> None:
    """Refuse near lights without a scale, and such that all stand within the picture: they would hide the part.

    `where` describes the capture; `station` is the file whose lights it has, if it has those of one.

    Raises
    ------
    InputError
        No pixel pitch; or all are nearer to the image centre than its corners, as if metres were taken for millimetres.
    """
    rig, pitch_um = capture.rig, capture.pixel_pitch_um
    if rig.positions_um is None:
        return
    if pitch_um is None and station is not None:
        msg = (
            f"{station}: scale.pixel_pitch_um: needed with its lights.positions_mm, to place pixels under lights: "
            f"bgars calibrate scale, or state pixel_pitch_um in {where}"
        )
        raise InputError(msg)
    if pitch_um is None:
        msg = f"{where}: pixel_pitch_um: needed with lights.positions_mm, to place pixels under lights"
        raise InputError(msg)
    farthest_um = float(np.linalg.norm(rig.positions_um, axis=1).max())
    corner_um = math.hypot(*capture.images.shape[1:]) / 2.0 * pitch_um
    if farthest_um < corner_um:
        msg = (
            f"{station or where}: all lights are within {farthest_um / 1000.0:.3g} mm of the image centre, but the "
            f"corners of the image are {corner_um / 1000.0:.3g} mm from it: are positions_mm in mm, and pixel_pitch_um "
            "in um?"
        )
        raise InputError(msg)


def note_far_lights(rig: LightRig, notes: list[str]) -> None:
    """Note lights that are farther than any room is wide."""
    if rig.positions_um is None:
        return
    farthest_um = float(np.linalg.norm(rig.positions_um, axis=1).max())
    if farthest_um > FARTHEST_UM:
        notes.append(
            f"lights up to {farthest_um / 1e6:.4g} m from the image centre: are positions_mm in mm? Divide um by 1000"
        )


def _unit(table: LightTable, path: Path, notes: list[str]) -> tuple[NDArray[np.float64], NDArray[np.float64] | None]:
    """Return unit vectors and intensities of a table: lengths that differ are intensities, or free."""
    lengths = np.linalg.norm(table.vectors, axis=1)
    units = table.vectors / lengths[:, None]
    alike = len(lengths) == 0 or lengths.max() / lengths.min() < 1.0 + 2 * UNIT_WITHIN
    if table.free_length or (alike and (np.abs(lengths - 1.0) < UNIT_WITHIN).all()):
        return units, table.intensities
    if alike:
        is_dome = table.kind == "positions_mm"
        what = "positions at {:.4g} mm" if is_dome else "vectors of length {:.4g}"
        near = f"; with pixel_pitch_um in {RECIPE_NAME} they are near lights" if is_dome else ""
        notes.append(f"{path.name}: {what.format(np.median(lengths))} taken as directions{near}")
        return units, table.intensities
    if lengths.max() > STRONGEST or table.kind == "positions_mm":
        msg = (
            f"{path}: its vectors are {lengths.min():.4g} to {lengths.max():.4g} long, so they are not directions; "
            f'if they are positions of LEDs, write in {RECIPE_NAME}, under [lights]: positions_mm = "{path.name}"'
        )
        raise FileFormatError(msg)
    if table.intensities is not None:
        notes.append(f"{path.name}: lengths of the vectors ignored, since intensities are given")
        return units, table.intensities
    notes.append(
        f"{path.name}: vectors of lengths {lengths.min():.3g} to {lengths.max():.3g} taken as direction times intensity"
    )
    return units, lengths[:, None]


def _near_rig(
    table: LightTable, path: Path, recipe: CaptureRecipe, notes: list[str]
) -> tuple[LightRig, NDArray[np.float64] | None, float | None]:
    """Bring LEDs from the camera's frame to the part's: origin under the image centre, y up, z to the camera."""
    stated = None if recipe.camera is None else recipe.camera.distance_mm
    distance_mm = stated if stated is not None and np.isfinite(stated) else table.plane_mm
    if distance_mm is None:
        msg = (
            f"{path}: holds LED positions in the camera's frame, which need the distance of the part; write in "
            f"{RECIPE_NAME}: camera = {{ distance_mm = ... }}, pixel_pitch_um = ..., and under [lights] "
            f'directions = "{path.name}"'
        )
        raise FileFormatError(msg)
    center_mm = np.zeros(2)
    pitch_um = None
    if table.focal_px is not None:
        pitch_um = 1000.0 * distance_mm / table.focal_px
        if table.principal_px is not None and table.size_px is not None:
            center_mm = (np.array(table.size_px) / 2 - np.array(table.principal_px)) * distance_mm / table.focal_px
    positions_mm = np.column_stack(
        [
            table.vectors[:, 0] - center_mm[0],
            center_mm[1] - table.vectors[:, 1],
            distance_mm - table.vectors[:, 2],
        ]
    )
    scale = "" if pitch_um is None else f", where a pixel is {pitch_um:.4g} um"
    notes.append(f"{path.name}: LEDs brought to the plane {distance_mm:g} mm from the camera{scale}")
    rig = LightRig.from_positions(positions_mm * 1000.0, intensity_distance_um=distance_mm * 1000.0)
    return replace(rig, files=table.files), table.intensities, pitch_um


def _intensity_rows(folder: Path, value: str | Sequence[object] | None, count: int, source: str) -> NDArray[np.float64]:
    """Return (L, 1) or (L, 3) intensities, 1 where none are given."""
    if value is None:
        return np.ones((count, 1))
    if isinstance(value, str):
        where = str(folder / value)
        intensities = read_intensities(folder / value)
    else:
        where = f"{folder / RECIPE_NAME} (lights.intensities)"
        intensities = np.array(value, dtype=np.float64).reshape(len(value), -1)
    if len(intensities) != count:
        msg = f"{where}: {len(intensities)} intensities, but {source} gives {count} lights"
        raise InputError(msg)
    _check_intensities(intensities, where)
    return intensities


def _relative(intensities: NDArray[np.float64], notes: list[str]) -> NDArray[np.float64]:
    """Intensities whose median is about 1: levels are compared with full scale once these are divided out.

    A table in another unit (255, or candela) would make all images black, or all white.
    """
    median = float(np.median(intensities))
    if 1.0 / STRONGEST <= median <= STRONGEST:
        return intensities
    low, high = intensities.min(), intensities.max()
    notes.append(f"intensities of {low:.4g} to {high:.4g} taken relative to their median, {median:.4g}")
    return intensities / median


def _check_intensities(intensities: NDArray[np.float64], where: str) -> None:
    wrong = np.argwhere(~(np.isfinite(intensities) & (intensities > 0)))
    if wrong.size:
        light, column = wrong[0]
        msg = (
            f"{where}: intensity of {light_name(light)} must be finite and above 0, got {intensities[light, column]:g}"
        )
        raise InputError(msg)
