"""From the codes of a normal map to unit vectors, x right, y up, z to the camera, in whichever dialect it is.

Every reading that is not the plain one is told in a note.
"""

from __future__ import annotations

from functools import reduce
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from bgars.errors import FileFormatError
from bgars.io.normal_map_background import border_color, is_cut_out
from bgars.io.normal_map_blocks import mixed_with
from bgars.io.normal_map_green import curl_of
from bgars.records.response_curve import srgb_light

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from bgars.io.normal_map_blocks import Blocks
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
LEAST_TELLING = 64
"""Pixels tilted so far that the length of their vectors tells how blue is coded."""
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
    there = _usable(pixels, swizzled)
    usable = there if use is None else there & use
    around = np.zeros_like(there)
    if use is None or pixels.blocks is not None:
        around = border_color(pixels.values, there, pixels.alike)
    surround = around if use is None and (usable & ~around).any() else np.zeros_like(there)
    vectors = _decoded(path, pixels, usable, surround, swizzled, notes)
    vectors = _toward_the_camera(path, vectors, usable & ~surround, notes)
    are_normals = _are_normals(vectors)
    usable = usable & are_normals
    vectors /= np.maximum(_lengths(vectors), 1e-6)[..., np.newaxis]
    outside = ~there | (around & ~are_normals)
    if use is None and (surround & usable).any() and is_cut_out(vectors, surround, usable):
        share = 100 * surround.mean()
        notes.append(f"the flat surround ({share:.1f} % of the pixels) is taken as background; --mask overrides this")
        usable &= ~surround
        outside |= surround
    if pixels.blocks is not None and outside.any():
        usable = _unmixed(usable, mixed_with(outside, ~are_normals, pixels.blocks), pixels.blocks, notes)
    _set_red_and_green(vectors, usable, directx, notes)
    vectors[~usable] = np.nan
    return Normals(vectors, tuple(notes))


def _swizzled(pixels: Pixels) -> bool:
    """Whether x is in alpha and y in green, as textures of the kind DXT5nm keep them."""
    if pixels.alpha is None or len(np.unique(pixels.alpha)) <= ALPHA_VALUES:
        return False
    red = pixels.values[..., 0]
    return bool(np.all(red == red.flat[0]))


def _usable(pixels: Pixels, swizzled: bool) -> BoolArray:
    """Where there is something: not black (zero in floats), finite, not hidden by alpha."""
    channels = [pixels.values[..., index] for index in range(pixels.values.shape[2])]
    usable = reduce(np.logical_and, map(np.isfinite, channels)) & reduce(
        np.logical_or, (each != 0 for each in channels)
    )
    if pixels.alpha is not None and not swizzled:
        usable &= pixels.alpha >= 0.5  # noqa: PLR2004 - half
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

    for note, vectors in _readings(plain, values, pixels.bits, inner):
        if fits(vectors):
            notes.extend([note] if note else [])
            return vectors
    return _refuse(path, plain, inner)


def _readings(plain: FloatArray, values: FloatArray, bits: int, inner: BoolArray) -> Iterator[tuple[str, FloatArray]]:
    """What three channels can mean, the likeliest first, each with its note."""
    half = _with_half_blue(plain, inner) if bits else None
    if half is not None:
        yield "blue is taken as running from 0 to 1 (z = code / full scale), as the vectors' lengths show", half
    yield "", plain
    if bits:
        yield "its codes are sRGB and were made linear", _linear(values, bits)
        return
    yield "its floats run from 0 to 1", values * 2.0 - 1.0
    yield "its floats run from 0 to 255", values * (2.0 / 255.0) - 1.0


def _with_half_blue(vectors: FloatArray, inner: BoolArray) -> FloatArray | None:
    """The same with z from 0 to 1 in place of -1 to 1, where that and not the usual code gives unit vectors.

    Judged where the two lengths differ by more than rounding can make them: on the mean of normals over a crease,
    which is too short, z from 0 to 1 halves the error at some tilts, but not nearly everywhere.
    """
    half = vectors.copy()
    half[..., 2] = (half[..., 2] + 1.0) / 2.0
    whole_length, half_length = _lengths(vectors), _lengths(half)
    telling = inner & (np.abs(whole_length - half_length) > 2.0 * TIGHT)
    if np.count_nonzero(telling) < LEAST_TELLING:
        return None
    fits_better = np.abs(half_length - 1.0) < np.abs(whole_length - 1.0) / 2.0
    return half if _share(fits_better, telling) >= NEARLY_ALL else None


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
    signed = (srgb_light(values / np.float32(2**bits - 1)) * 2.0 - 1.0).astype(np.float32)
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


def _unmixed(usable: BoolArray, mixed: BoolArray, blocks: Blocks, notes: list[str]) -> BoolArray:
    """Usable pixels that share no block of a lossy file with the surround; all of them where none would be left."""
    kept: BoolArray = usable & ~mixed
    count = int(np.count_nonzero(usable))
    share = 100.0 * (1.0 - np.count_nonzero(kept) / max(count, 1))
    size = f"blocks of {blocks.cols} x {blocks.rows} pixels"
    if not kept.any():
        notes.append(f"lossy compression has mixed all pixels with the surround, in {size}: save the map as PNG")
        return usable
    if share:
        notes.append(
            f"{share:.1f} % of the pixels are left out: lossy compression has mixed them with the surround, in {size}; "
            "a PNG keeps them"
        )
    return kept


def _set_red_and_green(vectors: FloatArray, usable: BoolArray, directx: bool | None, notes: list[str]) -> None:
    """Turn x right and y up, in place."""
    curl = curl_of(vectors, usable)
    if directx is not None:
        if directx:
            vectors[..., 1] *= -1.0
        if curl.exchanged:
            notes.append("red and green are taken as stated, but the curl of the field shows them exchanged")
        elif curl.agreement and (curl.agreement < 0) != directx:
            seen = "down" if curl.agreement < 0 else "up"
            notes.append(f"green is taken as stated, but the curl of the field shows y {seen}")
        return
    if curl.exchanged:
        vectors[..., :2] = vectors[..., 1::-1]
    if curl.agreement < 0:
        vectors[..., 1] *= -1.0
    if curl.exchanged:
        down = ", and y as down" if curl.agreement < 0 else ""
        notes.append(
            f"red and green are taken as exchanged{down}, as the curl of the field shows; --opengl overrides this; "
            "if bumps come out as dents, both are reversed"
        )
    elif curl.agreement < 0:
        notes.append(
            "green is taken as y down (DirectX), as the curl of the field shows; --opengl overrides this; "
            "if bumps come out as dents, red is reversed instead: the curl cannot tell"
        )
