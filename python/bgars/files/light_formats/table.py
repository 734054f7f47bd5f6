"""What any file of lights amounts to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from bgars.errors import FileFormatError
from bgars.files.light_names import numbered

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

__all__ = ["MAX_LIGHTS", "LightTable", "checked_vectors", "rows_of_three"]

MAX_LIGHTS = 10_000
"""Most lights that one capture may have: domes have some hundred."""

AXES = 3


@dataclass(frozen=True)
class LightTable:
    """Lights as a file gives them.

    Attributes
    ----------
    vectors : (L, 3) float64
        Directions from the surface to the light of any length, or positions in mm.
    kind : str
        "directions"; "positions_mm" (origin = image centre on the board plane, z toward the camera); "camera_mm"
        (origin = entrance pupil, x right, y down, z away from the camera).
    intensities : (L, 1) or (L, 3) float64, or None
        Of each light, or of its red, green and blue.
    files : tuple of str
        Image of each light, where the file names them.
    free_length : bool
        The format means directions only: lengths say nothing.
    notes : tuple of str
        What had to be assumed, without the name of the file.
    plane_mm, focal_px : float or None
        Of "camera_mm": distance of the surface from the camera and focal length, where the file gives them.
    principal_px, size_px : tuple of float or None
        Of "camera_mm": principal point (column, row) and image size (columns, rows), where the file gives them.
    """

    vectors: NDArray[np.float64]
    kind: Literal["directions", "positions_mm", "camera_mm"] = "directions"
    intensities: NDArray[np.float64] | None = None
    files: tuple[str, ...] = ()
    free_length: bool = False
    notes: tuple[str, ...] = ()
    plane_mm: float | None = None
    focal_px: float | None = None
    principal_px: tuple[float, float] | None = None
    size_px: tuple[float, float] | None = None


def checked_vectors(vectors: NDArray[np.float64], path: Path, files: tuple[str, ...] = ()) -> NDArray[np.float64]:
    """Return vectors that are finite and not zero, at most :data:`MAX_LIGHTS`.

    Raises
    ------
    FileFormatError
        One is not, named; or there are too many.
    """
    if len(vectors) > MAX_LIGHTS:
        msg = f"{path}: {len(vectors)} lights are more than a capture may have (at most {MAX_LIGHTS})"
        raise FileFormatError(msg)
    with np.errstate(over="ignore"):
        lengths = np.linalg.norm(vectors, axis=1)
    wrong = np.flatnonzero(~(np.isfinite(lengths) & (lengths > 0)))
    if wrong.size:
        index = int(wrong[0])
        msg = (
            f"{path}: light {numbered(index, files)} must have three finite numbers that are not all zero, "
            f"got {' '.join(f'{value:g}' for value in vectors[index])}"
        )
        raise FileFormatError(msg)
    return vectors


def rows_of_three(
    array: NDArray[np.float64], path: Path, name: str = ""
) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Return (L, 3) vectors of an array (L, 3) or (3, L), and what had to be assumed for it.

    Raises
    ------
    FileFormatError
        Another shape.
    """
    where = f"{path}: {name}: " if name else f"{path}: "
    if array.ndim != 2 or AXES not in array.shape:  # noqa: PLR2004 - rows and columns
        msg = f"{where}must have shape (lights, 3) or (3, lights), got {array.shape}"
        raise FileFormatError(msg)
    if array.shape[1] == AXES:
        return np.ascontiguousarray(array), ()
    return np.ascontiguousarray(array.T), (f"3 rows of {array.shape[1]} numbers taken as x, y and z of the lights",)
