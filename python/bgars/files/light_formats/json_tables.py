"""Lights in JSON: Meshroom's ``lights.json``, a plain map of image names, and relight's ``.dome``."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from bgars.errors import FileFormatError
from bgars.files.light_formats.named_lists import names_in, order_of, with_lists
from bgars.files.light_formats.table import MAX_LIGHTS, LightTable, checked_vectors
from bgars.files.safe_files import read_text

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

__all__ = ["read_dome_table", "read_json_table"]

AXES = ("x", "y", "z")
CHANNELS = ("r", "g", "b")
TABLES = ("lights", "directions", "light_directions")
DOME_LISTS = ("directions", "positionsSphere", "positions3d", "positions", "lights")
STRENGTHS = ("intensities", "light_intensities")
EXPECTED = (
    'expected {"image.png": [x, y, z], ...}, a list of [x, y, z], or Meshroom\'s {"lights": [{"direction": [x, y, z], '
    '"intensity": [r, g, b]}, ...]}; azimuth and elevation are given as lights.angles_deg in capture.toml'
)


def read_json_table(path: Path) -> LightTable:
    """Read lights by image name, in a list, or as Meshroom (AliceVision) calibrates them.

    Meshroom's axes are x right, y down and z away from the camera: they are turned to x right, y up, z to the camera.

    Raises
    ------
    FileFormatError
        The file is no JSON, or holds something else.
    """
    values = _load(path)
    beside, others = None, {}
    if isinstance(values, dict):
        beside = next((values[key] for key in STRENGTHS if isinstance(values.get(key), list)), None)
        key = next((key for key in TABLES if isinstance(values.get(key), list | dict)), None)
        if key is not None:
            others = {name: other for name, other in values.items() if name not in {key, *STRENGTHS}}
            values = values[key]
    table = with_lists(_read(values, path), others, path)
    if beside is not None and table.intensities is None:
        intensities = _strengths(beside, path)
        if len(beside) != len(table.vectors):
            msg = f"{path}: {len(beside)} intensities, but {len(table.vectors)} lights"
            raise FileFormatError(msg)
        table = replace(table, intensities=intensities)
    if table.files or not isinstance(values, list) or not isinstance(next(iter(values), None), dict):
        return table
    order, told = order_of(values)
    if not told and _has_directions(values):
        told = ("lights taken in the order of the images, since Meshroom numbers views without their file names",)
    strength = None if table.intensities is None else table.intensities[order]
    return replace(table, vectors=table.vectors[order], intensities=strength, notes=(*told, *table.notes))


def _has_directions(entries: list[Any]) -> bool:
    return bool(entries) and all(isinstance(entry, dict) and "direction" in entry for entry in entries)


def _read(values: list[Any] | dict[str, Any], path: Path) -> LightTable:
    entries = list(values.values()) if isinstance(values, dict) else values
    if _has_directions(entries):
        return _meshroom(values, path)
    intensities = _strengths([entry.get("intensity") if isinstance(entry, dict) else None for entry in entries], path)
    if isinstance(values, dict):
        files = tuple(str(name) for name in values)
        vectors = np.array([_vector(vector, path) for vector in entries]).reshape(-1, 3)
        return LightTable(checked_vectors(vectors, path, files), intensities=intensities, files=files)
    if (
        len(values) == len(AXES)
        and all(isinstance(row, list) and len(row) > len(AXES) for row in values)
        and (len({len(row) for row in values}) == 1)
    ):
        lists, told = [_vector(each, path) for each in zip(*values, strict=True)], len(values[0])
        note = f"3 rows of {told} numbers taken as x, y and z of the lights"
        return LightTable(checked_vectors(np.array(lists).reshape(-1, 3), path), notes=(note,))
    vectors, files = np.array([_vector(vector, path) for vector in values]).reshape(-1, 3), names_in(values)
    return LightTable(checked_vectors(vectors, path, files), intensities=intensities, files=files)


def read_dome_table(path: Path) -> LightTable:
    """Read a dome of relight (CNR-ISTI): the directions of its lights, and how strong they are.

    Positions of a dome are taken as directions from the image centre: relight does so unless the image is large.

    Raises
    ------
    FileFormatError
        The file is no JSON, or has neither directions nor positions.
    """
    values = _load(path)
    if not isinstance(values, dict):
        msg = f"{path}: must hold one object with directions or positions of the lights, got {type(values).__name__}"
        raise FileFormatError(msg)
    key = next((key for key in _dome_keys(values) if isinstance(values.get(key), list) and values[key]), None)
    if key is None:
        msg = f"{path}: has neither directions nor positions of the lights (found {', '.join(values) or 'nothing'})"
        raise FileFormatError(msg)
    vectors = np.array([_vector(vector, path) for vector in values[key]]).reshape(-1, 3)
    notes = () if key == "directions" else (f"{key} taken as directions from the image centre",)
    adjust = values.get("ledAdjust")
    intensities: NDArray[np.float64] | None = None
    if isinstance(adjust, list) and len(adjust) == len(vectors):
        factors = np.array([_vector(factor, path, CHANNELS) for factor in adjust]).reshape(-1, 3)
        if (factors > 0).all() and not np.allclose(factors, 1.0):
            intensities = 1.0 / factors
            notes = (*notes, "ledAdjust taken as the inverse of the intensities")
    table = LightTable(checked_vectors(vectors, path), intensities=intensities, free_length=True, notes=notes)
    known = {*DOME_LISTS, "ledAdjust"}
    return with_lists(table, {name: other for name, other in values.items() if name not in known}, path)


def _dome_keys(values: dict[str, Any]) -> tuple[str, ...]:
    if values.get("lightConfiguration") == "lights3d":
        return ("positions3d", "positions", "directions")
    return DOME_LISTS


def _meshroom(lights: list[Any] | dict[str, Any], path: Path) -> LightTable:
    entries = list(lights.values()) if isinstance(lights, dict) else lights
    files = tuple(str(name) for name in lights) if isinstance(lights, dict) else names_in(entries)
    notes: tuple[str, ...] = ()
    vectors = np.array([_vector(entry["direction"], path) for entry in entries]).reshape(-1, 3)
    intensities = _strengths([entry.get("intensity") for entry in entries], path)
    if len(vectors) and (vectors[:, 2] < 0).all():
        vectors = vectors * np.array([1.0, -1.0, -1.0])
        notes = (*notes, "axes of Meshroom (y down, z away from the camera) turned to y up, z to the camera")
    return LightTable(
        checked_vectors(vectors, path, files), intensities=intensities, files=files, free_length=True, notes=notes
    )


def _strengths(values: list[Any], path: Path) -> NDArray[np.float64] | None:
    """(L, 1) or (L, 3) intensities; None where no light has one."""
    if all(value is None for value in values):
        return None
    if all(isinstance(value, int | float) for value in values):
        return np.array([_vector([value], path, CHANNELS[:1]) for value in values])
    return np.array([_vector(value, path, CHANNELS) for value in values]).reshape(-1, 3)


def _vector(value: Any, path: Path, keys: tuple[str, ...] = AXES) -> list[float]:  # noqa: ANN401 - whatever a file held
    numbers = value
    if isinstance(value, dict):
        named = {str(key).lower(): number for key, number in value.items()}
        numbers = [named.get(key) for key in keys]
    is_vector = isinstance(numbers, list | tuple) and len(numbers) == len(keys)
    if is_vector and all(isinstance(number, int | float) and not isinstance(number, bool) for number in numbers):
        try:
            return [float(number) for number in numbers]
        except OverflowError:
            pass
    msg = f"{path}: must hold three numbers per light, got {repr(value)[:80]}; {EXPECTED}"
    raise FileFormatError(msg)


def _load(path: Path) -> Any:  # noqa: ANN401 - whatever a file holds
    content = read_text(path).content
    try:
        values = json.loads(content)
    except (ValueError, RecursionError) as error:
        reason = "nested too deeply" if isinstance(error, RecursionError) else error
        msg = f"{path}: is not valid JSON ({reason})"
        raise FileFormatError(msg) from error
    if not isinstance(values, list | dict) or len(values) > MAX_LIGHTS:
        what = f"{len(values)} values" if isinstance(values, list | dict) else type(values).__name__
        msg = f"{path}: holds {what}; {EXPECTED}"
        raise FileFormatError(msg)
    return values
