"""Flat polygons, far ones first, on a transparent ground: the 3-D pictures of page and overview."""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image, ImageDraw, ImageFont

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["Painter"]

SUPERSAMPLE = 2
COMPRESSION = 3
"""Of PNG: a tenth larger than the usual 6, in half its time."""


@dataclass(frozen=True)
class Painter:
    """A picture that is drawn at twice its size, then averaged: no seams between triangles, smooth edges.

    Attributes
    ----------
    image : PIL.Image.Image
        RGBA, twice as wide and high as the picture.
    low, per_px : (2,) float64
        Lower left corner of the picture, and how much a pixel of the image is.
    """

    image: Image.Image
    low: Array
    per_px: Array

    @classmethod
    def of(cls, low: Array, high: Array, size_px: tuple[int, int]) -> Painter:
        """An empty picture, size (width, height), of what lies between two corners; y up."""
        wide, tall = (SUPERSAMPLE * side for side in size_px)
        return cls(Image.new("RGBA", (wide, tall)), low, (high - low) / (wide, tall))

    def _pixels(self, places: Array) -> Array:
        pixels: Array = (places - self.low) / self.per_px
        pixels[..., 1] = self.image.height - pixels[..., 1]
        return pixels

    def polygons(self, corners: Array, colors: Array) -> None:
        """Fill (m, k, 2) polygons with (m, 3) colours from 0 to 1, in their order."""
        draw = ImageDraw.Draw(self.image)
        flat = self._pixels(corners).reshape(len(corners), -1).tolist()
        fills = np.rint(255.0 * colors).astype(np.uint8).tolist()
        for polygon, (red, green, blue) in zip(flat, fills, strict=True):
            draw.polygon(polygon, fill=(red, green, blue))

    def line(self, places: Array, color: str, width_px: float) -> None:
        """Draw through (n, 2) places."""
        if len(places) > 1:
            points = [(float(x), float(y)) for x, y in self._pixels(places)]
            ImageDraw.Draw(self.image).line(points, fill=color, width=round(SUPERSAMPLE * width_px), joint="curve")

    def sheet(self, corners: Array, color: Sequence[float], opacity: float, edge_opacity: float) -> None:
        """Lay a translucent (k, 2) polygon over what is drawn."""
        red, green, blue = (round(255 * part) for part in color)
        over = Image.new("RGBA", self.image.size)
        points = [(float(x), float(y)) for x, y in self._pixels(corners)]
        draw = ImageDraw.Draw(over)
        draw.polygon(points, fill=(red, green, blue, round(255 * opacity)))
        draw.line([*points, points[0]], fill=(red, green, blue, round(255 * edge_opacity)), width=SUPERSAMPLE)
        self.image.alpha_composite(over)

    def text(self, words: str, place: Array, anchor: str, color: str, size_px: float) -> None:
        """Write at a place; the letters of the anchor are Pillow's."""
        x, y = self._pixels(place)
        font = ImageFont.load_default(SUPERSAMPLE * size_px)
        ImageDraw.Draw(self.image).text((float(x), float(y)), words, fill=color, font=font, anchor=anchor)

    def picture(self) -> Image.Image:
        """The picture, averaged."""
        return self.image.reduce(SUPERSAMPLE)

    def png(self) -> bytes:
        """The picture as a file."""
        file = io.BytesIO()
        self.picture().save(file, "png", compress_level=COMPRESSION)
        return file.getvalue()
