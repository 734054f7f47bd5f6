"""A calibrated station."""

from __future__ import annotations

from dataclasses import dataclass

from bgars.records.flat_field import FlatField
from bgars.records.light_calibration import LightCalibration
from bgars.records.remark import Remark
from bgars.records.response_curve import ResponseCurve
from bgars.records.scale import Scale

__all__ = ["Station"]


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
    """

    name: str = "station"
    lights: LightCalibration | None = None
    flat: FlatField | None = None
    response: ResponseCurve | None = None
    scale: Scale | None = None
    calibrated_utc: str = ""
    findings: tuple[Remark, ...] = ()
