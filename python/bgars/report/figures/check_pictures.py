"""Pictures of a capture beside a finding: small photographs, each with an arrow to the lamp that the table names."""

from __future__ import annotations

import base64
import io
from html import escape
from typing import TYPE_CHECKING, NamedTuple

import imageio.v3 as iio
import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from bgars.checks.view import linear_values

if TYPE_CHECKING:
    from bgars.records.capture import Capture
    from bgars.records.findings import Finding

__all__ = ["Picture", "finding_pictures", "small_image"]

Bytes = NDArray[np.uint8]

SIDE_PX = 420
MOST = 8
GAMMA = 1.0 / 2.2
RED = (230, 60, 30)


class Picture(NamedTuple):
    """A picture of the page and the words under it."""

    svg: Markup
    caption: str


def finding_pictures(capture: Capture, finding: Finding) -> list[Picture]:
    """Draw what shows a finding: the image beside the others', or all images with the lamps that the table names."""
    names = [path.name for path in capture.files] or [f"image {index}" for index in range(len(capture.images))]
    if finding.image is not None:
        others = np.delete(np.arange(len(capture.images)), finding.image)
        usual = np.median([small_image(capture, int(index)) for index in others], axis=0)
        own = small_image(capture, finding.image)
        top = _white(usual)
        return [
            Picture(_svg(capture, own, top, finding.image, finding.kind == "clipped"), names[finding.image]),
            Picture(_svg(capture, usual, top, None, False), "the median of the other images, for comparison"),
        ]
    chosen = np.unique(np.linspace(0, len(capture.images) - 1, min(MOST, len(capture.images))).round().astype(int))
    top = _white(np.max([small_image(capture, int(index)) for index in chosen], axis=0))
    marks = finding.kind in ("clipped", "bit-depth")
    return [
        Picture(_svg(capture, small_image(capture, int(index)), top, int(index), marks), names[index])
        for index in chosen
    ]


def small_image(capture: Capture, index: int) -> NDArray[np.float32]:
    """(h, w) linear light of one image, every so many pixels."""
    step = max(1, max(capture.mask.shape) // SIDE_PX)
    dark = None if capture.dark is None else capture.dark[::step, ::step]
    light: NDArray[np.float32] = linear_values(capture, capture.images[index : index + 1, ::step, ::step], dark)[0]
    return light


def _white(image: NDArray[np.floating]) -> float:
    return max(float(np.percentile(image, 99.0)), 1e-4)


def _svg(capture: Capture, image: NDArray[np.floating], top: float, index: int | None, marks: bool) -> Markup:
    """The photograph, brightened for the eye, clipped pixels red where they matter, and the arrow to its lamp."""
    grey = (np.clip(image / top, 0.0, 1.0) ** GAMMA * 255.0).astype(np.uint8)
    picture = np.repeat(grey[..., None], 3, axis=2)
    if marks and index is not None:
        step = max(1, max(capture.mask.shape) // SIDE_PX)
        raw = capture.images[index, ::step, ::step]
        picture[raw >= min(capture.saturation, float(capture.images.max()))] = RED
    data = io.BytesIO()
    iio.imwrite(data, picture, extension=".png")
    high, wide = grey.shape
    address = "data:image/png;base64," + base64.b64encode(data.getvalue()).decode("ascii")
    arrow = "" if index is None else _arrow(capture, index, wide, high)
    return Markup(
        f'<svg viewBox="0 0 {wide} {high}" role="img" aria-label="{escape("photograph")}">'
        f'<image href="{address}" width="{wide}" height="{high}"/>{arrow}</svg>'
    )


def _arrow(capture: Capture, index: int, wide: int, high: int) -> str:
    x, y, _ = capture.rig.directions[index]
    length = 0.42 * min(wide, high)
    end_x, end_y = wide / 2 + length * x, high / 2 - length * y
    size = 0.03 * min(wide, high)
    return (
        f'<g stroke="#ffb000" stroke-width="{size / 2:.1f}" fill="#ffb000">'
        f'<line x1="{wide / 2:.1f}" y1="{high / 2:.1f}" x2="{end_x:.1f}" y2="{end_y:.1f}"/>'
        f'<circle cx="{end_x:.1f}" cy="{end_y:.1f}" r="{size:.1f}"/></g>'
    )
