"""OpenEXR by its own library, an optional package."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from bgars.errors import FileFormatError
from bgars.io.decoders.limits import check_size

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from bgars.io.image_formats import ImageFormat
    from bgars.records.pixels import PixelArray

__all__ = ["exr_channels", "read_exr"]


def read_exr(path: Path, kind: ImageFormat, max_megapixels: float) -> PixelArray:  # noqa: ARG001 - all decoders alike
    """Return float32 pixels: (H, W) of Y or the only channel, (H, W, 3) of R, G, B."""
    channels = exr_channels(path, max_megapixels)
    if {"R", "G", "B"} <= set(channels):
        return np.stack([channels[name] for name in "RGB"], axis=-1).astype(np.float32)
    if "Y" in channels or len(channels) == 1:
        return (channels["Y"] if "Y" in channels else next(iter(channels.values()))).astype(np.float32)
    msg = f"{path}: must hold channels R, G, B, or Y, or one alone; has {', '.join(sorted(channels)) or 'none'}"
    raise FileFormatError(msg)


def exr_channels(path: Path, max_megapixels: float) -> dict[str, NDArray[Any]]:
    """Return the channels (H, W) of the first part by name."""
    import OpenEXR  # noqa: PLC0415 - optional

    with OpenEXR.File(str(path), header_only=True) as header:
        low, high = header.header()["dataWindow"]
        check_size(path, int(high[1]) - int(low[1]) + 1, int(high[0]) - int(low[0]) + 1, max_megapixels)
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return {name: np.asarray(channel.pixels) for name, channel in file.channels().items()}
