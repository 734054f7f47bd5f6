"""Captures that no number may come from: black, saturated, without a scale."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bgars.errors import InputError

if TYPE_CHECKING:
    from bgars.records.capture import Capture

__all__ = ["check_capture"]

MAX_CLIPPED = 0.5
"""Share of clipped pixels from which a board has no shadows to see."""
MIN_CONTRAST = 2.0 / 255.0
"""Least signal, of full scale: the least contrast of a shadow that is measured."""
BRIGHT_PERCENT = 99.9
"""Percentile that counts as the brightest signal: a few hot pixels are none."""
SAMPLE_PX = 1 << 18


def check_capture(capture: Capture) -> None:
    """Refuse a capture in which nothing can be measured.

    Parameters
    ----------
    capture : Capture

    Raises
    ------
    InputError
        No pixel pitch; an image that is black (its 99.9th percentile is less than 2 grey levels of 255 above the dark
        level) or saturated (over half of its pixels are clipped). The image is named: a dead lamp or a wrong exposure
        is a fault of the set-up, not of the part.

    Examples
    --------
    >>> import bgars
    >>> check_capture(bgars.read_capture(bgars.sample_capture()))
    """
    if capture.pixel_pitch_um is None:
        msg = "pixel_pitch_um: needed to inspect a part (size of a pixel on the board, in capture.toml), got none"
        raise InputError(msg)
    step = max(1, int((capture.mask.size / SAMPLE_PX) ** 0.5))
    use = capture.mask[::step, ::step]
    dark = capture.black_level if capture.dark is None else float(np.median(capture.dark[::step, ::step]))
    for index, image in enumerate(capture.images):
        sample = image[::step, ::step][use]
        name = str(capture.files[index]) if index < len(capture.files) else f"images[{index}]"
        if sample.size == 0:
            msg = "mask: selects no pixel"
            raise InputError(msg)
        clipped = float(np.mean(sample >= capture.saturation))
        if clipped > MAX_CLIPPED:
            most, got = 100 * MAX_CLIPPED, 100 * clipped
            msg = f"{name}: saturated: at most {most:.0f} % of the pixels may be clipped, got {got:.0f} %"
            raise InputError(msg)
        signal = float(np.percentile(sample, BRIGHT_PERCENT)) - dark
        if not signal > MIN_CONTRAST * capture.full_scale:
            least = MIN_CONTRAST * capture.full_scale
            msg = f"{name}: black: its brightest parts must be over {least:g} grey levels above dark, got {signal:g}"
            raise InputError(msg)
