"""Normal maps: written as 16-bit PNG, read from what people hold."""

from __future__ import annotations

import math
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bgars import _bgars
from bgars.errors import InputError
from bgars.io.atomic import atomic_file
from bgars.io.guarded import stored_shape
from bgars.io.height import HEIGHT_SUFFIXES
from bgars.io.masks import read_mask
from bgars.io.normal_map_encoding import UNIT_WITHIN, Normals, normals_of
from bgars.io.normal_map_pixels import NORMAL_MAP_SUFFIXES, is_normal_array, read_pixels
from bgars.io.own_files import is_own, sign
from bgars.records.normal_field import NormalField
from bgars.records.plain_arrays import plain, without_mask

if TYPE_CHECKING:
    from os import PathLike

    from numpy.typing import ArrayLike

    from bgars.records.pixels import FloatArray

__all__ = ["holds_normals", "read_normal_map", "read_stored_normals", "vectors_to_write", "write_normal_map"]

FULL = 65535.0
NORMALS_NDIM = 3


def write_normal_map(normals: NormalField | FloatArray, path: str | PathLike[str], *, directx: bool = False) -> None:
    """Write normals as a 16-bit RGB PNG: ``round((n + 1) / 2 * 65535)``, R = x, G = y up (OpenGL), B = z.

    Invalid pixels (NaN, or a vector of 0) are black, which no unit normal encodes to.

    Parameters
    ----------
    normals : NormalField or (H, W, 3) float32
        Unit normals.
    path : path
        File to write, ending in .png.
    directx : bool
        Write G = y down, as DirectX tools expect.

    Raises
    ------
    InputError
        Wrong shape or suffix, or vectors that are not of length 1 within 0.1.
    FileFormatError
        The file cannot be written.
    """
    path = Path(path)
    vectors = vectors_to_write(normals)
    if path.suffix.lower() != ".png":
        msg = f"{path}: a normal map file must end in .png"
        raise InputError(msg)
    signs = np.array([1.0, -1.0 if directx else 1.0, 1.0], dtype=np.float32)
    codes = vectors * signs  # and from here in place: of large maps each copy is felt
    codes += 1.0
    codes /= 2.0
    codes *= FULL
    np.nan_to_num(codes, copy=False, nan=0.0, posinf=0.0, neginf=0.0)
    rgb = np.clip(np.rint(codes, out=codes), 0.0, FULL, out=codes).astype(np.uint16)
    with atomic_file(path) as temporary:
        _bgars.write_png16(temporary, rgb)
        sign(temporary)


def vectors_to_write(normals: NormalField | ArrayLike) -> FloatArray:
    """Return plain (H, W, 3) unit vectors, NaN in all three where a pixel has none: not finite, masked, or 0.

    Raises
    ------
    InputError
        Another shape, no pixel, or lengths that no reader takes for unit vectors.
    """
    given: ArrayLike = normals.normals if isinstance(normals, NormalField) else normals
    vectors = plain("normals", without_mask(given, math.nan), np.float32)
    if vectors.ndim != NORMALS_NDIM or vectors.shape[2] != NORMALS_NDIM or not vectors.size:
        msg = f"normals: must have shape (H, W, 3), none of them 0, got {vectors.shape}"
        raise InputError(msg)
    length = np.sqrt(np.einsum("...i,...i", vectors, vectors))
    is_none = ~(np.isfinite(length) & (length > 0.0))
    is_wrong = ~is_none & (np.abs(length - 1.0) > UNIT_WITHIN)
    if is_wrong.any():
        row, col = map(int, np.argwhere(is_wrong)[0])
        msg = f"normals: at row {row}, column {col}: must have length 1 within {UNIT_WITHIN}, got {length[row, col]:g}"
        raise InputError(msg)
    if not is_none.any():
        return vectors
    return np.where(is_none[..., np.newaxis], np.float32(np.nan), vectors)


def read_normal_map(
    path: str | PathLike[str], *, directx: bool | None = None, mask: str | PathLike[str] | None = None
) -> FloatArray:
    """Read a normal map, in whichever dialect it is.

    8 and 16 bits a channel encode ``round((n + 1) / 2 * 255)`` (65535); of 8 bits, 127 and 128 both are 0, which has no
    code of its own: a plain map of (128, 128, 255) is flat. Alpha is a mask. The one colour around an object is left
    out where it is no unit vector, or where the object ends steeply at it. Maps of two channels get their z computed.
    sRGB curves, channels in another order, blue from 0 to 1, z away from the camera and green down are recognised, and
    a warning says so. In lossy files, pixels that their blocks have mixed with the surround are left out.

    Parameters
    ----------
    path : path
        PNG, JPEG, WebP, BMP, PPM, TGA, TIFF (8 and 16 bits, float), HDR, EXR (``pip install 'bgars[exr]'``), .npy, .npz
        or .mat (of several arrays the one whose name has "normal"); R = x, G = y up (OpenGL), B = z.
    directx : bool, optional
        The file has G = y down; by default the curl of its field says, also whether red and green are exchanged.
    mask : path, optional
        Image, white = use; background is then not looked for.

    Returns
    -------
    (H, W, 3) float32
        Unit normals; NaN where the file is black, transparent, masked, or no unit vector.

    Raises
    ------
    InputError
        An unknown suffix, a mask of another size.
    FileFormatError
        The file is damaged, most of its pixels hold no unit vectors, or many face away (object or world space).

    Examples
    --------
    >>> import bgars, numpy as np, pathlib, tempfile
    >>> normals = np.float32([[[0.6, 0.0, 0.8], [np.nan, np.nan, np.nan]]])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     bgars.write_normal_map(normals, pathlib.Path(folder) / "n.png")
    ...     back = bgars.read_normal_map(pathlib.Path(folder) / "n.png")
    >>> back.round(3).tolist()
    [[[0.6000000238418579, 0.0, 0.800000011920929], [nan, nan, nan]]]
    """
    found = read_stored_normals(path, directx=directx, mask=mask)
    for note in found.notes:
        warnings.warn(f"{path}: {note}", stacklevel=2)
    return found.vectors


def read_stored_normals(
    path: str | PathLike[str], *, directx: bool | None = None, mask: str | PathLike[str] | None = None
) -> Normals:
    """Read a normal map and what had to be assumed; otherwise as :func:`read_normal_map`."""
    path = Path(path)
    pixels = read_pixels(path)
    shape = pixels.values.shape
    said: list[str] = []
    use = None if mask is None else read_mask(Path(mask), (shape[0], shape[1]), said)
    if use is None and path.suffix.lower() == ".png" and is_own(path):
        use = np.ones(shape[:2], np.bool_)  # black says where there is nothing: a board of one colour is a board
    found = normals_of(path, pixels, use, directx)
    return Normals(found.vectors, (*said, *found.notes))


def holds_normals(path: Path) -> bool:
    """Whether a file can be a normal map: by its suffix, and where heights have the same one, by its shape."""
    suffix = path.suffix.lower()
    if suffix in HEIGHT_SUFFIXES:
        return is_normal_array(stored_shape(path, "a normal map or a height map"))
    return suffix in NORMAL_MAP_SUFFIXES
