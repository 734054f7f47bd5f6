"""The capture recipe ``capture.toml``: what it may hold, and clear words for what it may not."""

from __future__ import annotations

import difflib
import sys
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from bgars.errors import FileFormatError, InputError

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

__all__ = [
    "RECIPE_NAME",
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
Vector = tuple[float, float, float]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=False)


class GammaResponse(_Strict):
    """Camera that encodes ``signal^(1/gamma)``."""

    gamma: Positive


class TableResponse(_Strict):
    """Measured response: a CSV of grey level and radiance."""

    table: str


class RingRecipe(_Strict):
    """Evenly spaced distant lights, counter-clockwise from +x."""

    count: Annotated[int, Field(ge=3)]
    elevation_deg: Annotated[float, Field(gt=0, lt=90)] = 45.0
    azimuth0_deg: float = 0.0


class LightsRecipe(_Strict):
    """The ``[lights]`` table: exactly one of the first five keys."""

    directions: str | list[Vector] | None = None
    angles_deg: str | list[tuple[float, float]] | None = None
    positions_mm: str | list[Vector] | None = None
    lp: str | None = None
    ring: RingRecipe | None = None
    intensities: str | list[float] | list[Vector] | None = None
    intensity_distance_mm: Positive | None = None

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


class CaptureRecipe(_Strict):
    """The whole of ``capture.toml``; file names are relative to its folder."""

    pixel_pitch_um: Positive | None = None
    images: Annotated[list[str], Field(min_length=1)] | None = None
    channel: ChannelName = "luminance"
    dark: str | None = None
    mask: str | None = None
    response: Literal["linear"] | GammaResponse | TableResponse = "linear"
    black_level: Annotated[float, Field(ge=0, allow_inf_nan=False)] = 0.0
    saturation: Positive | None = None
    lights: LightsRecipe | None = None


def read_recipe(path: Path) -> CaptureRecipe:
    """Read and check a recipe.

    Raises
    ------
    FileFormatError
        The file is missing or not TOML.
    InputError
        An unknown key (the nearest known one is named), a wrong type or a value out of range.
    """
    try:
        with path.open("rb") as stream:
            values = tomllib.load(stream)
    except OSError as error:
        msg = f"{path}: cannot be read ({error.strerror})"
        raise FileFormatError(msg) from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        msg = f"{path}: is not valid TOML ({error})"
        raise FileFormatError(msg) from error
    try:
        return CaptureRecipe.model_validate(values)
    except ValidationError as error:
        raise InputError(_explain(path, error)) from None


def _explain(path: Path, error: ValidationError) -> str:
    """One line for the first mistake, unknown keys first: they are usually the cause of the others."""
    details = sorted(error.errors(include_url=False), key=lambda detail: detail["type"] != "extra_forbidden")
    first = details[0]
    # pydantic puts the branch of a union it tried into the location: those are no keys of the file.
    keys = [str(part) for part in first["loc"] if not _is_branch(part)]
    key = ".".join(keys)
    if first["type"] == "extra_forbidden":
        known = _known_keys(first["loc"][:-1])
        nearest = difflib.get_close_matches(keys[-1], known, n=1, cutoff=0.0)
        hint = f"; the nearest known key is '{nearest[0]}'" if nearest else ""
        return f"{path}: unknown key '{key}'{hint} (known: {', '.join(known)})"
    reason = first["msg"].removeprefix("Value error, ")
    value = "" if isinstance(first["input"], dict) else f", got {first['input']!r}"
    return f"{path}: {key or 'recipe'}: {reason}{value}"


def _is_branch(part: str | int) -> bool:
    return isinstance(part, str) and (part in {"GammaResponse", "TableResponse", "str"} or "[" in part)


def _known_keys(location: tuple[int | str, ...]) -> list[str]:
    model: type[BaseModel] = CaptureRecipe
    nested: dict[Any, type[BaseModel]] = {
        "lights": LightsRecipe,
        "ring": RingRecipe,
        "GammaResponse": GammaResponse,
        "TableResponse": TableResponse,
    }
    for part in location:
        model = nested.get(part, model)
    if model in {GammaResponse, TableResponse}:
        return ["gamma", "table"]
    return list(model.model_fields)
