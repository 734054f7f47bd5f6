"""Reference balls as the calibration saw them: outline and highlights drawn into a picture of each."""

from __future__ import annotations

import base64
import html
import math
from typing import TYPE_CHECKING

import imageio.v3 as iio
import numpy as np

from bgars.io.atomic import atomic_file
from bgars.station.levels import linear_levels

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from bgars.records.capture import Capture
    from bgars.records.light_calibration import BallView, LightCalibration

__all__ = ["balls_svg", "write_balls"]

SIDE, MARGIN = 360, 1.15
MOST_BALLS = 12
"""Balls that are drawn; a part has hundreds."""


def balls_svg(captures: Sequence[Capture], lights: LightCalibration) -> str:
    """Return one SVG with a picture of each ball: brightest level of all lights, outline, highlight of each light."""
    shown = lights.balls[:MOST_BALLS]
    columns = min(2, len(shown))
    lines = math.ceil(len(shown) / columns)
    width, height = columns * SIDE, lines * (SIDE + 20)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}" '
        'role="img" font-family="sans-serif" font-size="11">'
        "<title>Balls: outline (red), highlights (yellow, by light)</title>"
    ]
    by_name = {capture.name: capture for capture in captures}
    for index, ball in enumerate(shown):
        # Captures without a folder share one name: then there is one, or they come in the order of the balls.
        capture = by_name[ball.capture] if len(by_name) == len(captures) else captures[min(index, len(captures) - 1)]
        parts.append(_one(capture, ball, index % columns * SIDE, index // columns * (SIDE + 20)))
    return "".join(parts) + "</svg>\n"


def write_balls(captures: Sequence[Capture], lights: LightCalibration, path: Path) -> None:
    """Write that SVG.

    Raises
    ------
    FileFormatError
        The folder is missing or not writable.
    """
    with atomic_file(path) as place:
        place.write_text(balls_svg(captures, lights), encoding="utf-8")


def _one(capture: Capture, ball: BallView, left: int, top: int) -> str:
    bright = linear_levels(capture).images.max(axis=0)
    height, width = bright.shape
    x, y, radius = ball.outline_px
    col, row = x + width / 2.0, height / 2.0 - y
    half = math.ceil(MARGIN * radius)
    first_col, first_row = max(0, round(col) - half), max(0, round(row) - half)
    crop = bright[first_row : round(row) + half, first_col : round(col) + half]
    step = max(1, math.ceil(max(crop.shape) / (2 * SIDE)))
    # A dark ball on a dark ground shows its rim only where the black is raised.
    scale = max(float(np.percentile(crop, 97.0)), 2.0)
    tones = np.clip(255.0 * np.sqrt(np.clip(crop[::step, ::step], 0.0, scale) / scale), 0, 255).astype(np.uint8)
    picture = base64.b64encode(iio.imwrite("<bytes>", tones, extension=".png")).decode("ascii")
    zoom = SIDE / max(crop.shape)
    cx, cy = zoom * (col - first_col), zoom * (row - first_row)
    found = [
        f'<g transform="translate({left},{top})"><image width="{zoom * crop.shape[1]:.1f}" '
        f'height="{zoom * crop.shape[0]:.1f}" href="data:image/png;base64,{picture}"/>',
        f'<circle cx="{cx:.2f}" cy="{cy:.2f}" r="{zoom * radius:.2f}" fill="none" stroke="#e33" stroke-width="1"/>',
    ]
    for light, (px, py) in enumerate(ball.highlights_px):
        if math.isfinite(px):
            at = (zoom * (px + width / 2.0 - first_col), zoom * (height / 2.0 - py - first_row))
            found.append(
                f'<path d="M{at[0] - 5:.1f} {at[1]:.1f}h10m-5 -5v10" stroke="#fc0" fill="none"/>'
                f'<text x="{at[0] + 6:.1f}" y="{at[1] - 4:.1f}" fill="#fc0" stroke="#000" '
                f'stroke-width="2.5" paint-order="stroke">{light}</text>'
            )
    u = ball.u_outline_px
    words = f"{ball.capture}: radius {radius:.2f} px (u {u[2]:.2f}), centre u {u[0]:.2f} px"
    found.append(f'<text x="2" y="{SIDE + 14}">{html.escape(words)}</text></g>')
    return "".join(found)
