"""Camera raw by LibRaw (``rawpy``), an optional package: linear, in the camera's own colours."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bgars.io.decoders.limits import check_size

if TYPE_CHECKING:
    from pathlib import Path

    from bgars.io.image_formats import ImageFormat
    from bgars.records.pixels import PixelArray

__all__ = ["read_raw"]


def read_raw(path: Path, kind: ImageFormat, max_megapixels: float) -> PixelArray:  # noqa: ARG001 - all decoders alike
    """Return (H, W, 3) uint16 pixels proportional to light: black subtracted, no gamma, no white balance, no gain."""
    import rawpy  # noqa: PLC0415 - optional

    with rawpy.imread(str(path)) as raw:
        check_size(path, raw.sizes.height, raw.sizes.width, max_megapixels)
        pixels = raw.postprocess(
            gamma=(1.0, 1.0),
            no_auto_bright=True,
            output_bps=16,
            output_color=rawpy.ColorSpace.raw,
            user_wb=[1.0, 1.0, 1.0, 1.0],
        )
    return np.ascontiguousarray(pixels)
