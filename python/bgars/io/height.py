"""Height maps as float32 TIFF and .npy."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import tifffile

from bgars.errors import FileFormatError, InputError
from bgars.io.atomic import atomic_file

if TYPE_CHECKING:
    from os import PathLike

    from bgars.records import FloatArray, HeightMap

__all__ = ["HEIGHT_SUFFIXES", "read_height", "write_height"]

HEIGHT_SUFFIXES = (".tif", ".tiff", ".npy")
HEIGHT_NDIM = 2


def write_height(height: HeightMap, path: str | PathLike[str]) -> None:
    """Write heights as float32, NaN outside the mask.

    In micrometres when the pixel pitch is known, else in pixels; a TIFF says which in its description.

    Raises
    ------
    InputError
        An unknown suffix.
    FileFormatError
        The file cannot be written.
    """
    path = Path(path)
    _check_suffix(path)
    values = np.ascontiguousarray(height.height, dtype=np.float32)
    with atomic_file(path) as temporary:
        if path.suffix.lower() == ".npy":
            np.save(temporary, values, allow_pickle=False)
        else:
            description = {"content": "bgars height map", "unit": height.unit, "pixel_pitch_um": height.pixel_pitch_um}
            tifffile.imwrite(temporary, values, description=json.dumps(description), metadata=None)


def read_height(path: str | PathLike[str]) -> tuple[FloatArray, float | None]:
    """Read a height map.

    Returns
    -------
    height : (H, W) float32
        As stored; NaN = invalid.
    pixel_pitch_um : float or None
        The pitch that a TIFF of ours names; None when the file does not say.

    Raises
    ------
    InputError
        An unknown suffix.
    FileFormatError
        The file is missing, truncated, or not a single grey float image.

    Examples
    --------
    >>> import bgars, numpy as np, pathlib, tempfile
    >>> height = bgars.HeightMap.from_array(np.ones((1, 2), np.float32), pixel_pitch_um=5.0)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     bgars.write_height(height, pathlib.Path(folder) / "h.tif")
    ...     values, pitch_um = bgars.read_height(pathlib.Path(folder) / "h.tif")
    >>> values.tolist(), pitch_um
    ([[1.0, 1.0]], 5.0)
    """
    path = Path(path)
    _check_suffix(path)
    pixel_pitch_um: float | None = None
    try:
        if path.suffix.lower() == ".npy":
            values = np.load(path, allow_pickle=False)
        else:
            with tifffile.TiffFile(path) as tiff:
                values = tiff.asarray()
                pixel_pitch_um = _described_pitch(tiff.pages.first.description)
    except OSError as error:
        msg = f"{path}: cannot be read ({error.strerror or error})"
        raise FileFormatError(msg) from error
    except (ValueError, EOFError, tifffile.TiffFileError) as error:
        msg = f"{path}: is not a height map ({error})"
        raise FileFormatError(msg) from error
    if values.ndim != HEIGHT_NDIM or values.dtype.kind not in "fui":
        msg = f"{path}: must hold one grey image of numbers, got {values.dtype} of shape {values.shape}"
        raise FileFormatError(msg)
    return values.astype(np.float32), pixel_pitch_um


def _described_pitch(description: str) -> float | None:
    try:
        fields = json.loads(description)
    except json.JSONDecodeError:
        return None
    pitch = fields.get("pixel_pitch_um") if isinstance(fields, dict) else None
    return float(pitch) if isinstance(pitch, (int, float)) else None


def _check_suffix(path: Path) -> None:
    if path.suffix.lower() not in HEIGHT_SUFFIXES:
        msg = f"{path}: a height map file must end in {', '.join(HEIGHT_SUFFIXES)}; got {path.suffix!r}"
        raise InputError(msg)
