"""Albedo of red, green and blue, for normals that were estimated on one value per pixel."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np

from bgars.errors import CaptureWarning, InputError
from bgars.inspection.radiance import Radiance
from bgars.io.capture import read_capture

if TYPE_CHECKING:
    from os import PathLike

    from bgars.io.recipe import ChannelName
    from bgars.records.normal_field import NormalField
    from bgars.records.pixels import FloatArray
    from bgars.records.station import Station

__all__ = ["colour_albedo"]

BLOCK_PIXELS = 1 << 18
"""Pixels that are worked on together, so that no float copy of a whole stack is made."""
LIT = 0.25
"""Values below this part of a pixel's mean are shadow: their ratios are noise."""


def colour_albedo(
    folder: str | PathLike[str],
    field: NormalField,
    *,
    channel: ChannelName | None = None,
    station: Station | str | PathLike[str] | None = None,
) -> FloatArray:
    """Return the (H, W, 3) float32 albedo of red, green and blue, by the normals of `field`; NaN where unknown.

    The albedo of the field times the ratio of each channel to its value: the median over the lights that are neither
    shadow nor clipped, so that a highlight under fewer than half of them does not tint it.

    Parameters
    ----------
    folder : path
        Capture folder that the field was estimated from; its images are read again, channel by channel.
    field : NormalField
        Its normals and albedo, 1 = full scale of the camera.
    channel, station
        As given to :func:`bgars.read_capture` for the field.

    Raises
    ------
    InputError
        The images have another size than the field.
    """
    names: tuple[ChannelName | None, ...] = (channel, "red", "green", "blue")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", CaptureWarning)  # these were told when the folder was read for the field
        captures = [read_capture(folder, channel=name, station=station) for name in names]
    grey = captures[0]
    if grey.images.shape[1:] != field.mask.shape:
        msg = f"field: must have the shape of the images {grey.images.shape[1:]}, got {field.mask.shape}"
        raise InputError(msg)
    pixels = np.flatnonzero(field.mask)
    albedo = np.full((field.mask.size, len(names) - 1), np.nan, np.float32)
    levels = [(Radiance(each), each.rig.intensities.astype(np.float32)[:, None]) for each in captures]
    with np.errstate(divide="ignore", invalid="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # a pixel without a lit value stays NaN
        for block in np.array_split(pixels, max(1, -(-len(pixels) // BLOCK_PIXELS))):
            values, *others = (linear.at(block) / strength for linear, strength in levels)
            values[~(values > LIT * np.nanmean(values, axis=0))] = np.nan
            for index, colour in enumerate(others):
                albedo[block, index] = field.albedo.flat[block] * np.nanmedian(colour / values, axis=0)
    return albedo.reshape(*field.mask.shape, -1)
