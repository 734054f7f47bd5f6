"""A plain numpy twin of the material model: what it renders, the compiled estimator explains without a residual."""

from __future__ import annotations

from typing import TYPE_CHECKING

import bgars
import numpy as np
import pytest

if TYPE_CHECKING:
    from numpy.typing import NDArray

RADIUS_PX = 24.0
SIZE_PX = 52
ELEVATIONS_DEG = (35.0, 60.0)


def distribution(cos_half: NDArray[np.float64], lobe: bgars.SurfaceLobe) -> NDArray[np.float64]:
    """1 at its peak; Beckmann (Cook and Torrance 1982, eq. 4) to GGX (Walter et al. 2007, eq. 33)."""
    tan2 = 1.0 / cos_half**2 - 1.0
    t = tan2 / lobe.roughness**2
    if lobe.tail == 0.0:
        return np.exp(-t) / cos_half**4
    return (1.0 + lobe.tail * t) ** -(1.0 + 1.0 / lobe.tail) / cos_half**4


def smith_g1(cos: NDArray[np.float64], lobe: bgars.SurfaceLobe) -> NDArray[np.float64]:
    """Walter et al. 2007: GGX by eq. 34, Beckmann by the rational form below eq. 27; between by the tail."""
    slope = lobe.roughness * np.sqrt(1.0 - cos**2) / cos
    ggx = 2.0 / (1.0 + np.sqrt(1.0 + slope**2))
    c = 1.0 / np.maximum(slope, 1e-12)
    rational = (3.535 * c + 2.181 * c**2) / (1.0 + 2.276 * c + 2.577 * c**2)
    return (1.0 - lobe.tail) * np.where(c < 1.6, rational, 1.0) + lobe.tail * ggx


def masking(n_l, n_v, n_h, v_h, lobe: bgars.SurfaceLobe, kind: str) -> NDArray[np.float64]:  # type: ignore[no-untyped-def] # noqa: ANN001
    if kind == "smith":
        return smith_g1(n_v, lobe) * smith_g1(n_l, lobe)
    return np.minimum(1.0, np.minimum(2.0 * n_h * n_v / v_h, 2.0 * n_h * n_l / v_h))


def rendered(
    material: bgars.SurfaceMaterial, normals: NDArray[np.float64], lights: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(L, N) grey levels of 255 of (N, 3) facets under (L, 3) distant lights; nothing is clipped."""
    levels = np.zeros((len(lights), len(normals)))
    view = np.array([0.0, 0.0, 1.0])
    for light, (direction, gain) in enumerate(zip(lights, material.gains, strict=True)):
        half = (direction + view) / np.linalg.norm(direction + view)
        n_l, n_v, n_h, v_h = normals @ direction, normals[:, 2], normals @ half, float(view @ half)
        lit = n_l > 0
        n_l, n_v, n_h = n_l[lit], n_v[lit], n_h[lit]
        # Ashikhmin and Shirley 2000, eq. 5, relative to Lambert.
        grazing = 1.35 * (1.0 - (1.0 - n_l / 2.0) ** 5) * (1.0 - (1.0 - n_v / 2.0) ** 5)
        sum_of_parts = material.diffuse_level * n_l * (1.0 + material.grazing * (grazing - 1.0))
        for lobe in material.lobes:
            attenuation = masking(n_l, n_v, n_h, v_h, lobe, material.masking) / n_v
            sum_of_parts += lobe.strength_level * distribution(n_h, lobe) * attenuation
        levels[light, lit] = gain * sum_of_parts
    return levels + material.ambient_level


def sphere(
    material: bgars.SurfaceMaterial, lights: NDArray[np.float64]
) -> tuple[NDArray[np.float32], NDArray[np.bool_], NDArray[np.float64]]:
    """Images (L, H, W) of a sphere at the image centre, its silhouette, its normals (N, 3)."""
    y, x = (SIZE_PX / 2 - np.mgrid[:SIZE_PX, :SIZE_PX] - 0.5) * [[[1.0]], [[-1.0]]] / RADIUS_PX
    inside = x**2 + y**2 < 1.0
    normals = np.column_stack([x[inside], y[inside], np.sqrt(1.0 - x[inside] ** 2 - y[inside] ** 2)])
    images = np.zeros((len(lights), SIZE_PX, SIZE_PX), np.float32)
    images[:, inside] = np.minimum(rendered(material, normals, lights), 255.0)
    return images, inside, normals


MATERIALS = {
    "Beckmann, Cook-Torrance": ((bgars.SurfaceLobe(255.0, 0.22, 0.0),), "cook-torrance", 0.0, 0.0),
    "Beckmann, Smith": ((bgars.SurfaceLobe(255.0, 0.3, 0.0),), "smith", 0.0, 0.0),
    "GGX, Smith": ((bgars.SurfaceLobe(200.0, 0.2, 1.0),), "smith", 0.0, 3.0),
    "between both": ((bgars.SurfaceLobe(300.0, 0.15, 0.4),), "smith", 0.0, 0.0),
    "grazing": ((bgars.SurfaceLobe(120.0, 0.2, 0.0),), "cook-torrance", 0.8, 0.0),
    "two lobes": ((bgars.SurfaceLobe(220.0, 0.1, 0.2), bgars.SurfaceLobe(40.0, 0.4, 0.9)), "smith", 0.3, 1.0),
}


def material_of(name: str) -> bgars.SurfaceMaterial:
    lobes, kind, grazing, ambient = MATERIALS[name]
    gains = (1.0, 1.03, 0.98, 1.0, 0.96, 1.0, 1.02, 1.0)
    return bgars.SurfaceMaterial(100.0, grazing, ambient, lobes, kind, gains)  # type: ignore[arg-type]


@pytest.mark.parametrize("elevation_deg", ELEVATIONS_DEG)
@pytest.mark.parametrize("name", MATERIALS)
def test_what_the_twin_renders_the_estimator_explains(name: str, elevation_deg: float) -> None:
    material = material_of(name)
    lights = bgars.LightRig.ring(8, elevation_deg=elevation_deg, azimuth0_deg=7.0).directions
    images, inside, normals = sphere(material, lights)
    circle = [[0.0, 0.0, RADIUS_PX]]
    field = bgars.estimate_normals(images, lights, saturation=255.0, anchors=circle, material=material)
    assert field.reflectance is not None
    # Half a grey level everywhere would be 0.02, the float32 of the images is 1e-11.
    assert field.reflectance.loss < 1e-6
    error_deg = bgars.angular_error_deg(field.normals[inside], normals.astype(np.float32))
    assert error_deg[normals[:, 2] > 0.3].mean() < 0.05


@pytest.mark.parametrize("name", MATERIALS)
def test_the_twin_of_a_fitted_material_renders_what_was_seen(name: str) -> None:
    material = material_of(name)
    lights = bgars.LightRig.ring(8).directions
    images, inside, normals = sphere(material, lights)
    field = bgars.estimate_normals(images, lights, saturation=255.0, anchors=[[0.0, 0.0, RADIUS_PX]])
    assert field.reflectance is not None
    assert field.reflectance.loss < 1e-3
    known = normals[:, 2] > 0.2
    predicted = np.minimum(rendered(field.reflectance.material, normals[known], lights), 255.0)
    seen = images[:, inside][:, known]
    assert np.abs(predicted - seen).mean() < 0.2
    assert np.percentile(np.abs(predicted - seen), 99) < 2.0


@pytest.mark.parametrize("name", ["Beckmann, Smith", "GGX, Smith", "between both"])
def test_the_fit_finds_the_parameters_that_the_twin_rendered_with(name: str) -> None:
    material = material_of(name)
    lights = bgars.LightRig.ring(8).directions
    images, _, _ = sphere(material, lights)
    field = bgars.estimate_normals(images, lights, saturation=255.0, anchors=[[0.0, 0.0, RADIUS_PX]])
    assert field.reflectance is not None
    fitted = field.reflectance.material
    assert field.reflectance.loss < 1e-3
    assert fitted.masking == material.masking
    # A common factor of all gains is one of diffuse light and strength too; the prior holds it near 1.
    scale = float(np.mean(fitted.gains) / np.mean(material.gains))
    assert scale == pytest.approx(1.0, abs=0.02)
    np.testing.assert_allclose(np.array(fitted.gains) / scale, material.gains, atol=0.005)
    assert fitted.diffuse_level * scale == pytest.approx(material.diffuse_level, rel=0.02)
    assert fitted.grazing == pytest.approx(material.grazing, abs=0.03)
    assert fitted.ambient_level == pytest.approx(material.ambient_level, abs=0.3)
    assert len(fitted.lobes) == 1
    assert fitted.lobes[0].roughness == pytest.approx(material.lobes[0].roughness, rel=0.02)
    assert fitted.lobes[0].tail == pytest.approx(material.lobes[0].tail, abs=0.05)
    assert fitted.lobes[0].strength_level * scale == pytest.approx(material.lobes[0].strength_level, rel=0.03)
