"""Files for other programs: normals as numbers, and the surface as points. A format is added in its table, here."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bgars.errors import InputError
from bgars.extras import how_to_install, missing
from bgars.io.atomic import atomic_file
from bgars.io.described_tiff import write_described
from bgars.io.normal_map import vectors_to_write, write_normal_map
from bgars.records.height_map import need_height
from bgars.records.normal_field import NormalField

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from os import PathLike

    from numpy.typing import NDArray

    from bgars.records.height_map import HeightMap

__all__ = ["NORMAL_FORMATS", "POINT_FORMATS", "check_normals_file", "write_normals", "write_points"]


def write_normals(field: NormalField | NDArray[np.floating], path: str | PathLike[str]) -> None:
    """Write normals; the suffix chooses the format.

    ``.png`` is a normal map of 16 bits (:func:`bgars.write_normal_map`); ``.tif`` has three channels of float32, x, y,
    z, NaN where there is no normal; ``.exr`` has R, G, B = x, y, z of float32 and A = 1, all 0 where there is no normal
    (``pip install 'bgars[exr]'``); ``.npy`` is the array; ``.npz`` has the arrays ``normals``, and of a field
    ``albedo``, ``mask``, ``confidence`` and ``measured``, for :func:`numpy.load`. The file appears whole or not at all.

    Parameters
    ----------
    field : NormalField or (H, W, 3) floating
        The normals; NaN, masked or a vector of 0 = invalid.
    path : path
        File to write.

    Raises
    ------
    InputError
        An unknown suffix, an array of another shape, vectors that are not of length 1 within 0.1, a package that is
        not installed.
    FileFormatError
        The file cannot be written.

    Examples
    --------
    >>> import bgars, numpy as np, pathlib, tempfile
    >>> normals = np.float32([[[0.6, 0.0, 0.8]]])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     bgars.write_normals(normals, pathlib.Path(folder) / "n.npz")
    ...     np.load(pathlib.Path(folder) / "n.npz")["normals"].round(1).tolist()
    [[[0.6000000238418579, 0.0, 0.800000011920929]]]
    """
    normals = vectors_to_write(field)
    write, path = check_normals_file(path)
    with atomic_file(path) as temporary:
        write(field, normals, temporary)


def check_normals_file(path: str | PathLike[str]) -> tuple[Callable[..., None], Path]:
    """The writer of a file of normals and its path; InputError where there is none: before long work."""
    write, place = _writer(NORMAL_FORMATS, path, "normals")
    if write is _normals_exr and missing("OpenEXR"):
        msg = f"{place}: .exr {how_to_install('OpenEXR')}"
        raise InputError(msg)
    return write, place


def write_points(height: HeightMap, path: str | PathLike[str], *, field: NormalField | None = None) -> None:
    """Write the valid pixels of a height map as a point cloud; the suffix chooses the format.

    ``.xyz`` is text, a point per line: x y z, and with a field the normal; ``.ply`` is binary, with normals and grey
    from a field. x is right, y up, z toward the camera, in the unit of the heights, origin at the image centre.

    Parameters
    ----------
    height : HeightMap
        From :func:`bgars.integrate_normals`.
    path : path
        File to write.
    field : NormalField, optional
        Gives each point its normal.

    Raises
    ------
    InputError
        An unknown suffix, a field of another size, or no valid pixel.
    FileFormatError
        The file cannot be written.

    Examples
    --------
    >>> import bgars, numpy as np, pathlib, tempfile
    >>> height = bgars.HeightMap.from_array(np.float32([[1.0, np.nan], [2.0, 3.0]]), pixel_pitch_um=10.0)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     bgars.write_points(height, pathlib.Path(folder) / "p.xyz")
    ...     print((pathlib.Path(folder) / "p.xyz").read_text().splitlines()[0])
    -5.00000 5.00000 1.00000
    """
    need_height(height, field)
    write, path = _writer(POINT_FORMATS, path, "a point cloud")
    if not height.mask.any():
        msg = f"height: has no valid pixel to write to {path}"
        raise InputError(msg)
    rows, cols = np.nonzero(height.mask)
    pitch = 1.0 if height.pixel_pitch_um is None else height.pixel_pitch_um
    x, y = (cols + 0.5 - height.mask.shape[1] / 2) * pitch, (height.mask.shape[0] / 2 - rows - 0.5) * pitch
    columns = {"x": x, "y": y, "z": height.height[height.mask]}
    if field is not None:
        normals = field.normals[height.mask]
        columns |= {name: normals[:, axis] for axis, name in enumerate(("nx", "ny", "nz"))}
        if path.suffix.lower() == ".ply":
            grey = field.grey_levels()[height.mask]
            columns |= dict.fromkeys(("red", "green", "blue"), grey)
    with atomic_file(path) as temporary:
        write(columns, height.unit, temporary)


def _writer(
    formats: Mapping[str, Callable[..., None]], path: str | PathLike[str], what: str
) -> tuple[Callable[..., None], Path]:
    """The writer of a file by its suffix."""
    place = Path(path)
    write = formats.get(place.suffix.lower())
    if write is None:
        msg = f"{place}: a file of {what} must end in {', '.join(formats)}; got {place.suffix!r}"
        raise InputError(msg)
    return write, place


def _normals_png(_field: object, normals: NDArray[np.float32], path: Path) -> None:
    write_normal_map(normals, path)


def _normals_tiff(_field: object, normals: NDArray[np.float32], path: Path) -> None:
    write_described(path, normals, "normals", channels=["x right", "y up", "z toward the camera"])


def _normals_exr(_field: object, normals: NDArray[np.float32], path: Path) -> None:
    import OpenEXR  # noqa: PLC0415 - optional

    # Alpha is premultiplied in EXR: nothing is 0 in all channels. NaN would spread through filters of compositors.
    rgba = np.zeros((*normals.shape[:2], 4), np.float32)
    valid = np.isfinite(normals).all(axis=2)
    rgba[valid, :3] = normals[valid]
    rgba[valid, 3] = 1.0
    header = {
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
        "comments": "bgars normals, R = x right, G = y up, B = z toward the camera",
    }
    with OpenEXR.File(header, {"RGBA": rgba}) as file:
        file.write(str(path))


def _normals_npy(_field: object, normals: NDArray[np.float32], path: Path) -> None:
    with path.open("wb") as file:
        np.save(file, np.ascontiguousarray(normals), allow_pickle=False)


def _normals_npz(field: object, normals: NDArray[np.float32], path: Path) -> None:
    others: dict[str, Any] = {}
    if isinstance(field, NormalField):
        others = {"albedo": field.albedo, "mask": field.mask, "confidence": field.confidence}
        others |= {"measured": field.is_measured}
    with path.open("wb") as file:
        np.savez_compressed(file, normals=normals, **others)


def _points_xyz(columns: dict[str, NDArray[np.floating]], _unit: str, path: Path) -> None:
    np.savetxt(path, np.column_stack(list(columns.values())), fmt="%.5f")


def _points_ply(columns: dict[str, NDArray[np.floating]], unit: str, path: Path) -> None:
    kinds = {name: "u1" if values.dtype == np.uint8 else "<f4" for name, values in columns.items()}
    points = np.zeros(len(columns["x"]), list(kinds.items()))
    for name, values in columns.items():
        points[name] = values
    words = {"u1": "uchar", "<f4": "float"}
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"comment bgars points, unit {unit}, x right, y up, z toward the camera",
        f"element vertex {len(points)}",
        *(f"property {words[kind]} {name}" for name, kind in kinds.items()),
        "end_header",
    ]
    path.write_bytes("\n".join([*header, ""]).encode("ascii") + points.tobytes())


NORMAL_FORMATS: dict[str, Callable[..., None]] = {
    ".png": _normals_png,
    ".tif": _normals_tiff,
    ".tiff": _normals_tiff,
    ".exr": _normals_exr,
    ".npy": _normals_npy,
    ".npz": _normals_npz,
}
"""Writer of normals by suffix: it is given the field (or array), the array, and the file."""
POINT_FORMATS: dict[str, Callable[..., None]] = {".xyz": _points_xyz, ".ply": _points_ply}
"""Writer of points by suffix: it is given columns by name, the unit, and the file."""
