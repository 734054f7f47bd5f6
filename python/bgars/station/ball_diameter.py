"""Whether the stated diameter of a ball agrees with the scale that is known already."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from bgars.errors import InputError
from bgars.station.light_bundle import LENS_SIDES
from bgars.station.mirror import sphere_of_outline

if TYPE_CHECKING:
    from bgars.station.observe import Observed

__all__ = ["need_diameter_of_scale"]

SIGMAS = 3.0
CALLIPER = 0.01
"""What a diameter by a calliper may be off beside that: 0.02 mm of 2 mm."""


def need_diameter_of_scale(seen: Observed, diameter_um: float) -> None:
    """Refuse a diameter that the pixel pitch of the captures contradicts beyond the uncertainties.

    Raises
    ------
    InputError
        With the stated diameter, and what the scale says.
    """
    for ball in seen.balls:
        pitch_um = ball.capture.pixel_pitch_um
        if pitch_um is None:
            continue
        outline = ball.outline
        measured_um = 2.0 * pitch_um * sphere_of_outline(outline.circle_px, seen.camera_px).radius_px
        u_px = outline.u_px if ball.u_outline_px is None else ball.u_outline_px
        is_lens_open = ball.capture.camera_distance_mm is None
        share_by_lens = LENS_SIDES * outline.radius_px / max(ball.capture.mask.shape) if is_lens_open else 0.0
        share = math.hypot(
            u_px[2] / outline.radius_px, (ball.capture.pixel_pitch_u_um or 0.0) / pitch_um, share_by_lens
        )
        if abs(diameter_um / measured_um - 1.0) > SIGMAS * share + CALLIPER:
            msg = (
                f"{ball.capture.name}: the diameter of the ball is stated as {diameter_um / 1000.0:.6g} mm, but is "
                f"{measured_um / 1000.0:.4g} mm (u {share * measured_um / 1000.0:.2g} mm) by the scale of "
                f"{pitch_um:.6g} um per pixel: correct the one or the other; where the scale is known, no diameter is "
                "needed"
            )
            raise InputError(msg)
