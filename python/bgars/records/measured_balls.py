"""Balls measured from their shadows."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bgars.records.found_balls import BallKind

__all__ = ["BallMeasurement", "MeasuredBall"]


@dataclass(frozen=True)
class MeasuredBall:
    """What was measured of one ball; NaN where it could not be, with the reason. ``u_..`` are standard uncertainties.

    Attributes
    ----------
    name, row, col
        As in :class:`FoundBall`.
    x_um, y_um : float
        Centre: x right, y up, origin at the centre of the image.
    diameter_um : float
        Horizontal diameter.
    centre_z_um, top_um : float
        Height of the centre and of the top above the local board.
    aspect_ratio : float
        Vertical over horizontal radius: 1 for a sphere.
    flat_top_depth_um : float
        Missing height of a flat top against the full spheroid; 0 for none.
    lights_used : int
        Lights whose shadow was usable.
    reasons : tuple of str
        Why something was not measured, or is doubtful; empty when all is well.
    budget : dict of dict of float
        By reading (``x_um y_um diameter_um top_um``) and cause: standard uncertainty by that cause alone, um.
    """

    name: str
    row: int | None
    col: int | None
    x_um: float
    y_um: float
    diameter_um: float
    centre_z_um: float
    top_um: float
    aspect_ratio: float
    flat_top_depth_um: float
    u_x_um: float
    u_y_um: float
    u_diameter_um: float
    u_centre_z_um: float
    u_top_um: float
    u_aspect_ratio: float
    u_flat_top_depth_um: float
    lights_used: int
    kind: BallKind = "ball"
    reasons: tuple[str, ...] = ()
    budget: dict[str, dict[str, float]] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class BallMeasurement:
    """Everything measured of one part, before it is judged.

    Attributes
    ----------
    balls : tuple of MeasuredBall
        The balls that are there, in the order of :class:`FoundBalls`.
    board_coefficients_um : (6,) float64
        Board height z = c0 + c1 x + c2 y + c3 x^2 + c4 x y + c5 y^2 over x, y in um (z = 0 at the image centre; only
        its shape can be seen).
    light_directions : (L, 3) float64
        Refined directions to the lights (for near lights: as seen from the centre of the board).
    light_change_deg : (L,) float64
        How far each light was moved from the rig's.
    shadow_residual_rms : float
        RMS residual of the shadow fit over the contrast of lit and shadowed board.
    board_covariance : (6, 6) float64 or None
        Covariance of `board_coefficients_um`, in their units; None when unknown.
    doubts : tuple of str
        Why the numbers may be wrong by more than they say: with any, nothing passes.
    shared_um : dict of (N, M) float64
        By reading (``x_um y_um top_um``): what M independent sources of error put each ball off by, all of them
        together; part of the balls' uncertainties.
    causes : tuple of str
        Names of the M sources; several sources may have one name.
    corner_um : float
        Distance of the image's corner from its middle.
    u_pixel_pitch : float or None
        Relative standard uncertainty of the pixel pitch, where it was declared.
    u_light_deg, u_light_common_deg : (L,) float64 or None
        Standard uncertainty of each refined direction on either axis across it, and its part that moves all lights
        together; None where no light was refined.
    """

    balls: tuple[MeasuredBall, ...]
    board_coefficients_um: NDArray[np.float64]
    light_directions: NDArray[np.float64]
    light_change_deg: NDArray[np.float64]
    shadow_residual_rms: float
    warnings: tuple[str, ...] = field(default=())
    board_covariance: NDArray[np.float64] | None = None
    doubts: tuple[str, ...] = field(default=())
    shared_um: dict[str, NDArray[np.float64]] = field(default_factory=dict)
    causes: tuple[str, ...] = ()
    corner_um: float = math.nan
    u_pixel_pitch: float | None = None
    u_light_deg: NDArray[np.float64] | None = None
    u_light_common_deg: NDArray[np.float64] | None = None
