"""Heights for surface metrology: Gwyddion simple field, SDF (ISO 25178-71) and X3P (ISO 25178-72), all in metres.

SDF and X3P have y upward, so their first row is the lowest of the image; GSF has the rows of the image.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bgars.errors import InputError
from bgars.extras import how_to_install, missing
from bgars.version import __version__

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from bgars.records.height_map import HeightMap

__all__ = ["AREAL_PACKAGES", "check_areal", "write_gsf", "write_sdf", "write_x3p"]

AREAL_PACKAGES = {".gsf": "gsffile", ".sdf": "sdfio", ".x3p": "x3pio"}
"""What writes each; the extra `areal` brings them."""
NEWER_PYTHON = {"sdfio", "x3pio"}
TITLE = "bgars height map"
M_PER_UM = 1e-6


def check_areal(suffix: str, path: Path, *, has_pitch: bool) -> None:
    """Raise InputError where a file of one of these formats could not be written."""
    if suffix not in AREAL_PACKAGES:
        return
    package = AREAL_PACKAGES[suffix]
    if missing(package):
        newer = " (Python 3.11 or newer)" if package in NEWER_PYTHON else ""
        msg = f"{path}: {suffix} {how_to_install(package)}{newer}"
        raise InputError(msg)
    if not has_pitch:
        msg = f"{path}: {suffix} holds metres, which need a pixel pitch (pixel_pitch_um); these heights are in pixels"
        raise InputError(msg)


def write_gsf(height: HeightMap, path: Path) -> None:
    """Write float32 after a text header; NaN = invalid."""
    from gsffile import write_gsf as write  # noqa: PLC0415 - optional

    heights_m, pitch_m = _in_metres(height)
    rows, cols = heights_m.shape
    header = {"Title": TITLE, "XReal": cols * pitch_m, "YReal": rows * pitch_m, "XYUnits": "m", "ZUnits": "m"}
    lower = path.with_suffix(".gsf")  # it refuses .GSF
    write(lower, heights_m.astype(np.float32), header)
    lower.replace(path)


def write_sdf(height: HeightMap, path: Path) -> None:
    """Write int32 with a scale, in the revision and the type whose invalid points Gwyddion, too, knows."""
    import sdfio  # noqa: PLC0415 - optional

    heights_m, pitch_m = _in_metres(height)
    kind = sdfio.Metadata(
        revision=sdfio.Revision.ISO_1_0, manufacturer_id="bgars", data_type=sdfio.DataType.INT32, z_resolution=-1.0
    )
    sdfio.write(path, heights_m[::-1], x_scale=pitch_m, y_scale=pitch_m, metadata=kind)


def write_x3p(height: HeightMap, path: Path) -> None:
    """Write float32; NaN = invalid."""
    import x3pio  # noqa: PLC0415 - optional

    heights_m, pitch_m = _in_metres(height)
    facts = x3pio.Metadata(
        creator="bgars",
        instrument=x3pio.Instrument("bgars", "photometric stereo", "", __version__),
        probing_system=x3pio.ProbingSystem(x3pio.ProbingType.NON_CONTACTING, "photometric stereo"),
        comment=TITLE,
    )
    kind = x3pio.DataType.FLOAT32
    x3pio.write(path, heights_m[::-1], x_scale=pitch_m, y_scale=pitch_m, z_type=kind, metadata=facts)


def _in_metres(height: HeightMap) -> tuple[NDArray[np.float64], float]:
    """The heights, NaN outside the mask, and the pixel pitch."""
    pitch_m = (height.pixel_pitch_um or 1.0) * M_PER_UM
    return np.where(height.mask, height.height_px.astype(np.float64) * pitch_m, np.nan), pitch_m
