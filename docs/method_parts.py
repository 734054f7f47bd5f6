"""What the pictures of the method share: simulated parts, the material's equation, normals of circles."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import NamedTuple

import bgars
import numpy as np
from bgars.records.surface_material import SurfaceLobe, SurfaceMaterial
from numpy.typing import NDArray

FOLDER = Path(__file__).parent / "images" / "method"
Floats = NDArray[np.float64]
PAINT = bgars.Material(i_d=0.5, i_s=1.0, hardness=40)
METAL = bgars.Material(i_d=0.0, i_s=1.0, hardness=40)
NOISY = bgars.Camera(supersample=2, full_well_e=20_000.0, read_noise_levels=0.3)
BOARD = bgars.Board(material=bgars.Material.matte(0.12))
RIG = bgars.LightRig.ring(8)
GREY_LEVELS = 255.0


def say(*values: object) -> None:
    """Print the numbers behind a picture."""
    sys.stdout.write(" ".join(f"{value:.3f}" if isinstance(value, float) else str(value) for value in values) + "\n")


class Part(NamedTuple):
    """A simulated part with its estimate."""

    capture: bgars.Capture
    truth: bgars.SimulatedTruth
    field: bgars.NormalField

    def error_deg(self) -> Floats:
        """(H, W) angle between estimate and truth on balls; NaN elsewhere."""
        error: Floats = np.where(
            self.truth.mask, bgars.angular_error_deg(self.field.normals, self.truth.normals), np.nan
        )
        return error


def made(scene: bgars.Scene, material: bgars.Material, camera: bgars.Camera = NOISY) -> Part:
    """Simulate and estimate with the default method."""
    capture, truth = bgars.simulate(scene, RIG, material, camera)
    return Part(capture, truth, bgars.estimate_normals(capture))


def levels(material: SurfaceMaterial, normals: Floats, directions: Floats) -> Floats:
    """(..., L) grey levels of normals (..., 3) under lights (L, 3): the equation of docs/reflectance.md."""
    half = directions + np.array([0.0, 0.0, 1.0])
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    n_v = np.maximum(normals[..., 2:], 0.02)
    n_l, n_h, v_h = normals @ directions.T, normals @ half.T, half[:, 2]
    lit = np.maximum(n_l, 0.0)
    ashikhmin = 1.35 * (1 - (1 - lit / 2) ** 5) * (1 - (1 - n_v / 2) ** 5)
    total = material.diffuse_level * lit * (1 + material.grazing * (ashikhmin - 1))
    for lobe in material.lobes:
        cos2 = np.clip(n_h, 1e-3, 1.0) ** 2
        t = (1 / cos2 - 1) / lobe.roughness**2
        tail = max(lobe.tail, 1e-4)
        peak = np.exp(-(1 + 1 / tail) * np.log1p(tail * t)) / cos2**2
        if material.masking == "smith":
            g = _smith(lobe, n_v) * _smith(lobe, np.maximum(n_l, 1e-6))
        else:
            g = np.minimum(1.0, 2 * n_h / v_h * np.minimum(n_v, n_l))
        total = total + np.where(n_l > 0, lobe.strength_level * peak * g / n_v, 0.0)
    return np.asarray(material.gains) * total + material.ambient_level


def _smith(lobe: SurfaceLobe, cos: Floats) -> Floats:
    slope = np.maximum(lobe.roughness * np.sqrt(np.maximum(1 - cos**2, 0)) / cos, 1e-9)
    c = 1 / slope
    beckmann = np.where(c < 1.6, (3.535 * c + 2.181 * c**2) / (1 + 2.276 * c + 2.577 * c**2), 1.0)  # noqa: PLR2004
    ggx = 2 / (1 + np.sqrt(1 + slope**2))
    result: Floats = beckmann + lobe.tail * (ggx - beckmann)
    return result


def bent(level: Floats) -> Floats:
    """Return the scale on which levels are compared."""
    result: Floats = np.arcsinh(0.03 * level) / 0.03
    return result


def circle_normals(shape: tuple[int, ...], circle: tuple[float, float, float]) -> tuple[Floats, NDArray[np.bool_]]:
    """(H, W, 3) normals that a silhouette circle gives, and (H, W) where."""
    height, width = shape
    x = (np.arange(width) + 0.5 - width / 2 - circle[0])[None, :] / circle[2]
    y = (height / 2 - np.arange(height) - 0.5 - circle[1])[:, None] / circle[2]
    x, y = np.broadcast_arrays(x, y)
    squared = x**2 + y**2
    return np.stack([x, y, np.sqrt(np.maximum(1 - squared, 0))], axis=-1), squared < 1
