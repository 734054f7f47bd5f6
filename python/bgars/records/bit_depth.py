"""Bits a camera really delivers inside 16-bit files: 10, 12 or 14, as industrial cameras do."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["BitDepth", "find_bit_depth", "plateau_bits"]

FILE_BITS = 16
FEWEST_BITS = 8
WINDOW = 64
"""The levels just below the plateau that it is compared with: one part in so many of its own grey level."""
LOG_ACCIDENT = math.log(1e-6)
"""Largest chance, by its logarithm, that a plateau may have in a tail of grey levels that nothing clipped."""
SHIFT_EVIDENCE_BITS = 24
"""Low bits that must be seen to be 0 before they are believed always to be: an accident of 1 in 2^24."""
SAMPLE_PIXELS = 1 << 16


@dataclass(frozen=True)
class BitDepth:
    """How many bits the grey levels of 16-bit files have.

    Attributes
    ----------
    bits : int
        Bits of the camera.
    shift : int
        0 where the bits are the low ones of the file; else each level is a multiple of ``2**shift``.
    clipped : int
        Pixels at the largest level; 0 where the depth is known by the shift alone.
    reason : str
        Why this is no accident, in one line.
    """

    bits: int
    shift: int
    clipped: int
    reason: str

    @property
    def saturation(self) -> int:
        """The largest grey level that the camera can give, in the grey levels of the files."""
        return ((1 << self.bits) - 1) << self.shift


def plateau_bits(images: NDArray[Any]) -> int | None:
    """Return n where 16-bit images are clipped at ``2**n - 1``, n < 16; None otherwise.

    Parameters
    ----------
    images : (L, H, W) or (H, W) array
        Grey levels as the files hold them; only uint16 can hide a smaller depth.

    Examples
    --------
    >>> import numpy as np
    >>> scene = np.arange(64 * 64, dtype=np.uint16).reshape(64, 64) + 600
    >>> plateau_bits(np.minimum(scene, 4095)), plateau_bits(scene)
    (12, None)
    """
    depth = find_bit_depth(images)
    return depth.bits if depth is not None and depth.shift == 0 else None


def find_bit_depth(images: NDArray[Any]) -> BitDepth | None:
    """Find a depth below 16 bits by a plateau at its largest level, or by low bits that are always 0.

    A plateau: the brightest level of all images is ``(2**n - 1) * 2**shift``, and more pixels have it than the tail of
    grey levels just below lets expect. Without clipping the counts of neighbouring levels are alike, so that the top
    one is about a Poisson number of their mean; its chance to be so large is bounded by Chernoff's inequality and must
    be below 1e-6. That the brightest level is one of these few numbers out of 65,536 comes on top.

    Parameters
    ----------
    images : (L, H, W) or (H, W) array
        Grey levels as the files hold them.

    Returns
    -------
    BitDepth or None
        None where the full 16 bits are used, where nothing tells, and for pixels that are not uint16.

    Examples
    --------
    >>> import numpy as np
    >>> scene = np.arange(64 * 64, dtype=np.uint16).reshape(64, 64) + 600
    >>> find_bit_depth(np.minimum(scene, 1023)).reason
    '3673 pixels have grey level 1023 = 2^10 - 1, none has a higher one, and each level just below has about 1'
    >>> find_bit_depth(np.minimum(scene, 4095) << 4).saturation
    65520
    """
    if images.dtype != np.uint16 or images.size == 0:
        return None
    return _plateau(images) or _shifted(images)


def _plateau(images: NDArray[Any]) -> BitDepth | None:
    top = int(images.max())
    shift = (top & -top).bit_length() - 1 if top else 0
    bits = (top >> shift).bit_length()
    all_ones = (top >> shift) == (1 << bits) - 1
    if not all_ones or not FEWEST_BITS <= bits < FILE_BITS or bits + shift > FILE_BITS:
        return None
    clipped = int(np.count_nonzero(images == top))
    width = max(top // WINDOW, 1)
    below = int(np.count_nonzero(images >= top - width)) - clipped
    levels = max(width >> shift, 1)
    expected = max(below, 1) / levels
    # Chernoff: P(X >= c) <= exp(-m) (e m / c)^c for a Poisson number X of mean m < c.
    if clipped <= expected or clipped - expected + clipped * math.log(expected / clipped) > LOG_ACCIDENT:
        return None
    number = f"2^{bits} - 1" if shift == 0 else f"(2^{bits} - 1) * 2^{shift}"
    told = f"about {below / levels:.0f}" if below >= levels else "less than 1"
    reason = (
        f"{clipped} pixels have grey level {top} = {number}, none has a higher one, "
        f"and each level just below has {told}"
    )
    return BitDepth(bits, shift, clipped, reason)


def _shifted(images: NDArray[Any]) -> BitDepth | None:
    """Depth of data whose low bits are always 0: cameras that align their bits with the top of the file's."""
    flat = images.reshape(-1) if images.flags.c_contiguous else images.ravel()
    sample = flat[:: max(1, flat.size // SAMPLE_PIXELS)]
    if int(np.bitwise_or.reduce(sample)) & 1:
        return None
    used = int(np.bitwise_or.reduce(flat))
    if used == 0 or used & 1:
        return None
    shift = (used & -used).bit_length() - 1
    levels = len(np.unique(sample))
    if used.bit_length() != FILE_BITS or FILE_BITS - shift < FEWEST_BITS or levels * shift < SHIFT_EVIDENCE_BITS:
        return None
    reason = f"all of {levels} different grey levels are multiples of {1 << shift}"
    return BitDepth(FILE_BITS - shift, shift, 0, reason)
