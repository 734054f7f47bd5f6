"""What a calibration finds: lights with uncertainties, and findings in words."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from bgars.rig import LightRig

__all__ = [
    "BallView",
    "FlatField",
    "LightCalibration",
    "Remark",
    "ResponseCurve",
    "Scale",
    "Severity",
    "Station",
    "Verification",
]

Array = NDArray[np.float64]
Severity = Literal["note", "doubt", "fail"]


@dataclass(frozen=True)
class Remark:
    """Something that a calibration or a check of a station noticed.

    Attributes
    ----------
    severity : {"note", "doubt", "fail"}
        To know; to look at before the result is used; beyond a limit.
    message : str
        One line that names what, where and how much.
    code : str
        The same for machines, such as ``"light-moved"``.
    value, limit : float or None
        What was measured and what is allowed, in `unit`.
    unit : str
        Of both.
    light : int or None
        Which light it is about, from 0.
    """

    severity: Severity
    message: str
    code: str = ""
    value: float | None = None
    limit: float | None = None
    unit: str = ""
    light: int | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return plain Python values."""
        return dict(vars(self))


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


@dataclass(frozen=True, eq=False)
class LightCalibration:
    """Lights as reference balls show them.

    Attributes
    ----------
    rig : LightRig
        The lights, with `u_deg`.
    u_deg : (L,) float64
        Standard uncertainty of each direction, on either of the two axes across it.
    u_own_deg, u_common_deg : (L,) float64
        Its parts: of each light alone, and what the outlines of the balls move in all of them together.
    u_lens_deg : (L,) float64 or None
        The part of `u_common_deg` that comes from a camera of which nothing was stated.
    u_positions_um : (L, 3) float64 or None
        Near lights: standard uncertainty of x, y, z.
    u_intensities : (L,) float64 or None
        Relative; None where intensities were not measured.
    lamp_deg : float
        Angle of a whole lamp as the balls show it; NaN where not measured.
    sphere : {"mirror", "matt", "balls"}
        What was in view.
    balls : tuple of BallView
        One a ball and capture.
    residual_px : float
        Root mean square of the residuals; 0 where there is nothing to spare.
    findings : tuple of Remark
        What was noticed.
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

    @property
    def doubts(self) -> tuple[Remark, ...]:
        """The findings that are more than notes."""
        return tuple(finding for finding in self.findings if finding.severity != "note")


@dataclass(frozen=True, eq=False)
class FlatField:
    """How even each light is on a flat board: smooth maps, a polynomial a light.

    Attributes
    ----------
    coefficients : (L, T) float64
        Of Legendre polynomials P_i(x) P_j(y), i + j <= degree, x and y from -1 to 1 across the image, y up; the order
        is that of :func:`bgars.station_apply.legendre_terms`. Levels are those of the flat board, 255 = full scale.
    degree : int
        Of the polynomials.
    size_px : (int, int)
        Height and width of the images.
    residual : float
        What is left of the board's levels, noise taken off, root mean square, a ratio.
    """

    coefficients: Array
    degree: int
    size_px: tuple[int, int]
    residual: float = 0.0


@dataclass(frozen=True, eq=False)
class ResponseCurve:
    """Inverse response of the camera.

    Attributes
    ----------
    levels, radiances : (K,) float64
        Grey levels as a share of full scale, 0 to 1, and the light that they stand for, 1 at full scale.
    u_radiance : float
        Standard uncertainty, of full scale.
    source : str
        How it was found.
    """

    levels: Array
    radiances: Array
    u_radiance: float = 0.0
    source: str = ""

    @property
    def nonlinearity(self) -> float:
        """Largest distance from a straight line, of full scale."""
        return float(np.abs(self.radiances - self.levels).max())

    @property
    def gamma(self) -> float:
        """Exponent of the power law that comes nearest."""
        use = (self.levels > 0.1) & (self.levels < 1.0) & (self.radiances > 0)  # noqa: PLR2004 - away from the black
        if not use.any():
            return 1.0
        x, y = np.log(self.levels[use]), np.log(self.radiances[use])
        return float(x @ y / (x @ x))


@dataclass(frozen=True)
class Scale:
    """Pixel pitch and camera as a grid shows them.

    Attributes
    ----------
    pixel_pitch_um, pixel_pitch_u_um : float
        Size of a pixel on the board, at the image centre, and its standard uncertainty.
    tilt_deg : float
        Angle of the grid against the image plane; NaN where it cannot be told (telecentric lens).
    rotation_deg : float
        Of the grid in the image, counter-clockwise.
    distortion : float
        Radial: displacement at the corner of the image, of its distance from the centre.
    residual_px : float
        Root mean square of the points against the model.
    points : int
        Points of the grid.
    camera_distance_mm : float or None
        Where it is known.
    """

    pixel_pitch_um: float
    pixel_pitch_u_um: float
    tilt_deg: float = float("nan")
    rotation_deg: float = 0.0
    distortion: float = 0.0
    residual_px: float = 0.0
    points: int = 0
    camera_distance_mm: float | None = None


@dataclass(frozen=True)
class Verification:
    """How readings of a part of known sizes compare with these.

    Attributes
    ----------
    quantity : str
        "height" or "diameter".
    captures, balls : int
        Inspections of the part, and its balls that count.
    bias_um, u_bias_um : float
        Mean error, and its standard uncertainty with that of the known sizes.
    slope, u_slope : float
        Change of the error with the size; NaN for fewer than three sizes.
    repeatability_um : float
        Standard deviation of a reading when the part is put back; NaN for one capture.
    largest_um : float
        Largest error of a single reading.
    mpe_um : float or None
        Maximum permissible error that it was judged by.
    """

    quantity: str
    captures: int
    balls: int
    bias_um: float
    u_bias_um: float
    slope: float
    u_slope: float
    repeatability_um: float
    largest_um: float
    mpe_um: float | None = None


@dataclass(frozen=True, eq=False)
class Station:
    """A station as it was calibrated; what is None was not.

    Attributes
    ----------
    name : str
        Of the station.
    lights : LightCalibration or None
    flat : FlatField or None
    response : ResponseCurve or None
    scale : Scale or None
    calibrated_utc : str
        When, ISO 8601.
    findings : tuple of Remark
        What the calibrations noticed.
    verified : tuple of Verification
        Against a part of known sizes, and `verified_utc`, when.
    """

    name: str = "station"
    lights: LightCalibration | None = None
    flat: FlatField | None = None
    response: ResponseCurve | None = None
    scale: Scale | None = None
    calibrated_utc: str = ""
    findings: tuple[Remark, ...] = ()
    verified: tuple[Verification, ...] = ()
    verified_utc: str = ""
