"""From the codes of a normal map to unit vectors, x right, y up, z to the camera, in whichever dialect it is.

Every reading that is not the plain one is told in a note.
"""

from __future__ import annotations

from functools import reduce
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from bgars.errors import FileFormatError
from bgars.io.normal_map_background import border_color, is_cut_out
from bgars.io.normal_map_green import curl_agreement

if TYPE_CHECKING:
    from pathlib import Path

    from bgars.io.normal_map_pixels import Pixels
    from bgars.records.pixels import BoolArray, FloatArray

__all__ = ["Normals", "normals_of"]

RGB = 3
EIGHT_BITS = 8
UNIT_WITHIN = 0.1
"""How far a vector of 8 bits that was filtered or resized may be from length 1."""
TIGHT = 0.02
"""The same of a map whose z is one value and right: half a code of each channel, and some."""
SHORTEST = 0.5
"""Of normals averaged over a crease of 120 degrees; below there is background in a pixel."""
MOST_OTHERS = 0.5
NEARLY_ALL = 0.95
FEW = 0.05
ALPHA_VALUES = 16
"""An alpha of more values than this is no mask."""
MOST_GREY = 1.02
"""Two channels of unit normals: x^2 + y^2 at most 1, and rounding."""


class Normals(NamedTuple):
    """Unit normals (H, W, 3), NaN where there is none, and what was assumed about their file."""

    vectors: FloatArray
    notes: tuple[str, ...]


def normals_of(path: Path, pixels: Pixels, use: BoolArray | None, directx: bool | None) -> Normals:
    """Return the normals of a map.

    Parameters
    ----------
    path : Path
        For messages.
    pixels : Pixels
        As stored.
    use : (H, W) bool or None
        The caller's mask; None: background is looked for.
    directx : bool or None
        Whether green points down; None: the curl of the field says.

    Raises
    ------
    FileFormatError
        Most pixels are no unit vectors in any known encoding, or point away from the camera.
    """
    notes: list[str] = []
    swizzled = _swizzled(pixels)
    usable = _usable(pixels, use, swizzled)
    surround = border_color(pixels.values, usable, pixels.alike) if use is None else np.zeros_like(usable)
    if not (usable & ~surround).any():
        surround = np.zeros_like(usable)
    vectors = _decoded(path, pixels, usable, surround, swizzled, notes)
    vectors = _toward_the_camera(path, vectors, usable & ~surround, notes)
    usable &= _are_normals(vectors)
    vectors /= np.maximum(_lengths(vectors), 1e-6)[..., np.newaxis]
    if use is None and (surround & usable).any() and is_cut_out(vectors, surround, usable):
        share = 100 * surround.mean()
        notes.append(f"the flat surround ({share:.1f} % of the pixels) is taken as background; --mask overrides this")
        usable &= ~surround
    _set_green(vectors, usable, directx, notes)
    vectors[~usable] = np.nan
    return Normals(vectors, tuple(notes))


def _swizzled(pixels: Pixels) -> bool:
    """Whether x is in alpha and y in green, as textures of the kind DXT5nm keep them."""
    if pixels.alpha is None or len(np.unique(pixels.alpha)) <= ALPHA_VALUES:
        return False
    red = pixels.values[..., 0]
    return bool(np.all(red == red.flat[0]))


def _usable(pixels: Pixels, use: BoolArray | None, swizzled: bool) -> BoolArray:
    """Where there is something: not black (zero in floats), finite, not hidden by alpha or mask."""
    channels = [pixels.values[..., index] for index in range(pixels.values.shape[2])]
    usable = reduce(np.logical_and, map(np.isfinite, channels)) & reduce(
        np.logical_or, (each != 0 for each in channels)
    )
    if pixels.alpha is not None and not swizzled:
        usable &= pixels.alpha >= 0.5  # noqa: PLR2004 - half
    if use is not None:
        usable &= use
    return np.asarray(usable)


def _decoded(
    path: Path, pixels: Pixels, usable: BoolArray, surround: BoolArray, swizzled: bool, notes: list[str]
) -> FloatArray:
    """Vectors of about unit length by the first reading that gives them."""
    inner = usable & ~surround
    values = pixels.values
    if swizzled and pixels.alpha is not None:
        top = float(2**pixels.bits - 1) if pixels.bits else 1.0
        notes.append("x is taken from alpha, y from green (red is constant)")
        return _with_z(_signed(np.stack([pixels.alpha * top, values[..., 1]], axis=-1), pixels.bits))
    plain = _signed(values, pixels.bits)
    if values.shape[2] != RGB or (_lacks_z(values, inner) and _unit_share(plain, inner, TIGHT) < NEARLY_ALL):
        plane = plain[..., :2]
        if _share(np.square(plane).sum(axis=2) <= MOST_GREY, inner) > NEARLY_ALL:
            notes.append("the third channel is constant or missing: z is computed from x and y")
            return _with_z(plane)
        return _refuse(path, plane, inner)

    def fits(vectors: FloatArray) -> bool:
        # A flat surround counts with the rest, one of a colour that is no vector does not.
        return max(_unit_share(vectors, inner), _unit_share(vectors, usable)) >= 1.0 - MOST_OTHERS

    if fits(plain):
        return plain
    others = (
        [("its codes are sRGB and were made linear", _linear(values, pixels.bits))]
        if pixels.bits
        else [
            ("its floats run from 0 to 1", values * 2.0 - 1.0),
            ("its floats run from 0 to 255", values * (2.0 / 255.0) - 1.0),
        ]
    )
    for note, vectors in others:
        if fits(vectors):
            notes.append(note)
            return vectors
    return _refuse(path, plain, inner)


def _lacks_z(values: FloatArray, inner: BoolArray) -> bool:
    """Whether blue is one value where red or green are several."""
    if not inner.any():
        return False
    red, green, blue = (values[..., channel][inner] for channel in range(RGB))
    return bool(blue.min() == blue.max() and (red.min() < red.max() or green.min() < green.max()))


def _signed(values: FloatArray, bits: int) -> FloatArray:
    """From codes to -1 .. 1; floats as they are. Of 8 bits 127 and 128 both mean 0, which has no code of its own."""
    if not bits:
        return values.astype(np.float32)
    signed = values.astype(np.float32) * np.float32(2.0 / (2**bits - 1)) - np.float32(1.0)
    if bits == EIGHT_BITS:
        signed[np.abs(values - np.float32(127.5)) <= 0.5] = 0.0  # noqa: PLR2004 - half a code
    return signed


def _linear(values: FloatArray, bits: int) -> FloatArray:
    """The same where a program took the codes for a picture and gave them the curve of sRGB (IEC 61966-2-1)."""
    share = values / np.float32(2**bits - 1)
    light = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)  # noqa: PLR2004 - of sRGB
    signed = (light * 2.0 - 1.0).astype(np.float32)
    step = np.float32(2.0 * 2.0 / (2**bits - 1))  # a code near half, where the curve is about twice as steep
    signed[np.abs(signed) <= step / 2] = 0.0
    return signed


def _with_z(plane: FloatArray) -> FloatArray:
    z = np.sqrt(np.maximum(1.0 - np.square(plane).sum(axis=2, keepdims=True), 0.0))
    return np.concatenate([plane, z], axis=2).astype(np.float32)


def _unit_share(vectors: FloatArray, inner: BoolArray, within: float = UNIT_WITHIN) -> float:
    return _share(np.abs(_lengths(vectors) - 1.0) <= within, inner)


def _lengths(vectors: FloatArray) -> FloatArray:
    """(H, W) lengths of (H, W, C) vectors; ``numpy.linalg.norm`` over so short an axis takes ten times as long."""
    lengths: FloatArray = np.sqrt(np.einsum("ijk,ijk->ij", vectors, vectors))
    return lengths


def _share(holds: BoolArray, inner: BoolArray) -> float:
    return float(holds[inner].mean()) if inner.any() else 1.0


def _are_normals(vectors: FloatArray) -> BoolArray:
    lengths = _lengths(vectors)
    found: BoolArray = (lengths >= SHORTEST) & (lengths <= 1.0 + UNIT_WITHIN)
    return found


def _refuse(path: Path, vectors: FloatArray, inner: BoolArray) -> FloatArray:
    """Of a picture of something else: its colours are no unit vectors."""
    others = 1.0 - (_unit_share(vectors, inner) if vectors.shape[2] == RGB else 0.0)
    msg = (
        f"{path}: is not a normal map: at least {100 * (1 - MOST_OTHERS):.0f} % of its pixels must be unit vectors "
        f"(length 1 within {UNIT_WITHIN:g}), but {100 * others:.1f} % are not"
    )
    raise FileFormatError(msg)


def _toward_the_camera(path: Path, vectors: FloatArray, inner: BoolArray, notes: list[str]) -> FloatArray:
    """The same with z in the third channel, pointing to the camera; refused where no one channel can be z."""
    inner = inner & _are_normals(vectors)
    if not inner.any():
        return vectors
    if float((vectors[..., 2][inner] > 0).mean()) >= NEARLY_ALL:
        return vectors
    above = (vectors[inner] > 0).mean(axis=0)
    mean = vectors[inner].mean(axis=0)
    if above[0] >= NEARLY_ALL and mean[0] > mean[2]:
        notes.append("red is above half nearly everywhere, blue is not: its channels are taken as B, G, R")
        return np.ascontiguousarray(vectors[..., ::-1])
    if above[2] <= FEW:
        notes.append("blue is below half nearly everywhere: z is taken as pointing away from the camera, and reversed")
        return vectors * np.array([1.0, 1.0, -1.0], np.float32)
    msg = (
        f"{path}: {100 * (1 - above[2]):.0f} % of its normals face away from the camera (blue below half): an object- "
        "or world-space map cannot be used; save one in camera (tangent) space, or exclude the back with a mask"
    )
    raise FileFormatError(msg)


def _set_green(vectors: FloatArray, usable: BoolArray, directx: bool | None, notes: list[str]) -> None:
    """Turn y up, in place."""
    agreement = curl_agreement(vectors, usable)
    if directx if directx is not None else agreement < 0:
        vectors[..., 1] *= -1.0
    if directx is None and agreement < 0:
        notes.append("green is taken as y down (DirectX), as the curl of the field shows; --opengl overrides this")
    elif directx is not None and agreement and (agreement < 0) != directx:
        seen = "down" if agreement < 0 else "up"
        notes.append(f"green is taken as stated, but the curl of the field shows y {seen}")
