"""The tables of ``station.toml``: their keys, types and ranges."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from bgars.io.strict_toml import Strict

__all__ = ["FlatTable", "LightsTable", "ResponseTable", "ScaleTable", "StationFile", "VerifyTable"]

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Number = Annotated[float, Field(allow_inf_nan=False)]
Distance = Annotated[float, Field(gt=0)]
"""May be endless."""
Vector = tuple[Number, Number, Number]
Distortion = Annotated[float, Field(gt=-0.33, lt=0.33)]
"""A displacement that grows with the third power of the radius folds the picture from -1/3 on."""
Side = Annotated[int, Field(gt=0)]


class LightsTable(Strict):
    """The ``[lights]`` table."""

    sphere: Literal["", "mirror", "matt", "balls"] = Field("", description="what was in view: mirror, matt or balls")
    directions: list[Vector] | None = Field(None, description="unit vectors from the board to the lights, by image")
    positions_mm: list[Vector] | None = Field(None, description="or positions, origin = image centre on the board")
    intensities: list[Positive] = Field(description="relative intensities, mean 1")
    u_deg: list[Positive] = Field(description="standard uncertainty of each direction, per axis across it")
    u_own_deg: list[NotNegative] = Field(description="the component of each light alone")
    u_common_deg: list[NotNegative] = Field(description="the component common to all lights (outlines, lens, distance)")
    u_lens_deg: list[NotNegative] | None = Field(None, description="the component of a lens that was not stated")
    u_distance_deg: list[NotNegative] | None = Field(None, description="the component of the distance of the lamps")
    u_positions_mm: list[Vector] | None = Field(None, description="standard uncertainties of positions_mm")
    u_intensities: list[NotNegative] | None = Field(
        None, description="standard uncertainties of intensities, if measured"
    )
    lamp_deg: NotNegative | None = Field(None, description="angular diameter of a lamp, where it was measured")
    residual_px: NotNegative = Field(0.0, description="root mean square residual of the highlights")
    balls: int = Field(0, description="number of balls, or of places of a ball")
    outlines_px: list[Vector] | None = Field(
        None, description="their outlines: x, y from the image centre, y up, and radius"
    )
    level: Positive | None = Field(None, description="mean level of what measured the intensities, of 255")
    level_by: str = Field("", description="what that was: highlights, shading or board")
    pixel_pitch_um: Positive | None = Field(None, description="size of a pixel that positions_mm were measured with")
    size_px: tuple[Side, Side] | None = Field(None, description="height and width of the images")

    @model_validator(mode="after")
    def _one_a_light(self) -> LightsTable:
        if (self.directions is None) == (self.positions_mm is None):
            msg = "needs exactly one of directions, positions_mm"
            raise ValueError(msg)
        count = len(self.directions or self.positions_mm or ())
        for name in (
            "intensities",
            "u_deg",
            "u_own_deg",
            "u_common_deg",
            "u_lens_deg",
            "u_distance_deg",
            "u_positions_mm",
            "u_intensities",
        ):
            values = getattr(self, name)
            if values is not None and len(values) != count:
                msg = f"{name}: must have one entry for each of the {count} lights, got {len(values)}"
                raise ValueError(msg)
        return self


class FlatTable(Strict):
    """The ``[flat]`` table."""

    file: str = Field(description="coefficients of the gain maps, .npz, relative to station.toml")
    sha256: str = Field(description="checksum of that file")
    degree: Annotated[int, Field(ge=0, le=20)] = Field(description="degree of the polynomials")
    size_px: tuple[Side, Side] = Field(description="height and width of the images")
    residual: NotNegative = Field(0.0, description="relative residual of the board's levels")


class ResponseTable(Strict):
    """The ``[response]`` table."""

    levels: list[NotNegative] = Field(description="grey levels, 0 to 1 = full scale")
    radiances: list[NotNegative] = Field(description="their radiances, 1 at full scale")
    u_radiance: NotNegative = Field(0.0, description="standard uncertainty of the radiances, 1 = full scale")
    source: str = Field("", description="how it was measured")

    @model_validator(mode="after")
    def _grows(self) -> ResponseTable:
        least = 2
        if len(self.levels) != len(self.radiances) or len(self.levels) < least:
            msg = (
                f"levels and radiances: must be equally many, 2 or more, got {len(self.levels)} and "
                f"{len(self.radiances)}"
            )
            raise ValueError(msg)
        if min(np.diff(self.levels)) <= 0 or min(np.diff(self.radiances)) <= 0:
            msg = "levels and radiances: must grow from entry to entry"
            raise ValueError(msg)
        return self


class ScaleTable(Strict):
    """The ``[scale]`` table."""

    pixel_pitch_um: Positive = Field(description="size of a pixel on the board")
    pixel_pitch_u_um: Positive = Field(description="its standard uncertainty")
    tilt_deg: Number | None = Field(
        None, description="tilt of the grid against the image plane, if the distance of the camera is known"
    )
    rotation_deg: Number = Field(0.0, description="rotation of the grid in the image")
    distortion: Distortion = Field(
        0.0, description="radial displacement at the corner over its distance from the centre"
    )
    residual_px: NotNegative = Field(0.0, description="root mean square residual of the points of the grid")
    points: int = Field(0, description="number of points of the grid")
    camera_distance_mm: Distance | None = Field(None, description="distance of the camera; inf: telecentric")
    size_px: tuple[Side, Side] | None = Field(None, description="height and width of the images it holds for")


class VerifyTable(Strict):
    """An entry of ``[[verified]]``."""

    quantity: Literal["height", "diameter"] = Field(description="height or diameter")
    captures: int = Field(description="number of inspections of the part")
    balls: int = Field(description="number of balls of known size")
    bias_um: Number = Field(description="mean error")
    u_bias_um: NotNegative | None = Field(None, description="its standard uncertainty, known sizes included")
    slope: Number | None = Field(None, description="change of the error per unit of size")
    u_slope: NotNegative | None = Field(None, description="its standard uncertainty")
    repeatability_um: NotNegative | None = Field(None, description="standard deviation over replacements of the part")
    largest_um: NotNegative = Field(description="largest error of a single reading")
    mpe_um: Positive | None = Field(None, description="maximum permissible error applied")


class FindingTable(Strict):
    """An entry of ``[[findings]]``."""

    severity: Literal["note", "doubt", "fail"]
    message: str
    code: str = ""


class StationFile(Strict):
    """The whole file."""

    format: Literal["bgars-station"] = Field(description='"bgars-station"')
    version: Literal[1] = Field(description="1")
    name: str = Field("station", description="name of the station")
    calibrated_utc: str = Field("", description="time of the last calibration, ISO 8601")
    bgars: str = Field("", description="version that wrote it")
    lights: LightsTable | None = None
    flat: FlatTable | None = None
    response: ResponseTable | None = None
    scale: ScaleTable | None = None
    verified_utc: str = Field("", description="time of the last comparison with a part of known sizes, ISO 8601")
    verified: list[VerifyTable] = Field(default_factory=list, description="how it compared (bgars verify)")
    findings: list[FindingTable] = Field(default_factory=list, description="findings of the calibrations")
