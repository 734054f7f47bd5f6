"""What the reflectance estimator learnt about a material."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from bgars.records.short import Short
from bgars.records.surface_material import SurfaceMaterial

__all__ = ["ReflectanceFit", "loss_in_words"]

VERY_WELL = 0.1
WELL = 0.5
"""Losses below which a material explains its balls very well, and well."""


@dataclass(frozen=True, repr=False)
class ReflectanceFit(Short):
    """What the reflectance estimator fitted.

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
        Whether each ball was corrected by what the others show beyond the material: interreflections.
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

    def _facts(self) -> dict[str, object]:
        facts = {"balls": len(self.circles_px), "shape": repr(self.shape), "loss": f"{self.loss:.4g}"}
        return facts | ({"accepted": True} if self.accepted else {"refusal": repr(self.refusal)})

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
