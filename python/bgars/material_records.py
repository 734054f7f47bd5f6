"""Records of a surface's material, as the reflectance estimator fits it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

from bgars.errors import InputError

__all__ = ["ReflectanceFit", "SurfaceLobe", "SurfaceMaterial", "loss_in_words"]

MAX_LOBES = 2
VERY_WELL = 0.1
WELL = 0.5
"""Losses below which a material explains its balls very well, and well."""


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
        0 for Beckmann's distribution, 1 for GGX, between for between.
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
    """What a surface does with light, under the lights of one rig.

    Level of a pixel in grey levels of 255 at light intensity 1:
    ``gain (diffuse n.l [1 + grazing (A - 1)] + sum strength D G / n_z) + ambient`` (docs/method.md).

    Attributes
    ----------
    diffuse_level : float
        Level of a matt facet that faces the light.
    grazing : float
        Weight of the loss of diffuse light at grazing angles; 0 for a Lambertian facet.
    ambient_level : float
        Level without light from the lamps: inter-reflections, on the average.
    lobes : tuple of SurfaceLobe
        One or two.
    masking : {"smith", "cook-torrance"}
        Geometric attenuation of the lobes.
    gains : tuple of float
        Brightness of each light against what the rig says.
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


@dataclass(frozen=True)
class ReflectanceFit:
    """What the reflectance estimator learnt on its way.

    Attributes
    ----------
    material : SurfaceMaterial
        The material of all balls.
    loss : float
        How badly the material alone explains the balls: mean over pixels and lights of ``log(1 + (r / 3)^2)``, r the
        residual in grey levels (compressed where bright). Below 0.1 very well, above 2 not at all.
    accepted : bool
        False where the fit was too bad to be used.
    circles_px : tuple of (float, float, float)
        The anchors: x and y (origin at the image centre, y up) and radius.
    own_material : tuple of bool
        Balls that were given a material of their own.
    residuals_learnt : bool
        Whether each ball was corrected by what the others show beyond the material: inter-reflections.
    deviation_deg : tuple of float
        Root mean square angle of each ball's normals to its circle's sphere, the errors of the normals taken off.
    flat_radius : tuple of (float or None)
        Radius of each ball's flat top in its radii; None where it has none.
    shape : {"sphere", "cap", "ellipsoid"}
        What the balls have in common: half a ball over its circle; a cap lower than half a ball; an ellipsoid.
    shape_ratio : float
        Radius of the circle over that of the cap's sphere; height of the ellipsoid over its radius; 1 for spheres.
    u_shape_ratio : float
        Its standard uncertainty; the standard errors of the normals hold it.
    refusal : str
        Why the fit was not accepted.
    """

    material: SurfaceMaterial
    loss: float
    accepted: bool
    circles_px: tuple[tuple[float, float, float], ...]
    own_material: tuple[bool, ...]
    residuals_learnt: bool
    deviation_deg: tuple[float, ...]
    flat_radius: tuple[float | None, ...]
    shape: Literal["sphere", "cap", "ellipsoid"] = "sphere"
    shape_ratio: float = 1.0
    u_shape_ratio: float = 0.0
    refusal: str = ""

    @property
    def shape_in_words(self) -> str:
        """The shape for messages; empty for spheres."""
        if self.shape == "cap":
            return f", which are caps of spheres of {1.0 / self.shape_ratio:.2f} times their circles' radii"
        if self.shape == "ellipsoid":
            return f", which are {self.shape_ratio:.2f} times as high as half balls"
        return ""


def loss_in_words(loss: float, *, accepted: bool) -> str:
    """How well a material explains the balls it was fitted on, for every place that tells it.

    `ReflectanceFit.loss` 0.1 is a residual of 1 grey level, 0.5 of 2.4 levels, 2 of 7.6 levels, as if all were alike.
    """
    if not accepted:
        return "badly: not usable"
    if loss < VERY_WELL:
        return "very well"
    return "well" if loss < WELL else "roughly: expect larger errors, and read each normal's standard error"
