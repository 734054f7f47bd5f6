"""Height maps as float32 TIFF and .npy, read and written, and for other programs. A format is added in its table."""

from __future__ import annotations

import math
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from bgars.errors import FileFormatError, InputError
from bgars.io.areal_files import check_areal, write_gsf, write_sdf, write_x3p
from bgars.io.atomic import atomic_file
from bgars.io.described_tiff import OWN, write_described
from bgars.io.guarded import load_npy, load_tiff
from bgars.io.height_marks import without_marks
from bgars.records.height_map import need_height

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from os import PathLike

    from bgars.records.height_map import HeightMap
    from bgars.records.pixels import FloatArray

__all__ = [
    "HEIGHT_FORMATS",
    "HEIGHT_SUFFIXES",
    "StoredHeight",
    "check_height_file",
    "read_height",
    "read_stored_height",
    "write_height",
]

HEIGHT_SUFFIXES = (".tif", ".tiff", ".npy")
"""Of files that are read."""
HEIGHT_NDIM = 2
CONTENT = "height map"
WHAT = "a height map"


class StoredHeight(NamedTuple):
    """A height map as its file holds it.

    Attributes
    ----------
    values : (H, W) float32
        NaN = invalid.
    unit : {"um", "px"} or None
        Of the values; None: the file does not say.
    pixel_pitch_um : float or None
        None: the file does not say.
    notes : tuple of str
        What had to be assumed, without the name of the file.
    """

    values: FloatArray
    unit: Literal["um", "px"] | None
    pixel_pitch_um: float | None
    notes: tuple[str, ...] = ()


def write_height(height: HeightMap, path: str | PathLike[str]) -> None:
    """Write heights; the suffix chooses the format.

    ``.tif`` and ``.npy`` hold float32, NaN outside the mask, in micrometres when the pixel pitch is known, else in
    pixels; a TIFF says which in its description. ``.gsf`` (Gwyddion simple field), ``.sdf`` (ISO 25178-71, int32) and
    ``.x3p`` (ISO 25178-72, float32) hold metres, and what is invalid as the format says; they need a pixel pitch and
    ``pip install 'bgars[areal]'``. The file appears whole or not at all.

    Parameters
    ----------
    height : HeightMap
        For instance from :func:`bgars.integrate_normals`.
    path : path
        File to write.

    Raises
    ------
    InputError
        An unknown suffix; metres without a pixel pitch; a package that is not installed.
    FileFormatError
        The file cannot be written.

    Examples
    --------
    >>> import bgars, numpy as np, pathlib, tempfile
    >>> height = bgars.HeightMap.from_array(np.ones((1, 2), np.float32), pixel_pitch_um=5.0)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     bgars.write_height(height, pathlib.Path(folder) / "h.npy")
    ...     np.load(pathlib.Path(folder) / "h.npy").tolist()
    [[1.0, 1.0]]
    """
    need_height(height)
    path = Path(path)
    check_height_file(path, has_pitch=height.pixel_pitch_um is not None)
    if not height.mask.any():
        msg = f"height: has no valid pixel to write to {path}"
        raise InputError(msg)
    with atomic_file(path) as temporary:
        HEIGHT_FORMATS[path.suffix.lower()](height, temporary)


def check_height_file(path: Path, *, has_pitch: bool) -> None:
    """Raise InputError where :func:`write_height` would: before long work."""
    _check_suffix(path, HEIGHT_FORMATS)
    check_areal(path.suffix.lower(), path, has_pitch=has_pitch)


def read_height(path: str | PathLike[str]) -> tuple[FloatArray, float | None]:
    """Read a height map.

    Numbers with which programs mark pixels without a height, such as -9999, -32768 or 1e30, become NaN, and a warning
    says so.

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
        The file is missing, truncated, not a single grey float image, or a TIFF of bgars that holds something else.

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
    stored = read_stored_height(path)
    for note in stored.notes:
        warnings.warn(f"{path}: {note}", stacklevel=2)
    return stored.values, stored.pixel_pitch_um


def read_stored_height(path: str | PathLike[str]) -> StoredHeight:
    """Read a height map and the unit that its file names; errors as of :func:`read_height`."""
    path = Path(path)
    _check_suffix(path, HEIGHT_SUFFIXES)
    fields: dict[str, Any] = {}
    if path.suffix.lower() == ".npy":
        values = load_npy(path, WHAT)
    else:
        values, fields = load_tiff(path, WHAT)
    if values.ndim != HEIGHT_NDIM or values.dtype.kind not in "fui" or not values.size:
        msg = f"{path}: must hold one grey image of numbers, got {values.dtype} of shape {values.shape}"
        raise FileFormatError(msg)
    content = str(fields.get("content", ""))
    if content.startswith(OWN) and content != OWN + CONTENT:
        msg = f"{path}: must hold a height map, but its description says {content!r}"
        raise FileFormatError(msg)
    heights, notes = without_marks(values.astype(np.float32))
    pitch_um = fields.get("pixel_pitch_um")
    if not isinstance(pitch_um, (int, float)):
        # Ours without a pitch is in pixels; of another's nothing is known.
        return StoredHeight(heights, "px" if content else None, None, notes)
    if not (math.isfinite(pitch_um) and pitch_um > 0):
        msg = f"{path}: pixel_pitch_um of its description: must be finite and above 0, got {pitch_um:g}"
        raise FileFormatError(msg)
    return StoredHeight(heights, "um", float(pitch_um), notes)


def _check_suffix(path: Path, suffixes: Iterable[str]) -> None:
    if path.suffix.lower() not in suffixes:
        msg = f"{path}: a height map file must end in {', '.join(suffixes)}; got {path.suffix!r}"
        raise InputError(msg)


def _write_tiff(height: HeightMap, path: Path) -> None:
    values = np.asarray(height.height, dtype=np.float32)
    write_described(path, values, CONTENT, unit=height.unit, pixel_pitch_um=height.pixel_pitch_um)


def _write_npy(height: HeightMap, path: Path) -> None:
    with path.open("wb") as file:
        np.save(file, np.ascontiguousarray(height.height, dtype=np.float32), allow_pickle=False)


HEIGHT_FORMATS: dict[str, Callable[[HeightMap, Path], None]] = {
    ".tif": _write_tiff,
    ".tiff": _write_tiff,
    ".npy": _write_npy,
    ".gsf": write_gsf,
    ".sdf": write_sdf,
    ".x3p": write_x3p,
}
"""Writer of heights by suffix: it is given the height map and the file."""
