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
from bgars.checks.matt_fit import MIN_LIGHTS, fit_normals, matt_lights
from bgars.checks.noise_levels import FALLS, noise_falls
from bgars.checks.view import tile_sums, used_scale
from bgars.records.findings import Finding

if TYPE_CHECKING:
    from bgars.checks.noise_levels import NoiseCurve
    from bgars.checks.view import View
    from bgars.records.capture import Capture

__all__ = ["DOUBT", "check_format", "check_noise_of_levels", "check_response", "curvature"]

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
DOUBT = " is hardly ever linear in light"
"""What the reader assumed of JPEG, GIF, WebP and of images with a colour profile (`bgars.io.capture_headers`)."""


def curvature(view: View, lights: Array) -> tuple[float, float, float]:
    """Curvature of the response, its standard error over tiles, and the number of tiles.

    Each pixel counts under the lights that show it matt. What all pixels have in common says nothing: a lamp's strength
    is off, or the lights' elevations differ, so that ones are not linear in them.
    """
    count = len(lights)
    use = view.use.ravel()
    keep = matt_lights(view).reshape(count, -1)[:, use]
    values = view.values.reshape(count, -1)[:, use].astype(np.float64)
    number = np.maximum(keep.sum(axis=0), 1)
    relative = values / np.maximum((keep * values).sum(axis=0) / number, 1e-9)
    fit = fit_normals(relative, keep, lights)
    square = (np.einsum("lk,kn->ln", lights, fit.normal) - 1.0) ** 2
    mean = np.maximum((keep * square).sum(axis=0) / number, 1e-9)
    told = fit.solved & (number > MIN_LIGHTS) & (mean * number > SHADED**2)
    if int(told.sum()) < MIN_PIXELS:
        return 0.0, np.inf, 0.0
    keep &= told
    ones = fit_normals(np.ones_like(square), keep, lights).left
    bent = _own(fit_normals(square, keep, lights).left * mean, ones, keep)
    left = _own(fit.left, ones, keep)
    tiles = view.tiles.ravel()[use]
    top, bottom = tile_sums(tiles, (left * bent).sum(axis=0), told), tile_sums(tiles, (bent**2).sum(axis=0), told)
    if bottom.sum() <= 0.0:
        return 0.0, np.inf, 0.0
    bend = float(top.sum() / bottom.sum())
    error = float(np.sqrt(((top - bend * bottom) ** 2).sum()) / bottom.sum())
    return bend, error, float(bottom.sum() ** 2 / (bottom**2).sum())


def _own(left: Array, ones: Array, keep: Mask) -> Array:
    """(L, N) without what goes with that of ones, and without the mean of each light."""
    left = (left - ones * float((left * ones).sum() / max((ones * ones).sum(), 1e-12))) * keep
    own: Array = (left - left.sum(axis=1, keepdims=True) / np.maximum(keep.sum(axis=1), 1)[:, None]) * keep
    return own


def check_noise_of_levels(capture: Capture, curve: NoiseCurve | None) -> list[Finding]:
    """Find a camera curve by its noise, which falls from the shadows to the lit surface."""
    if capture.images.dtype.kind != "u":
        return []
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


def check_response(view: View, lights: Array) -> list[Finding]:
    """Find a camera curve that was not undone."""
    bend, error, tiles = curvature(view, lights)
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
    return []


def check_format(capture: Capture) -> list[Finding]:
    """Tell of files that are made for the eye, as the reader saw."""
    told = [each.partition(DOUBT)[0] for each in capture.assumed if DOUBT in each]
    return [
        Finding(
            "response",
            "note",
            f"{each}{DOUBT}, but is taken as linear",
            "use the camera's raw or linear TIFF or PNG files, or state the response in capture.toml ('linear' to "
            "confirm it)",
        )
        for each in told[:1]
    ]
