"""Normal maps as 16-bit PNG."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bgars import _bgars
from bgars.errors import FileFormatError, InputError
from bgars.io.atomic import atomic_file
from bgars.io.images import MAX_MEGAPIXELS

if TYPE_CHECKING:
    from os import PathLike

    from bgars.records import FloatArray, NormalField

__all__ = ["read_normal_map", "write_normal_map"]

FULL = 65535.0
NORMALS_NDIM = 3
UNIT_WITHIN = 0.1
"""How far a vector of 8 bits that was filtered or resized may be from length 1."""
MOST_OTHERS = 0.5


def write_normal_map(normals: NormalField | FloatArray, path: str | PathLike[str], *, directx: bool = False) -> None:
    """Write normals as a 16-bit RGB PNG: ``round((n + 1) / 2 * 65535)``, R = x, G = y up (OpenGL), B = z.

    Invalid pixels (NaN) are black, which no unit normal encodes to.

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
        Wrong shape or suffix.
    FileFormatError
        The file cannot be written.
    """
    path = Path(path)
    vectors = np.asarray(getattr(normals, "normals", normals), dtype=np.float32)
    if vectors.ndim != NORMALS_NDIM or vectors.shape[2] != NORMALS_NDIM:
        msg = f"normals: must have shape (H, W, 3), got {vectors.shape}"
        raise InputError(msg)
    if path.suffix.lower() != ".png":
        msg = f"{path}: a normal map file must end in .png"
        raise InputError(msg)
    signs = np.array([1.0, -1.0 if directx else 1.0, 1.0], dtype=np.float32)
    codes = np.rint((vectors * signs + 1.0) / 2.0 * FULL)
    rgb = np.where(np.isfinite(codes), np.clip(codes, 0.0, FULL), 0.0).astype(np.uint16)
    with atomic_file(path) as temporary:
        _bgars.write_png16(temporary, rgb)


def read_normal_map(path: str | PathLike[str], *, directx: bool = False) -> FloatArray:
    """Read a normal map of 8 or 16 bits a channel.

    Parameters
    ----------
    path : path
        RGB image, R = x, G = y up (OpenGL), B = z.
    directx : bool
        The file has G = y down.

    Returns
    -------
    (H, W, 3) float32
        Unit normals; NaN where the file is black.

    Raises
    ------
    FileFormatError
        The file is not an RGB image, or most of its pixels that are not black hold no unit vectors.

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
    path = Path(path)
    try:
        rgb = _bgars.read_rgb16(path, MAX_MEGAPIXELS)
    except FileFormatError as error:
        msg = f"{error}; a normal map is an RGB image, R = x, G = y, B = z"
        raise FileFormatError(msg) from None
    vectors = rgb.astype(np.float32) / np.float32(FULL) * 2.0 - 1.0
    if directx:
        vectors[..., 1] *= -1.0
    lengths = np.linalg.norm(vectors, axis=2, keepdims=True)
    black = (rgb == 0).all(axis=2)
    _check_lengths(path, lengths[~black])
    vectors /= np.maximum(lengths, 1e-6)
    vectors[black] = np.nan
    return vectors


def _check_lengths(path: Path, lengths: FloatArray) -> None:
    """Refuse a picture of something else: its colours are no unit vectors."""
    others = float(np.mean(np.abs(lengths - 1.0) > UNIT_WITHIN)) if lengths.size else 0.0
    if others > MOST_OTHERS:
        msg = (
            f"{path}: is not a normal map: at least {1 - MOST_OTHERS:.0%} of its pixels must be unit vectors (length 1 "
            f"within {UNIT_WITHIN:g}), but {others:.1%} are not"
        )
        raise FileFormatError(msg)
