"""Pixels of a normal map from any file that people keep one in."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from bgars import _bgars
from bgars.errors import FileFormatError, InputError, UnsupportedImageError
from bgars.files.mat_files import read_arrays
from bgars.files.safe_files import read_bounded
from bgars.io import image_formats
from bgars.io.decoders.exr import exr_channels
from bgars.io.guarded import decoding, load_npy, load_npz, load_tiff
from bgars.io.images import MAX_MEGAPIXELS
from bgars.io.normal_map_blocks import Blocks, blocks_of

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from numpy.typing import NDArray

    from bgars.records.pixels import FloatArray

__all__ = ["NORMAL_MAP_SUFFIXES", "Pixels", "is_normal_array", "read_pixels"]

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".ppm")
OTHER_IMAGE_SUFFIXES = (".webp", ".tga", ".hdr", ".pfm")
"""Of images that the compiled decoder does not read."""
ARRAY_SUFFIXES = (".exr", ".npy", ".npz", ".mat")
NORMAL_MAP_SUFFIXES = (*IMAGE_SUFFIXES, *OTHER_IMAGE_SUFFIXES, ".tif", ".tiff", *ARRAY_SUFFIXES)
WHAT = "a normal map"
CHANNELS = (2, 3, 4)
RGB, RGBA, NDIM = 3, 4, 3
FIRST_ROWS = 8
EIGHT_BIT_STEP = 257.0
"""Of 16-bit codes that 8-bit ones were widened to."""
MAX_ALIKE = 6.0
"""Levels by which a lossy file may show one colour as others."""
MAX_MAT_BYTES = int(MAX_MEGAPIXELS * 1e6) * 3 * 8
"""Doubles of the largest image."""


class Pixels(NamedTuple):
    """A file's values as they are stored.

    Attributes
    ----------
    values : (H, W, 2 or 3) float32
        Codes, or floats.
    bits : int
        Bits a code, 8 or 16; 0 of floats.
    alpha : (H, W) float32 or None
        From 0 to 1.
    alike : float
        By how many levels one colour may differ from itself (JPEG, WebP).
    blocks : Blocks or None
        Pixels that were rounded together (JPEG, WebP).
    """

    values: FloatArray
    bits: int
    alpha: FloatArray | None
    alike: float = 0.0
    blocks: Blocks | None = None


def read_pixels(path: Path) -> Pixels:
    """Read a file; its suffix says how.

    Raises
    ------
    InputError
        Another suffix, or an EXR file without the library for it.
    FileFormatError
        It cannot be read, or holds no image of two to four channels.
    """
    suffix = path.suffix.lower()
    if suffix not in NORMAL_MAP_SUFFIXES:
        msg = f"{path}: a normal map file must end in {', '.join(NORMAL_MAP_SUFFIXES)}; got {suffix!r}"
        raise InputError(msg)
    if suffix in ARRAY_SUFFIXES:
        return of_array(path, _read_array(path, suffix))
    if suffix in OTHER_IMAGE_SUFFIXES:
        return _with_blocks(path, of_array(path, image_formats.read_pixels(path, MAX_MEGAPIXELS)))
    try:
        with decoding(path, WHAT):
            values, bits = _bgars.read_color(path, MAX_MEGAPIXELS)
    except UnsupportedImageError as error:
        if suffix not in {".tif", ".tiff"}:
            msg = f"{' '.join(str(error).split())}; a normal map is an RGB image, R = x, G = y, B = z"
            raise FileFormatError(msg) from None
        return of_array(path, load_tiff(path, WHAT)[0])
    except FileFormatError as error:
        msg = f"{' '.join(str(error).split())}; a normal map is an RGB image, R = x, G = y, B = z"
        raise FileFormatError(msg) from None
    # Most files of 16 bits show at their first rows that they are no copies of 8.
    if bits == 2 * 8 and not any((part % EIGHT_BIT_STEP).any() for part in (values[:FIRST_ROWS], values)):
        values, bits = values / np.float32(EIGHT_BIT_STEP), 8
    return _with_blocks(path, _split(values, bits if bits <= 2 * 8 else 0))


def _read_array(path: Path, suffix: str) -> NDArray[Any]:
    if suffix == ".npy":
        return load_npy(path, WHAT)
    if suffix == ".npz":
        return _of_many(path, load_npz(path, WHAT))
    if suffix == ".mat":
        with decoding(path, WHAT):
            return _of_many(path, read_arrays(read_bounded(path, MAX_MAT_BYTES), MAX_MAT_BYTES))
    return _read_exr(path)


def _with_blocks(path: Path, pixels: Pixels) -> Pixels:
    """The same and what a lossy file did to them."""
    blocks = blocks_of(path)
    return pixels if blocks is None else pixels._replace(alike=MAX_ALIKE, blocks=blocks)


def of_array(path: Path, array: NDArray[Any]) -> Pixels:
    """Return the pixels of an array (H, W, C), or (C, H, W) as some libraries keep them."""
    if not is_normal_array(array.shape):
        msg = f"{path}: must have shape (H, W, 3), got {array.shape}"
        raise FileFormatError(msg)
    if array.shape[2] not in CHANNELS:
        array = np.moveaxis(array, 0, 2)
    whole = {"u": 8 * array.dtype.itemsize}.get(array.dtype.kind, 0)
    if array.dtype.kind == "f" or whole in {8, 16}:
        return _split(np.ascontiguousarray(array, dtype=np.float32), whole)
    msg = f"{path}: must hold uint8, uint16 or floats, got {array.dtype}"
    raise FileFormatError(msg)


def is_normal_array(shape: tuple[int, ...]) -> bool:
    """Whether an array of this shape can be a normal map."""
    return len(shape) == NDIM and (shape[2] in CHANNELS or shape[0] == RGB)


def _split(values: FloatArray, bits: int) -> Pixels:
    if values.shape[2] != RGBA:
        return Pixels(values, bits, None)
    alpha = values[..., RGB] / np.float32(2**bits - 1 if bits else 1)
    return Pixels(np.ascontiguousarray(values[..., :RGB]), bits, alpha)


def _of_many(path: Path, arrays: dict[str, NDArray[Any]]) -> NDArray[Any]:
    """The one array that can be normals, by its name where there are several."""
    likely = {name: array for name, array in arrays.items() if is_normal_array(array.shape)}
    named = {name: array for name, array in likely.items() if "normal" in name.lower()}
    chosen = named if len(named) == 1 else likely
    if len(chosen) != 1:
        held = ", ".join(f"{name} {array.shape}" for name, array in sorted(arrays.items()))
        msg = f"{path}: must hold one array of shape (H, W, 3), or one named normals; it holds {held}"
        raise FileFormatError(msg)
    return next(iter(chosen.values()))


def _read_exr(path: Path) -> NDArray[Any]:
    try:
        with decoding(path, WHAT):
            channels = exr_channels(path, MAX_MEGAPIXELS)
    except ImportError:
        msg = f"{path}: reading EXR needs pip install 'bgars[exr]'; or save it as a float TIFF or .npy"
        raise InputError(msg) from None
    usual = [name for name in "RGBA" if name in channels]
    if usual[:RGB] == ["R", "G", "B"]:
        chosen = usual
    else:
        chosen = [_channel(path, channels, letters) for letters in ("xr", "yg", "zb")]
    return np.stack([channels[name].astype(np.float32) for name in chosen], axis=-1)


def _channel(path: Path, names: Iterable[str], letters: str) -> str:
    found = [name for name in names if name.lower()[-1:] in letters]
    if len(found) != 1:
        msg = f"{path}: must have one channel X or R, one Y or G, one Z or B; it has {', '.join(sorted(names))}"
        raise FileFormatError(msg)
    return found[0]
