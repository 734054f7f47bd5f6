"""A calibrated station."""

from __future__ import annotations

from dataclasses import dataclass

from bgars.records.flat_field import FlatField
from bgars.records.light_calibration import LightCalibration
from bgars.records.remark import Remark
from bgars.records.response_curve import ResponseCurve
from bgars.records.scale import Scale

__all__ = ["Station", "Verification"]


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
        Maximum permissible error applied.
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
        Findings of the calibrations.
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
