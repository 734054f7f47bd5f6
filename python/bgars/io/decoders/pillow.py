"""PNG, JPEG, BMP, PNM, TGA, WebP and GIF by Pillow: each file by its own decoder, never by a guess."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

import numpy as np

from bgars.errors import FileFormatError
from bgars.io.decoders.limits import check_size

if TYPE_CHECKING:
    from pathlib import Path

    from bgars.io.image_formats import ImageFormat
    from bgars.records.pixels import PixelArray

__all__ = ["read_pillow"]

DECODERS = {"PNM": ("PPM",), "JPEG": ("JPEG", "MPO"), "BMP": ("BMP",), "WebP": ("WEBP",)}
CONVERTED = {"1": "L", "CMYK": "RGB", "YCbCr": "RGB", "LAB": "RGB", "HSV": "RGB", "RGBX": "RGB", "PA": "RGBA"}
CONVERTED |= {"La": "LA", "RGBa": "RGBA"}
U16 = 65535


def read_pillow(path: Path, kind: ImageFormat, max_megapixels: float) -> PixelArray:
    """Return the pixels of an image with one frame."""
    from PIL import Image  # noqa: PLC0415 - most captures never need it

    with path.open("rb") as file, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # its own limit of size, and complaints of metadata
        image: Any = Image.open(file, formats=DECODERS.get(kind.name, (kind.name.upper(),)))
        check_size(path, image.height, image.width, max_megapixels)
        frames = getattr(image, "n_frames", 1)
        if frames != 1 and image.format != "MPO":
            msg = f"{path}: holds {frames} frames; one image per light is expected, or a TIFF stack of all of them"
            raise FileFormatError(msg)
        image.load()
        if image.mode == "P":
            image = image.convert("RGBA" if "transparency" in image.info else "RGB")
        elif image.mode in CONVERTED:
            image = image.convert(CONVERTED[image.mode])
        pixels = np.array(image)
    if pixels.dtype.kind in "iu" and pixels.dtype.itemsize > 1:
        if pixels.size and (pixels.min() < 0 or pixels.max() > U16):
            msg = f"{path}: holds grey levels from {pixels.min()} to {pixels.max()}; 0 to {U16} are supported"
            raise FileFormatError(msg)
        return pixels.astype(np.uint16)
    return pixels
