"""The pictures of an inspection."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np

from bgars.errors import InputError

if TYPE_CHECKING:
    from os import PathLike

    from bgars.records.capture import Capture
    from bgars.records.part_result import PartResult
    from bgars.records.pixels import PixelArray

__all__ = ["PICTURES", "check_pictures", "thinned", "write_part_pictures"]

MAX_PICTURE_PX = 1100
"""Longer sides are thinned."""

PICTURES = {
    "part.png": "the picture to look at first: every ball outlined, named, coloured by its deviation",
    "shadows.png": "the fitted shadows over the images: what heights rest on",
    "deviations.png": "maps of heights and of offsets from the grid",
    "histograms.png": "how readings are spread, against their limits",
}


def write_part_pictures(result: PartResult, capture: Capture, folder: str | PathLike[str]) -> dict[str, str]:
    """Write four PNG files of an inspection.

    Parameters
    ----------
    result : PartResult
        From :func:`bgars.inspect`.
    capture : Capture
        That it was made from.
    folder : path
        An existing folder.

    Returns
    -------
    dict of str
        Names of the files and what they show.

    Raises
    ------
    InputError
        A capture without a pixel pitch, or with another number of lights than the result.
    FileFormatError
        A file cannot be written.
    """
    # The names of the pictures are wanted where matplotlib is not.
    from bgars.report.figures.part_drawing import draw_part_pictures  # noqa: PLC0415

    check_pictures(result, capture)
    draw_part_pictures(result, thinned(capture), Path(folder))
    return dict(PICTURES)


def check_pictures(result: PartResult, capture: Capture) -> None:
    """Raise InputError for a capture that pictures of the result cannot be drawn from."""
    if capture.pixel_pitch_um is None:
        msg = "capture.pixel_pitch_um: needed for pictures in um, got none"
        raise InputError(msg)
    if len(result.light_directions) != len(capture.images):
        msg = f"capture: must have the {len(result.light_directions)} lights of the result, got {len(capture.images)}"
        raise InputError(msg)


def thinned(capture: Capture) -> Capture:
    """The capture with as many pixels as pictures show, and nothing that they do not need."""
    step = max(1, math.ceil(max(capture.mask.shape) / MAX_PICTURE_PX))
    images = np.ascontiguousarray(capture.images[:, ::step, ::step])
    return replace(
        capture,
        images=cast("PixelArray", images),
        mask=np.ascontiguousarray(capture.mask[::step, ::step]),
        pixel_pitch_um=step * (capture.pixel_pitch_um or 1.0),
        dark=None,
        response=None,
    )
