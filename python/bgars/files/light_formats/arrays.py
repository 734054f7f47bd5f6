"""Lights as arrays: NumPy ``.npy`` and MATLAB ``.mat``."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import numpy as np

from bgars.errors import FileFormatError
from bgars.files.light_formats.named_lists import with_lists
from bgars.files.light_formats.table import LightTable, checked_vectors, rows_of_three
from bgars.files.mat_files import read_arrays, read_texts
from bgars.files.safe_files import read_bounded, shown

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

__all__ = ["read_mat_table", "read_npy_array", "read_npy_table"]

MAX_BYTES = 64_000_000
MAX_VALUES = 1_000_000
DIRECTION_NAMES = (
    "l",
    "light_directions",
    "light_dirs",
    "lightdirections",
    "directions",
    "dirs",
    "lights",
    "light",
    "s",
)
INTENSITY_NAMES = ("light_intensities", "lightintensities", "intensities", "intensity", "phi", "e")
CAMERA_POSITIONS, LED_AXES = "S", "Dir"
"""What the data sets of near point lights (Queau et al., JMIV 2018) call the LED positions and their principal axes."""
MATLAB_73 = b"MATLAB 7.3"


def read_npy_table(path: Path) -> LightTable:
    """Read an array (L, 3) or (3, L) of light vectors.

    Raises
    ------
    FileFormatError
        The file is no array of numbers of such a shape.
    """
    vectors, notes = rows_of_three(read_npy_array(path), path)
    return LightTable(checked_vectors(vectors, path), notes=notes)


def read_npy_array(path: Path) -> NDArray[np.float64]:
    """Return the numbers of a small ``.npy`` file as float64, of any shape.

    Raises
    ------
    FileFormatError
        The file is no array of numbers, or a large one.
    """
    content = read_bounded(path, MAX_BYTES, "light file")
    try:
        mapped = io.BytesIO(content)
        version = np.lib.format.read_magic(mapped)
        reader = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, _, dtype = reader(mapped)
        if np.prod(shape, dtype=float) * dtype.itemsize > len(content) or dtype.hasobject:
            msg = f"its header promises {shape} of {dtype}"
            raise ValueError(msg)
        array = np.lib.format.read_array(io.BytesIO(content), allow_pickle=False)
    except Exception as error:  # whatever damaged bytes make of the header
        msg = f"{path}: is not a NumPy array ({_one_line(error)})"
        raise FileFormatError(msg) from error
    return _numbers(array, path, "")


def read_mat_table(path: Path) -> LightTable:
    """Read the light vectors of a MATLAB file: a variable of a usual name, or the only one of shape (L, 3) or (3, L).

    ``S`` beside ``Dir`` are LED positions in mm in the camera's frame (the data sets of Queau et al.), ``Phi`` their
    intensities.

    Raises
    ------
    FileFormatError
        The file cannot be read, or holds no such variable, or several.
    """
    content = read_bounded(path, MAX_BYTES, "light file")
    arrays = _mat(read_arrays, content, path)
    shapes = {name: array.shape for name, array in arrays.items()}
    wanted = {name for name, shape in shapes.items() if len(shape) == 2 and np.prod(shape, dtype=float) <= MAX_VALUES}  # noqa: PLR2004 - matrices
    vectors_like = [name for name in wanted if 3 in shapes[name]]  # noqa: PLR2004 - x, y, z
    near = {CAMERA_POSITIONS, LED_AXES} <= set(shapes)
    name = CAMERA_POSITIONS if near else _pick(vectors_like, DIRECTION_NAMES)
    if name is None and len(vectors_like) == 1:
        name = vectors_like[0]
    if name is None or name not in wanted:
        held = ", ".join(f"{shown(key)} {'x'.join(map(str, shape))}" for key, shape in list(shapes.items())[:10])
        msg = (
            f"{path}: holds no single variable of shape (lights, 3) for the light directions (found {held or 'none'}); "
            "call it L, or write the vectors to light_directions.txt, one x y z per line"
        )
        raise FileFormatError(msg)
    strength = _pick([other for other in wanted if other != name], INTENSITY_NAMES)
    vectors, notes = rows_of_three(_numbers(arrays[name], path, name), path, name)
    notes = (f"variable {name!r} taken as the {'LED positions in mm' if near else 'light directions'}", *notes)
    intensities = None if strength is None else _intensities(_numbers(arrays[strength], path, strength), len(vectors))
    if intensities is not None:
        notes = (*notes, f"variable {strength!r} as their intensities")
    kind = "camera_mm" if near else "directions"
    table = LightTable(checked_vectors(vectors, path), kind, intensities, notes=notes)  # type: ignore[arg-type]
    used = {name, strength, *((CAMERA_POSITIONS, LED_AXES) if near else ())}
    lists = {key: array.ravel() for key, array in arrays.items() if key not in used and array.size == max(array.shape)}
    others: dict[str, Any] = {key: [*array] for key, array in lists.items()}
    return with_lists(table, {**others, **_mat(read_texts, content, path)}, path)


def _pick(names: list[str], known: tuple[str, ...]) -> str | None:
    """Return the first of some names that is known, in the order of the known ones."""
    lower = {name.lower(): name for name in names}
    return next((lower[name] for name in known if name in lower), None)


def _intensities(array: NDArray[np.float64], count: int) -> NDArray[np.float64] | None:
    if count not in array.shape or array.size not in (count, 3 * count):
        return None
    return array.reshape(count, -1) if array.shape[0] == count else np.ascontiguousarray(array.T).reshape(count, -1)


def _mat(read: Callable[[bytes, int], dict[str, Any]], content: bytes, path: Path) -> dict[str, Any]:
    try:
        return read(content, MAX_BYTES)
    except ValueError as error:
        if MATLAB_73 in content[:128]:
            msg = f"{path}: is a MATLAB 7.3 (HDF5) file, which is not read; save it in MATLAB with save(..., '-v7')"
        else:
            msg = f"{path}: is not a MATLAB file ({error}); save it in MATLAB with save(..., '-v7')"
        raise FileFormatError(msg) from error


def _numbers(array: Any, path: Path, name: str) -> NDArray[np.float64]:  # noqa: ANN401 - whatever a file held
    array = np.asarray(array)
    if array.dtype.kind not in "fiu" or array.size > MAX_VALUES:
        where = f"{path}: {name}: " if name else f"{path}: "
        msg = f"{where}must hold at most {MAX_VALUES} real numbers, got {array.size} of {array.dtype}"
        raise FileFormatError(msg)
    numbers: NDArray[np.float64] = array.astype(np.float64)
    return numbers


def _one_line(error: Exception) -> str:
    return f"{type(error).__name__}: {' '.join(str(error).split())[:120]}"
