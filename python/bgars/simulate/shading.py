"""The reflectance of a facet (Cook & Torrance 1982), as a signal in fractions of full scale."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from bgars.simulate.material import Material
    from bgars.simulate.solids import Array, Points

__all__ = ["Finish", "masking_term", "microfacets", "reflected"]


@dataclass(frozen=True)
class Finish:
    """Factors on a material, sample by sample: ball-to-ball variation, albedo texture."""

    i_d: Array | float = 1.0
    i_s: Array | float = 1.0
    roughness: Array | float = 1.0


def microfacets(distribution: str, cosine: Array, roughness: Array | float) -> Array:
    """D / D_0: density of facets tilted by the angle a from the surface, 1 at a = 0.

    beckmann ``exp(-tan^2 a / m^2) / cos^4 a`` (Cook & Torrance 1982, eq. 14 ff.), gaussian ``exp(-(a / m)^2)`` (same
    paper, after Blinn 1977), ggx ``1 / (cos^4 a (1 + tan^2 a / m^2)^2)`` (Walter et al. 2007, eq. 33).
    """
    square = np.minimum(cosine * cosine, 1.0)
    slope = (1.0 - square) / (square * roughness * roughness)
    if distribution == "beckmann":
        return np.asarray(np.exp(-slope) / (square * square))
    if distribution == "ggx":
        base = square * (1.0 + slope)
        return np.asarray(1.0 / (base * base))
    angle = np.arctan(np.sqrt((1.0 - square) / square)) / roughness
    return np.asarray(np.exp(-angle * angle))


def masking_term(
    masking: str, distribution: str, n_h: Array, n_l: Array, n_v: Array, v_h: Array, roughness: Array | float
) -> Array:
    """G: the part of the facets that neither the light nor the camera misses behind others."""
    if masking == "none":
        return np.ones_like(n_v)
    if masking == "cook-torrance":  # Cook & Torrance 1982, eq. 14
        return np.minimum(1.0, 2.0 * n_h / v_h * np.minimum(n_v, n_l))
    one_side: Callable[[Array, Array | float], Array] = _smith_ggx if distribution == "ggx" else _smith_beckmann
    return one_side(n_l, roughness) * one_side(n_v, roughness)


def _smith_beckmann(cosine: Array, roughness: Array | float) -> Array:
    """Smith's masking for Beckmann (Walter et al. 2007, eq. 27 with its rational approximation)."""
    tangent = np.sqrt(np.maximum(1.0 - cosine * cosine, 0.0)) / cosine
    a = 1.0 / np.maximum(roughness * tangent, 1e-12)
    rational = (3.535 * a + 2.181 * a * a) / (1.0 + 2.276 * a + 2.577 * a * a)
    # The rational function overshoots 1 by 6e-5 just before a = 1.6, where it ends.
    return np.where(a < 1.6, np.minimum(rational, 1.0), 1.0)  # noqa: PLR2004 - Walter et al. 2007, eq. 27


def _smith_ggx(cosine: Array, roughness: Array | float) -> Array:
    """Smith's masking for GGX (Walter et al. 2007, eq. 34)."""
    tangent_square = np.maximum(1.0 - cosine * cosine, 0.0) / (cosine * cosine)
    return np.asarray(2.0 / (1.0 + np.sqrt(1.0 + roughness * roughness * tangent_square)))


def reflected(material: Material, finish: Finish, normal: Points, toward: Points) -> Array:
    """Signal for irradiance 1 of facets that the light reaches; V = (0, 0, 1).

    Parameters
    ----------
    material : Material
        Albedo and lobes.
    finish : Finish
        Factors of the samples.
    normal, toward : Points
        Unit normals, unit vectors to the light; 1-D arrays that broadcast.

    Returns
    -------
    (K,) float64
        ``I_d N.L + sum_j I_s,j (D_j / D_j,0) G F / (N.V)``; 0 where ``N.L <= 0``.
    """
    n_l = normal.x * toward.x + normal.y * toward.y + normal.z * toward.z
    signal = material.i_d * finish.i_d * n_l
    faces = n_l > 0.0
    if material.lobes:
        n_v = normal.z
        n_l = np.where(faces, n_l, 1.0)
        v_h = np.sqrt((1.0 + toward.z) / 2.0)
        n_h = (n_l + n_v) / (2.0 * v_h)
        mirror = _schlick(material.f0, v_h) if material.fresnel == "schlick" else 1.0
        for lobe in material.lobes:
            roughness = lobe.roughness * finish.roughness
            glossy = microfacets(lobe.distribution, n_h, roughness)
            glossy = glossy * masking_term(material.masking, lobe.distribution, n_h, n_l, n_v, v_h, roughness) / n_v
            signal = signal + lobe.i_s * finish.i_s * mirror * glossy
    return np.where(faces, signal, 0.0)


def _schlick(f0: float, cosine: Array) -> Array:
    """F(V.H) / F(1) (Schlick 1994, eq. 15)."""
    return np.asarray((f0 + (1.0 - f0) * (1.0 - cosine) ** 5) / f0)
