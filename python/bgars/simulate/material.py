"""What a surface reflects: diffuse light and one or two specular lobes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from bgars.simulate.checks import at_least, fraction, one_of, positive, require

__all__ = ["Distribution", "Lobe", "Material", "Variation", "roughness_from_hardness"]

Distribution = Literal["beckmann", "gaussian", "ggx"]
Masking = Literal["cook-torrance", "smith", "none"]
DISTRIBUTIONS = ("beckmann", "gaussian", "ggx")
MASKINGS = ("cook-torrance", "smith", "none")
DEFAULT_HARDNESS = 40.0


def roughness_from_hardness(hardness: float) -> float:
    """Roughness m of a Phong-like exponent h: ``m = sqrt(2 / (h + 2))`` (Walter et al. 2007, section 5.2).

    Raises
    ------
    InputError
        `hardness` is not above 0.

    Examples
    --------
    >>> round(roughness_from_hardness(40.0), 4)
    0.2182
    """
    positive("hardness", hardness)
    return math.sqrt(2.0 / (hardness + 2.0))


@dataclass(frozen=True)
class Lobe:
    """One specular lobe.

    Attributes
    ----------
    i_s : float
        Strength: the signal that a facet adds where it mirrors the light into the camera, as a fraction of full scale,
        for ``N.V = 1`` and no masking.
    roughness : float
        Root mean square slope m of the microfacets.
    distribution : {"beckmann", "gaussian", "ggx"}
        Distribution of the microfacets' normals.

    Raises
    ------
    InputError
        A negative strength, a roughness outside (0, 2], an unknown distribution.
    """

    i_s: float
    roughness: float
    distribution: Distribution = "beckmann"

    def __post_init__(self) -> None:
        at_least("material.i_s", self.i_s, 0.0)
        _check_roughness("material.roughness", self.roughness)
        one_of("material.distribution", self.distribution, DISTRIBUTIONS)


@dataclass(frozen=True)
class Variation:
    """Relative standard deviations from ball to ball, normal, cut off at 2.5 sigma.

    Attributes
    ----------
    i_d, i_s, roughness : float
        Of the diffuse albedo, of the lobes' strengths (one factor for both), of the lobes' roughnesses.
    """

    i_d: float = 0.0
    i_s: float = 0.0
    roughness: float = 0.0

    def __post_init__(self) -> None:
        for name in ("i_d", "i_s", "roughness"):
            value = getattr(self, name)
            at_least(f"material.variation.{name}", value, 0.0)
            require(value <= 0.3, f"material.variation.{name}", "must be 0.3 or less", value)  # noqa: PLR2004 - 2.5 sigma stays above 0


@dataclass(frozen=True)
class Material:
    """Diffuse albedo and specular lobes of balls, bridges or board.

    The signal of a facet, as a fraction of full scale, is (Cook & Torrance 1982, eqs. 1 and 14; the paper's eq. of I_k)

    ``E [ I_d max(0, N.L) + sum_j I_s,j (D_j / D_j,0) G F / (N.V) ]``,

    with E the light's irradiance, D_0 the distribution's value for a facet that mirrors the light into the camera, and
    no light at all where ``N.L <= 0``.

    Attributes
    ----------
    i_d : float
        Diffuse albedo times exposure, in [0, 1]: the signal of a facet that faces the light.
    i_s : float
        Strength of the first lobe, see :class:`Lobe`.
    hardness : float or None
        Phong-like exponent h of the first lobe; 40 where neither hardness nor roughness is given.
    roughness : float or None
        Roughness m of the first lobe instead, ``m = sqrt(2 / (h + 2))``.
    distribution : {"beckmann", "gaussian", "ggx"}
        Of the first lobe.
    second_lobe : Lobe or None
        A second lobe, such as the broad base of a worn surface.
    masking : {"cook-torrance", "smith", "none"}
        G: V-cavities (Cook & Torrance 1982, eq. 14), Smith's term (Walter et al. 2007, eqs. 23, 27, 34; the gaussian
        uses Beckmann's), or 1.
    fresnel : {"off", "schlick"}
        Off folds the reflectance into `i_s`; Schlick (1994, eq. 15) multiplies by ``F(V.H) / f0``.
    f0 : float
        Reflectance at normal incidence, used by Schlick only; 0.8 is about tin.
    variation : Variation
        Ball to ball.

    Raises
    ------
    InputError
        A value out of range, or both hardness and roughness.

    Examples
    --------
    >>> Material(i_d=0.5, i_s=1.0, hardness=40).lobes[0].roughness.__round__(4)
    0.2182
    >>> Material(i_d=-0.1)
    Traceback (most recent call last):
    bgars.errors.InputError: material.i_d: must lie in [0, 1], got -0.1
    """

    i_d: float = 0.5
    i_s: float = 1.0
    hardness: float | None = None
    roughness: float | None = None
    distribution: Distribution = "beckmann"
    second_lobe: Lobe | None = None
    masking: Masking = "cook-torrance"
    fresnel: Literal["off", "schlick"] = "off"
    f0: float = 0.8
    variation: Variation = Variation()

    def __post_init__(self) -> None:
        fraction("material.i_d", self.i_d)
        at_least("material.i_s", self.i_s, 0.0)
        both = self.hardness is not None and self.roughness is not None
        require(not both, "material.roughness", "must not be given together with hardness", self.roughness)
        if self.hardness is not None:
            positive("material.hardness", self.hardness)
        if self.roughness is not None:
            _check_roughness("material.roughness", self.roughness)
        one_of("material.distribution", self.distribution, DISTRIBUTIONS)
        one_of("material.masking", self.masking, MASKINGS)
        one_of("material.fresnel", self.fresnel, ("off", "schlick"))
        positive("material.f0", self.f0)
        fraction("material.f0", self.f0)

    @classmethod
    def matte(cls, i_d: float) -> Material:
        """A Lambertian surface."""
        return cls(i_d=i_d, i_s=0.0)

    @property
    def lobes(self) -> tuple[Lobe, ...]:
        """The lobes of strength above 0."""
        roughness = self.roughness
        if roughness is None:
            roughness = roughness_from_hardness(DEFAULT_HARDNESS if self.hardness is None else self.hardness)
        first = Lobe(self.i_s, roughness, self.distribution)
        return tuple(lobe for lobe in (first, self.second_lobe) if lobe is not None and lobe.i_s > 0)


def _check_roughness(name: str, value: float) -> None:
    positive(name, value)
    require(value <= 2, name, "must be 2 or less", value)  # noqa: PLR2004 - broader than any diffuse lobe
