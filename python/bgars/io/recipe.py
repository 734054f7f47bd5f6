"""The capture recipe ``capture.toml``: what it may hold, and clear words for what it may not."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, field_validator, model_validator

from bgars.files.light_formats import MAX_LIGHTS
from bgars.io.strict_toml import Strict, checked, read_values

__all__ = [
    "HIGHEST_RAD",
    "RECIPE_NAME",
    "CameraRecipe",
    "CaptureRecipe",
    "ChannelName",
    "GammaResponse",
    "LightsRecipe",
    "TableResponse",
    "read_recipe",
]

RECIPE_NAME = "capture.toml"

ChannelName = Literal["luminance", "mean", "red", "green", "blue"]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Uncertainty = Annotated[float, Field(gt=0, allow_inf_nan=False, strict=True)]
Vector = tuple[float, float, float]
FileName = Annotated[str, AfterValidator(lambda name: name.replace("\\", "/"))]
"""Relative to the folder of the recipe; Windows writes its paths with backslashes."""
FINEST_PITCH_UM = 0.05
"""Pixels of a quarter of what visible light resolves (0.2 um, E. Abbe): smaller ones are given in another unit."""
HIGHEST_RAD = math.pi / 2
"""Of an elevation in radians. In degrees no rig stands so low: shadows would be 36 times as long as a part is high."""
PITCH_OVER_U = 10.0
"""Least ratio of the pixel pitch to its standard uncertainty: below it the pitch is a guess, or the unit is wrong."""


class GammaResponse(Strict):
    """Camera that encodes ``signal^(1/gamma)``."""

    gamma: Positive

    @field_validator("gamma")
    @classmethod
    def _encodes(cls, value: float) -> float:
        if value < 1.0:
            msg = f"must be at least 1, since the image is signal^(1/gamma): for this exponent write {1.0 / value:.3g}"
            raise ValueError(msg)
        return value


class TableResponse(Strict):
    """Measured response: a CSV of grey level and radiance."""

    table: FileName


class RingRecipe(Strict):
    """Evenly spaced distant lights, counter-clockwise from +x."""

    count: Annotated[int, Field(ge=3, le=MAX_LIGHTS)]
    elevation_deg: Annotated[float, Field(gt=0, lt=90)] = 45.0
    azimuth0_deg: float = 0.0

    @field_validator("elevation_deg")
    @classmethod
    def _in_degrees(cls, value: float) -> float:
        if value <= HIGHEST_RAD:
            msg = f"must be in degrees, and this looks like radians ({math.degrees(value):.3g} degrees)"
            raise ValueError(msg)
        return value


class CameraRecipe(Strict):
    """Camera at a distance; infinite for a telecentric lens."""

    distance_mm: Annotated[float, Field(gt=0, strict=True)]


class PartIdentityTable(Strict):
    """The ``[part]`` table: which part the images show."""

    serial: str = ""
    lot: str = ""
    substrate: str = ""
    position: str = ""
    station: str = ""
    operator: str = ""
    round: Annotated[int, Field(ge=1)] | None = None


class LightsRecipe(Strict):
    """The ``[lights]`` table: exactly one of the first five keys."""

    directions: FileName | list[Vector] | None = None
    angles_deg: FileName | list[tuple[float, float]] | None = None
    positions_mm: FileName | list[Vector] | None = None
    lp: FileName | None = None
    ring: RingRecipe | None = None
    intensities: FileName | list[float] | list[Vector] | None = None
    intensity_distance_mm: Positive | None = None
    u_deg: Uncertainty | list[Uncertainty] | None = None

    @model_validator(mode="after")
    def _one_source(self) -> LightsRecipe:
        sources = ("directions", "angles_deg", "positions_mm", "lp", "ring")
        given = [name for name in sources if getattr(self, name) is not None]
        if len(given) != 1:
            msg = f"needs exactly one of {', '.join(sources)}; got {' and '.join(given) or 'none of them'}"
            raise ValueError(msg)
        if self.intensity_distance_mm is not None and self.positions_mm is None:
            msg = "intensity_distance_mm goes with positions_mm only"
            raise ValueError(msg)
        return self


class CaptureRecipe(Strict):
    """The whole of ``capture.toml``; file names are relative to its folder."""

    pixel_pitch_um: Positive | None = None
    pixel_pitch_u_um: Uncertainty | None = None
    camera: CameraRecipe | None = None
    images: Annotated[list[str], Field(min_length=1)] | str | None = None
    exposures_ms: Annotated[list[Positive], Field(min_length=2)] | None = None
    channel: ChannelName = "luminance"
    dark: FileName | None = None
    mask: FileName | None = None
    response: Literal["linear", "srgb"] | GammaResponse | TableResponse = "linear"
    black_level: Annotated[float, Field(ge=0, allow_inf_nan=False)] = 0.0
    saturation: Positive | None = None
    lights: LightsRecipe | None = None
    part: PartIdentityTable | None = None
    station: str | None = None

    @field_validator("pixel_pitch_um")
    @classmethod
    def _resolvable(cls, value: float | None) -> float | None:
        if value is not None and value < FINEST_PITCH_UM:
            msg = f"must be at least {FINEST_PITCH_UM} um, as light resolves no more; is it in mm?"
            raise ValueError(msg)
        return value

    @field_validator("camera", mode="before")
    @classmethod
    def _telecentric(cls, value: Any) -> Any:  # noqa: ANN401 - whatever the file holds
        if value == "telecentric":
            return {"distance_mm": math.inf}
        if not isinstance(value, dict):
            msg = 'must be "telecentric" or { distance_mm = ... }'
            raise ValueError(msg)
        return value

    @field_validator("response", mode="before")
    @classmethod
    def _named_response(cls, value: Any) -> Any:  # noqa: ANN401 - whatever the file holds
        if isinstance(value, str) and value.lower() in ("linear", "srgb"):
            return value.lower()
        if not isinstance(value, dict):
            msg = 'must be "linear", "srgb", { gamma = 2.2 } or { table = "response.csv" }'
            raise ValueError(msg)
        return value

    @model_validator(mode="after")
    def _bracket_is_named(self) -> CaptureRecipe:
        if self.exposures_ms is None:
            if isinstance(self.images, str):
                msg = "images: must be a list of file names; a pattern goes with exposures_ms"
                raise ValueError(msg)
            return self
        if len(set(self.exposures_ms)) < len(self.exposures_ms):
            msg = f"exposures_ms: must differ from each other, got {self.exposures_ms}"
            raise ValueError(msg)
        if self.images is None:
            msg = 'exposures_ms: needs images, a list or a pattern such as "light_{light}_{exposure}.png"'
            raise ValueError(msg)
        if isinstance(self.images, str) and not (
            "{light" in self.images and ("{exposure" in self.images or "{ms" in self.images)
        ):
            msg = f"images: a pattern must hold {{light}}, and {{exposure}} or {{ms}}, got {self.images!r}"
            raise ValueError(msg)
        return self

    @model_validator(mode="after")
    def _pitch_is_known(self) -> CaptureRecipe:
        if self.pixel_pitch_u_um is None:
            return self
        if self.pixel_pitch_um is None:
            msg = f"pixel_pitch_u_um: goes with pixel_pitch_um only, got {self.pixel_pitch_u_um:g}"
            raise ValueError(msg)
        most_um = self.pixel_pitch_um / PITCH_OVER_U
        if self.pixel_pitch_u_um > most_um and not math.isclose(self.pixel_pitch_u_um, most_um):
            msg = (
                f"pixel_pitch_u_um: must be at most a tenth of pixel_pitch_um ({most_um:g}), "
                f"got {self.pixel_pitch_u_um:g}"
            )
            raise ValueError(msg)
        return self


def read_recipe(path: Path) -> CaptureRecipe:
    """Read and check a recipe.

    Raises
    ------
    FileFormatError
        The file is missing or not TOML.
    InputError
        An unknown key (the nearest known one is named), a wrong type or a value out of range.
    """
    return checked(CaptureRecipe, read_values(path), path)
