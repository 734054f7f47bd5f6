"""The scene in Mitsuba's words: solder, cameras, board, balls, fibres, one light that is moved."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from atlas import DIFFUSE, ROUGHNESS, WEIGHT, material_atlas
from ball_mesh import mesh_balls
from balls import BallTruth, place_balls, smooth_board_mm
from board_material import bitmap, board_material, board_side_mm
from ply import Mesh, write_ply
from relief import Relief

if TYPE_CHECKING:
    from pathlib import Path
    from types import ModuleType

    from numpy.typing import NDArray
    from setup_records import Lobe, Setup, Solder

SAMPLES = 8
"""Samples a pixel that the film is set up for; each render says its own."""
SLOPE_STEP_MM = 1e-5
TELECENTRIC_MM = 5
"""Where the telecentric camera stands: anywhere above the balls."""
SOLDER_ETA, SOLDER_K = 1.5, 5.2
"""Complex refractive index of tin, visible light."""
FIBRE_POINTS, FIBRE_HALF_MM = 24, 0.45


class RenderScene:
    """A part, ready to be rendered: truth of its balls, and Mitsuba's scene with and without fibres of dust."""

    def __init__(self, mitsuba: ModuleType, setup: Setup, folder: Path) -> None:
        self.mitsuba, self.setup = mitsuba, setup
        self.balls = place_balls(setup)
        self.relief = Relief(setup, self.balls) if setup.board.relief else None
        meshes = folder / "board.ply", folder / "balls.ply"
        write_ply(self._board_mesh(), meshes[0])
        mesh, self.truths = mesh_balls(self.balls, setup.part.squash)
        write_ply(mesh, meshes[1])
        described = self._describe(*meshes)
        self.clean = mitsuba.load_dict({**described, **_light_and_integrator()})
        self.whole = self.clean
        if setup.board.fibres:
            path = folder / "fibres.txt"
            path.write_text(fibre_text(setup, self.truths), encoding="utf-8")
            fibres = {"type": "bsplinecurve", "filename": str(path), "bsdf": {"type": "diffuse", "reflectance": 0.5}}
            self.whole = mitsuba.load_dict({**described, "fibre": fibres, **_light_and_integrator()})

    def ground_mm(self, x_mm: NDArray[np.float64], y_mm: NDArray[np.float64]) -> NDArray[np.float64]:
        """Height of the board with its relief."""
        smooth = smooth_board_mm(self.setup, x_mm, y_mm)
        return smooth + self.relief(x_mm, y_mm) if self.relief else smooth

    def _board_mesh(self) -> Mesh:
        side_mm, step = board_side_mm(self.setup), SLOPE_STEP_MM
        axis = np.linspace(-1.01237 * side_mm, 1.01237 * side_mm, 1601 if self.relief else 257)
        x, y = np.meshgrid(axis, axis)
        slope_x = (self.ground_mm(x + step, y) - self.ground_mm(x - step, y)) / (2 * step)
        slope_y = (self.ground_mm(x, y + step) - self.ground_mm(x, y - step)) / (2 * step)
        normals = np.stack([-slope_x, -slope_y, np.ones_like(x)], -1).reshape(-1, 3)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        count = len(axis)
        row, col = np.meshgrid(np.arange(count - 1), np.arange(count - 1), indexing="ij")
        corner = (row * count + col).ravel()
        faces = np.vstack(
            [
                np.stack([corner, corner + 1, corner + count], -1),
                np.stack([corner + 1, corner + count + 1, corner + count], -1),
            ]
        )
        places = np.stack([x + side_mm, y + side_mm], -1).reshape(-1, 2) / (2 * side_mm)
        return Mesh(np.stack([x, y, self.ground_mm(x, y)], -1).reshape(-1, 3), normals, places, faces)

    def _describe(self, board: Path, balls: Path) -> dict[str, Any]:
        solder = _solder(self.mitsuba, self.setup.solder, material_atlas(self.setup, self.balls))
        sensor = self._sensor()
        film = sensor["film"]
        half = {**film, "width": film["width"] // 2, "height": film["height"] // 2}
        return {
            "type": "scene",
            "solder": solder,
            "sensor": sensor,
            "sensor_half": {**sensor, "film": half},  # Light between balls and board is smooth.
            "board": {
                "type": "ply",
                "filename": str(board),
                "bsdf": board_material(self.mitsuba, self.setup, self.balls),
            },
            "balls": {"type": "ply", "filename": str(balls), "bsdf": {"type": "ref", "id": "solder"}},
        }

    def _sensor(self) -> dict[str, Any]:
        view, transform = self.setup.view, self.mitsuba.ScalarTransform4f
        film = {
            "type": "hdrfilm",
            "width": view.width,
            "height": view.height,
            "pixel_format": "luminance",
            "component_format": "float32",
            "rfilter": {"type": "box"},
        }
        half_mm = view.width * view.pixel_mm / 2
        common = {"film": film, "sampler": {"type": "multijitter", "sample_count": SAMPLES}}
        distance_mm = view.distance_mm or TELECENTRIC_MM
        look = transform().look_at(origin=[0, 0, distance_mm], target=[0, 0, 0], up=[0, 1, 0])
        if view.distance_mm:
            fov_deg = float(2 * np.degrees(np.arctan(half_mm / view.distance_mm)))
            clip = {"near_clip": 0.5, "far_clip": 1000.0}
            return {"type": "perspective", "fov_axis": "x", "fov": fov_deg, **clip, "to_world": look, **common}
        scaled = look @ transform().scale([half_mm, half_mm, 1])
        return {"type": "orthographic", "near_clip": 0.1, "far_clip": 100.0, "to_world": scaled, **common}

    def set_light(self, direction: NDArray[np.float64]) -> None:
        """Move the light: meshes and textures need not be read again."""
        towards = [float(value) for value in direction]
        up = [0, 1, 0] if abs(towards[1]) < 0.9 else [1, 0, 0]
        parameters = self.mitsuba.traverse(self.whole)
        parameters["light.to_world"] = self.mitsuba.Transform4f().look_at(
            origin=[0, 0, 0], target=[-value for value in towards], up=up
        )
        parameters["light.irradiance.value"] = 1.0
        parameters.update()


def _light_and_integrator() -> dict[str, Any]:
    return {
        "light": {"type": "directional", "direction": [0, 0, -1.0], "irradiance": 1.0},
        "integrator": {"type": "path", "max_depth": 2},
    }


def _solder(mitsuba: ModuleType, solder: Solder, atlas: NDArray[np.float32]) -> dict[str, Any]:
    def texture(base: float, layer: int, low: float, high: float) -> dict[str, Any]:
        return bitmap(mitsuba, np.clip(base * atlas[layer], low, high), wrap_mode="clamp")

    def lobe(one: Lobe) -> dict[str, Any]:
        alpha = texture(one.roughness, ROUGHNESS, 0.03, 0.9)
        common = {"type": "roughconductor", "distribution": one.distribution}
        return {**common, "alpha": alpha, "eta": SOLDER_ETA, "k": SOLDER_K}

    first, second = solder.lobes
    return {
        "type": "blendbsdf",
        "weight": texture(solder.metallic_weight, WEIGHT, 0.0, 0.99),
        "a": {"type": "diffuse", "reflectance": texture(solder.diffuse, DIFFUSE, 0.0, 0.99)},
        "b": {"type": "blendbsdf", "weight": second.share, "a": lobe(first), "b": lobe(second)},
        "id": "solder",
    }


def fibre_text(setup: Setup, truths: list[BallTruth]) -> str:
    """Dust fibres of 10 to 20 um, draped over balls and board: points and radii of curves in Mitsuba's format."""
    random = np.random.default_rng([setup.seed, 77])
    lines = []
    for _ in range(setup.board.fibres):
        ball = truths[random.integers(len(truths))].ball
        angle, bend, radius = random.uniform(0, 2 * np.pi), random.uniform(-0.5, 0.5), random.uniform(0.005, 0.010)
        cos, sin = np.cos(angle), np.sin(angle)
        off = random.uniform(-0.6, 0.6) * ball.radius_mm
        for along in np.linspace(-FIBRE_HALF_MM, FIBRE_HALF_MM, FIBRE_POINTS):
            side = off + bend * along * along
            x, y = ball.x_mm + along * cos - side * sin, ball.y_mm + along * sin + side * cos
            z = float(smooth_board_mm(setup, x, y))
            for other in (truth.ball for truth in truths):
                gone = (x - other.x_mm) ** 2 + (y - other.y_mm) ** 2
                if gone < other.radius_mm**2:
                    z = max(z, other.centre_z_mm + np.sqrt(other.radius_mm**2 - gone))
            lines.append(f"{x:.5f} {y:.5f} {z + radius:.5f} {radius:.5f}")
        lines.append("")
    return "\n".join(lines)
