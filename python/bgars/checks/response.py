"""Whether grey levels are linear in light: what a matt pixel gives under many lights bends where they are not.

A camera that writes ``E^(1/g)`` turns ``1 + x`` into ``1 + y + (1 - g) / 2 y^2 + ...``, with ``y`` the linear part: so
the square of what the lights change in a pixel appears in what least squares leaves over, times ``(1 - g) / 2``.
Highlights bend the other way.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bgars.checks.evidence import critical_t
from bgars.checks.noise_levels import FALLS, noise_curve, noise_falls
from bgars.checks.view import tile_sums, used_scale
from bgars.records.findings import Finding

if TYPE_CHECKING:
    from bgars.checks.view import View
    from bgars.records.capture import Capture

__all__ = ["check_noise_of_levels", "check_response", "curvature"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

BENT = -0.25
"""Curvature of gamma 1.5: from there on slopes are wrong by a third. Camera curves have 1.8 to 2.4."""
U_MOST = 0.1
"""Largest standard error of a curvature that is known."""
STRONGEST = 2.4
"""Gamma beyond which only 'more' is said: other light bends the curve as well."""
SHADED = 0.2
"""Relative change between the lights, root of the sum of squares: pixels that see less cannot show how it bends."""
MIN_PIXELS = 150
ADVICE = (
    "switch gamma (sRGB, tone curves) off in the camera, or state the response in capture.toml: 'srgb', a gamma, or a "
    "measured table"
)
JPEG = (".jpg", ".jpeg")


def curvature(view: View, lit: Mask, lights: Array) -> tuple[float, float, float]:
    """Curvature of the response, its standard error over tiles, and the number of tiles."""
    values = view.values.astype(np.float64)
    project = lights @ np.linalg.pinv(lights)
    relative = values / np.maximum(values.mean(axis=0), 1e-9)
    linear = np.einsum("kl,lhw->khw", project, relative)
    left = relative - linear
    square = (linear - 1.0) ** 2
    lit = lit & (square.sum(axis=0) > SHADED**2)
    if int(lit.sum()) < MIN_PIXELS:
        return 0.0, np.inf, 0.0
    square -= np.einsum("kl,lhw->khw", project, square)
    top = tile_sums(view.tiles, (left * square).sum(axis=0), lit)
    bottom = tile_sums(view.tiles, (square**2).sum(axis=0), lit)
    if bottom.sum() <= 0.0:
        return 0.0, np.inf, 0.0
    bend = float(top.sum() / bottom.sum())
    error = float(np.sqrt(((top - bend * bottom) ** 2).sum()) / bottom.sum())
    tiles = float(bottom.sum() ** 2 / (bottom**2).sum())
    return bend, error, tiles


def check_noise_of_levels(capture: Capture) -> list[Finding]:
    """Find a camera curve by its noise, which falls from the shadows to the lit surface."""
    if capture.images.dtype.kind != "u":
        return []
    curve = noise_curve(capture)
    ratio = 0.0 if curve is None else noise_falls(curve, 1.0 / used_scale(capture, capture.images))
    if ratio < FALLS:
        return []
    return [
        Finding(
            "response",
            "warning",
            f"grey levels are not linear in light: the noise of dark parts is {ratio**0.5:.1f} times that of bright "
            "ones, which no linear camera does",
            ADVICE,
            value=ratio,
            limit=FALLS,
            unit="ratio of variances",
        )
    ]


def check_response(capture: Capture, view: View, lit: Mask, lights: Array) -> list[Finding]:
    """Find a camera curve that was not undone."""
    if len(lights) < 5 or not lit.any():  # noqa: PLR2004 - one degree of freedom does not tell
        return []
    bend, error, tiles = curvature(view, lit, lights)
    jpeg = any(path.suffix.lower() in JPEG for path in capture.files) and capture.response is None
    if bend < BENT and error < U_MOST and -bend > critical_t(tiles) * error:
        gamma = 1.0 - 2.0 * bend
        told = f"gamma {gamma:.1f}" if gamma < STRONGEST else f"gamma {STRONGEST:g} or more"
        return [
            Finding(
                "response",
                "warning",
                f"grey levels are not linear in light: they look like {told}",
                ADVICE,
                value=gamma,
                limit=1.0 - 2.0 * BENT,
                unit="gamma",
            )
        ]
    if jpeg:
        return [
            Finding(
                "response",
                "note",
                "JPEG files are hardly ever linear in light, but are taken as linear",
                "use the camera's raw or linear TIFF or PNG files, or state the response in capture.toml",
            )
        ]
    return []
