"""Which pixels of a normal map show no surface: the one colour around it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy  # loads its modules when they are used

if TYPE_CHECKING:
    from bgars.records.pixels import BoolArray, FloatArray

__all__ = ["border_color", "is_cut_out"]

MOST_OF_BORDER = 0.5
"""A colour that more of the border has is that of a background."""
STEEP_N_Z = 0.5
"""An object in front of a background ends in steep normals, 60 degrees and more; a surface in its plane does not."""
STEEP_SHARE = 0.5
OUTLINE_BLUR_PX = 2.0
LEAST_SLOPE = 0.05
"""At an outline; below, 8 bits and filters say nothing about its direction."""
ALONG_SHARE = 0.1
"""Of a slope at an outline that runs along it: up to 1/2 where a surface is cut; 0 where it meets a plane, 0.03 with
an outline that pixels turn by 10 degrees."""


def border_color(values: FloatArray, usable: BoolArray, alike: float) -> BoolArray:
    """True on the pixels of the border's main colour that are connected with the border.

    Parameters
    ----------
    values : (H, W, C)
        Codes, or floats.
    usable : (H, W)
        False where it is known that there is nothing.
    alike : float
        By how much the values of one colour may differ.
    """
    frame = np.zeros(usable.shape, np.bool_)
    frame[0] = frame[-1] = frame[:, 0] = frame[:, -1] = True
    colors, counts = np.unique(values[frame & usable], axis=0, return_counts=True)
    if not len(colors):
        return np.zeros_like(frame)
    main = colors[np.argmax(counts)]
    same = usable & (np.abs(values - main) <= alike).all(axis=2)
    if np.count_nonzero(same & frame) <= MOST_OF_BORDER * np.count_nonzero(frame):
        return np.zeros_like(frame)
    labels, _ = scipy.ndimage.label(same)
    touching = np.unique(labels[frame])
    found: BoolArray = np.isin(labels, touching[touching > 0])
    return found


def is_cut_out(normals: FloatArray, flat: BoolArray, usable: BoolArray) -> bool:
    """Whether a flat surround is background, not the plane that what it surrounds rests on.

    Background: the outline is steep, as of a ball in front of something, or what is there rises and falls along its
    outline, where a surface that meets a plane does not.
    """
    rim = scipy.ndimage.binary_dilation(flat, iterations=2) & ~flat & usable
    if not rim.any():
        return False
    n_z = normals[..., 2][rim]
    if float(np.mean(n_z < STEEP_N_Z)) > STEEP_SHARE:
        return True
    outward = np.gradient(scipy.ndimage.gaussian_filter(flat.astype(np.float64), OUTLINE_BLUR_PX))
    along_x, along_y = outward[0][rim], outward[1][rim]  # across (d/dcol, -d/drow), turned by 90 degrees
    length = np.maximum(np.hypot(along_x, along_y), 1e-9)
    slopes = normals[rim][:, :2] / np.maximum(n_z, STEEP_N_Z)[:, np.newaxis]
    along = (slopes[:, 0] * along_x + slopes[:, 1] * along_y) / length
    total = float(np.mean(np.square(slopes).sum(axis=1)))
    return total > LEAST_SLOPE**2 and float(np.mean(along**2)) > ALONG_SHARE * total
