"""Calibrated lights, and what was seen of the balls."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bgars.records.remark import Remark
from bgars.records.short import Short

if TYPE_CHECKING:
    from bgars.records.rig import LightRig

__all__ = ["BallView", "LightCalibration"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class BallView:
    """A reference ball in one capture.

    Attributes
    ----------
    capture : str
        Name of the capture.
    outline_px : (3,) float64
        x, y (from the image centre, y up) and radius, as measured.
    u_outline_px : (3,) float64
        Standard uncertainties.
    highlights_px : (L, 2) float64
        Places of the highlights, matt balls: of the brightest points; NaN where not seen.
    residuals_px : (L, 2) float64
        Measured less fitted place; NaN where not seen.
    """

    capture: str
    outline_px: Array
    u_outline_px: Array
    highlights_px: Array
    residuals_px: Array


@dataclass(frozen=True, eq=False, repr=False)
class LightCalibration(Short):
    """Lights as reference balls show them.

    Attributes
    ----------
    rig : LightRig
        The lights, with `u_deg`.
    u_deg : (L,) float64
        Standard uncertainty of each direction, on either of the two axes across it.
    u_own_deg, u_common_deg : (L,) float64
        Its parts: of each light alone, and what moves all of them together: outlines of the balls, distance of the
        lamps.
    u_lens_deg : (L,) float64 or None
        The part of `u_common_deg` that comes from a camera of which nothing was stated.
    u_distance_deg : (L,) float64 or None
        The part of `u_common_deg` that comes from the distance of the lamps, from which the ball sees them lower than
        the board does.
    u_positions_um : (L, 3) float64 or None
        Near lights: standard uncertainty of x, y, z.
    u_intensities : (L,) float64 or None
        Relative; None where intensities were not measured.
    lamp_deg : float
        Angular diameter of a lamp as the balls show it; NaN where not measured.
    sphere : {"mirror", "matt", "balls"}
        What was in view.
    balls : tuple of BallView
        One per ball and capture.
    residual_px : float
        Root mean square of the residuals; 0 where there is nothing to spare.
    findings : tuple of Remark
        Findings.
    level : float
        Mean strength of the lights, grey levels of 255, of what `level_by` names: "highlights" (times their solid
        angle), "shading" of a white facet, or the "board"; NaN where not measured.
    level_by : str
    pixel_pitch_um : float or None
        Near lights: the pitch, by a scale or by the size of the ball, that put their positions in micrometres.
    size_px : (int, int) or None
        Height and width of the images, in the middle of which positions have their origin.
    """

    rig: LightRig
    u_deg: Array
    u_own_deg: Array
    u_common_deg: Array
    sphere: str
    balls: tuple[BallView, ...]
    residual_px: float
    u_positions_um: Array | None = None
    u_intensities: Array | None = None
    u_lens_deg: Array | None = None
    lamp_deg: float = float("nan")
    findings: tuple[Remark, ...] = field(default=())
    level: float = float("nan")
    level_by: str = ""
    pixel_pitch_um: float | None = None
    size_px: tuple[int, int] | None = None
    u_distance_deg: Array | None = None

    @property
    def doubts(self) -> tuple[Remark, ...]:
        """The findings that are more than notes."""
        return tuple(finding for finding in self.findings if finding.severity != "note")
