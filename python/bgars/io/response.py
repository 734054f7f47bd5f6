"""Camera response: tables that turn a grey level back into something proportional to light."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bgars.errors import FileFormatError, InputError
from bgars.files.light_files import read_text
from bgars.records.response_curve import srgb_light

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from bgars.records.pixels import FloatArray, PixelArray

__all__ = ["Curve", "gamma_curve", "linearise", "read_response_table", "srgb_curve"]

Curve = tuple["NDArray[np.float64]", "NDArray[np.float64]"]
"""Grey levels (increasing) and the radiance of each."""

COLUMNS = 2


def gamma_curve(gamma: float, full_scale: float) -> Curve:
    """Inverse response of a camera that encodes ``signal^(1/gamma)``, finely sampled."""
    levels = np.linspace(0.0, full_scale, 1 << 16)
    return levels, (levels / full_scale) ** gamma


def srgb_curve(full_scale: float) -> Curve:
    """Inverse response of sRGB, finely sampled.

    Examples
    --------
    >>> levels, radiances = srgb_curve(255.0)
    >>> round(float(np.interp(128.0, levels, radiances)), 6)
    0.215861
    """
    levels = np.linspace(0.0, full_scale, 1 << 16)
    return levels, srgb_light(levels / full_scale)


def read_response_table(path: Path, full_scale: float) -> Curve:
    """Read a measured response: a CSV of grey level and radiance (any unit), a header line allowed.

    Raises
    ------
    FileFormatError
        A line that is not two numbers.
    InputError
        Levels or radiances that do not grow, or that do not cover 0 to full scale.
    """
    rows: list[tuple[float, float]] = []
    for number, line in enumerate(read_text(path).splitlines(), start=1):
        fields = line.split("#", 1)[0].replace(",", " ").replace(";", " ").split()
        if not fields:
            continue
        try:
            level, radiance = (float(field) for field in fields)
        except ValueError as error:
            if not rows and number == 1:
                continue
            msg = f"{path}: line {number} must hold two numbers (grey level, radiance), got {line.strip()!r}"
            raise FileFormatError(msg) from error
        rows.append((level, radiance))
    if len(rows) < COLUMNS:
        msg = f"{path}: a response needs at least 2 lines of grey level and radiance, got {len(rows)}"
        raise InputError(msg)
    levels, radiances = np.array(rows, dtype=np.float64).T
    if not (np.isfinite(levels).all() and np.isfinite(radiances).all()):
        msg = f"{path}: grey levels and radiances must be finite"
        raise InputError(msg)
    for name, column in (("grey level", levels), ("radiance", radiances)):
        backward = np.flatnonzero(np.diff(column) <= 0)
        if backward.size:
            index = int(backward[0])
            msg = f"{path}: the {name} must grow from line to line, got {column[index]:g} then {column[index + 1]:g}"
            raise InputError(msg)
    if levels[0] > 0 or levels[-1] < full_scale:
        msg = f"{path}: must cover grey levels 0 to {full_scale:g}, covers {levels[0]:g} to {levels[-1]:g}"
        raise InputError(msg)
    return levels, radiances


def linearise(values: PixelArray | NDArray[np.float64], curve: Curve, full_scale: float) -> FloatArray:
    """Return linear values of an array of grey levels, any shape, float32; full scale stays full scale."""
    levels, radiances = curve
    zero, full = np.interp([0.0, full_scale], levels, radiances)
    linear: FloatArray = ((np.interp(values, levels, radiances) - zero) * (full_scale / (full - zero))).astype(
        np.float32
    )
    return linear
