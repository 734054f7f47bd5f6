"""The material of a surface: a diffuse part and lobes."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

from bgars.errors import InputError

__all__ = ["SurfaceLobe", "SurfaceMaterial"]

MAX_LOBES = 2


@dataclass(frozen=True)
class SurfaceLobe:
    """One specular lobe.

    Attributes
    ----------
    strength_level : float
        Grey levels of 255 at its peak, where the camera looks along the normal and the light's intensity is 1.
    roughness : float
        Root mean square slope of the microfacets.
    tail : float
        0 for Beckmann's distribution, 1 for GGX; values between interpolate.
    """

    strength_level: float
    roughness: float
    tail: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.strength_level) and self.strength_level >= 0):
            msg = f"lobe.strength_level: must be finite and at least 0 (grey levels of 255), got {self.strength_level}"
            raise InputError(msg)
        if not 0 < self.roughness <= 1:
            msg = f"lobe.roughness: must be above 0 and at most 1, got {self.roughness}"
            raise InputError(msg)
        if not 0 <= self.tail <= 1:
            msg = f"lobe.tail: must be from 0 (Beckmann) to 1 (GGX), got {self.tail}"
            raise InputError(msg)


@dataclass(frozen=True)
class SurfaceMaterial:
    """Reflectance of a surface, under the lights of one rig.

    Level of a pixel in grey levels of 255 at light intensity 1:
    ``gain (diffuse n.l [1 + grazing (A - 1)] + sum strength D G / n_z) + ambient`` (docs/method.md).

    Attributes
    ----------
    diffuse_level : float
        Level of a matt facet that faces the light.
    grazing : float
        Weight of the loss of diffuse light at grazing angles; 0 for a Lambertian facet.
    ambient_level : float
        Level without light from the lamps: mean interreflection.
    lobes : tuple of SurfaceLobe
        One or two.
    masking : {"smith", "cook-torrance"}
        Geometric attenuation of the lobes.
    gains : tuple of float
        Brightness of each light relative to the rig.
    standard_errors : dict
        Of ``diffuse``, ``grazing``, ``ambient``, ``strength_1``, ... as far as they were fitted.
    """

    diffuse_level: float
    grazing: float
    ambient_level: float
    lobes: tuple[SurfaceLobe, ...]
    masking: Literal["smith", "cook-torrance"]
    gains: tuple[float, ...]
    standard_errors: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not (math.isfinite(self.diffuse_level) and self.diffuse_level >= 0):
            msg = f"diffuse_level: must be finite and at least 0 (grey levels of 255), got {self.diffuse_level}"
            raise InputError(msg)
        for name, value in (("grazing", self.grazing), ("ambient_level", self.ambient_level)):
            if not math.isfinite(value):
                msg = f"{name}: must be finite, got {value}"
                raise InputError(msg)
        if not 1 <= len(self.lobes) <= MAX_LOBES:
            msg = f"lobes: must be one or two, got {len(self.lobes)}"
            raise InputError(msg)
        if self.masking not in {"smith", "cook-torrance"}:
            msg = f"masking: must be smith or cook-torrance, got {self.masking!r}"
            raise InputError(msg)
        for index, gain in enumerate(self.gains):
            if not (math.isfinite(gain) and gain > 0):
                msg = f"gains[{index}]: must be finite and above 0, got {gain}"
                raise InputError(msg)
