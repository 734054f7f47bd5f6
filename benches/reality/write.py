"""A rendered part as a folder: images and recipes (what a method may use), and the truth beside them."""

from __future__ import annotations

import csv
import json
import shutil
import tempfile
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import imageio.v3 as iio
import numpy as np
from camera import Camera, through_jpeg
from lamps import lamp_centroids
from seating import coplanarity

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from rendered import Rendered
    from setup_records import Defect, Part, Setup

BALL_COLUMNS = (
    "id,name,x_mm,y_mm,z_centre_mm,radius_mm,top_height_mm,top_z_mm,board_z_mm,present,defect,"
    "x_nom_mm,y_nom_mm,radius_nom_mm,height_nom_mm"
)
POSITION_LIMIT, DIAMETER_LIMIT, HEIGHT_LIMIT, COPLANARITY_LIMIT = 0.1, 0.08, 0.075, 0.15
"""Limits as shares of diameter, diameter, height, height: some defects break them, the scatter of the process never."""


def write_scene(setup: Setup, rendered: Rendered, folder: Path) -> None:
    """Photograph a part and write its folder, whole or not at all.

    Raises
    ------
    OSError
        Where `folder` exists and holds something.
    """
    folder.parent.mkdir(parents=True, exist_ok=True)
    place = Path(tempfile.mkdtemp(prefix=".writing-", dir=folder.parent))
    try:
        _write_files(setup, rendered, place)
        place.chmod(0o755)
        place.rename(folder)
    except BaseException:
        shutil.rmtree(place)
        raise


def _write_files(setup: Setup, rendered: Rendered, place: Path) -> None:
    name = str(setup.seed)
    camera = Camera(setup, rendered, np.random.default_rng([setup.seed, sum(map(ord, name))]))
    clipped = _write_images(camera, rendered, place)
    nominal = _raised(rendered.nominal, setup.camera.raised_deg)
    _write_capture_recipe(setup, nominal, place)
    limits = part_limits_um(setup.part)
    (place / "part.toml").write_text(part_recipe(name, setup.part, limits), encoding="utf-8")
    _write_pixel_truth(rendered, place)
    _write_balls(setup, rendered, place)
    true = lamp_centroids(setup, rendered.true)
    off = np.rad2deg(2 * np.arcsin(np.linalg.norm(nominal - true, axis=1) / 2))
    part = setup.part
    described = asdict(setup)
    described["part"]["defects"] = {ball: defect_text(defect) for ball, defect in part.defects.items()}
    record = {
        "scene": name,
        "deviations": setup.deviations,
        "width": setup.view.width,
        "height": setup.view.height,
        "pixel_pitch_mm": setup.view.pixel_mm,
        "ball_diameter_mm": part.diameter_mm,
        "pitch_mm": part.pitch_mm,
        "ball_height_mm": part.height_mm,
        "grid_rows_cols": (part.rows, part.cols),
        "setup": described,
        "limits": limits,
        "coplanarity": coplanarity(rendered.balls),
        "true_light_directions": true.tolist(),
        "light_off_deg": off.round(3).tolist(),
        "true_intensities": camera.intensities.round(4).tolist(),
        "lit_board_level": float(camera.lit_board * camera.gain * 255),
        "saturated": clipped,
    }
    (place / "scene.json").write_text(json.dumps(record, indent=1), encoding="utf-8")


def _write_images(camera: Camera, rendered: Rendered, place: Path) -> float:
    """One image a lamp, then the dark frame; the share of clipped pixels on balls."""
    quality, names, clipped = camera.faults.jpeg_quality, [], []

    def save(name: str, image: NDArray[np.uint8]) -> None:
        iio.imwrite(place / name, image if quality is None else through_jpeg(image, quality))

    for lamp in range(len(rendered.radiance)):
        image = camera.photograph(lamp)
        names.append(f"light_{lamp:02d}.png")
        clipped.append(float((image[rendered.ball > 0] >= 255).mean()))
        save(names[-1], image)
    save("dark.png", camera.dark_frame())
    (place / "filenames.txt").write_text("\n".join(names) + "\n", encoding="utf-8")
    return float(np.mean(clipped))


def _raised(directions: NDArray[np.float64], angle_deg: float) -> NDArray[np.float64]:
    """Directions (lamps, 3) as a rig declares them that believes itself higher than it is."""
    if not angle_deg:
        return directions
    elevation = np.arcsin(directions[:, 2]) + np.deg2rad(angle_deg)
    azimuth = np.arctan2(directions[:, 1], directions[:, 0])
    level = np.cos(elevation)
    return np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)], -1)


def _write_capture_recipe(setup: Setup, nominal: NDArray[np.float64], place: Path) -> None:
    np.savetxt(place / "light_directions.txt", nominal, fmt="%.9f")
    np.savetxt(place / "light_intensities.txt", np.ones((len(nominal), 3)), fmt="%.6f")
    lines = [
        f"pixel_pitch_um = {1000 * setup.view.pixel_mm * setup.camera.pitch_factor:.6g}",
        *(['dark = "dark.png"'] if setup.camera.dark_frame else []),
        'response = "linear"',
        "",
        "[lights]",
        'directions = "light_directions.txt"',
        'intensities = "light_intensities.txt"',
        "",
    ]
    (place / "capture.toml").write_text("\n".join(lines), encoding="utf-8")


def part_limits_um(part: Part) -> dict[str, tuple[float, float]]:
    """Limits of the recipe (low, high)."""
    diameter, height = part.diameter_mm * 1000, part.height_mm * 1000
    slack = HEIGHT_LIMIT * part.height_mm * 1e3
    return {
        "true_position_um": (0, POSITION_LIMIT * diameter),
        "diameter_um": (diameter * (1 - DIAMETER_LIMIT), diameter * (1 + DIAMETER_LIMIT)),
        "height_um": (height - slack, height + slack),
        "seating_coplanarity_um": (0, COPLANARITY_LIMIT * height),
    }


def part_recipe(name: str, part: Part, limits: dict[str, tuple[float, float]]) -> str:
    """The text of part.toml."""
    lines = [
        f'name = "{name}"',
        f"rows = {part.rows}",
        f"cols = {part.cols}",
        f"pitch_um = {1000 * part.pitch_mm:.1f}",
        f"depopulated = {json.dumps(part.depopulated)}",
        f"diameter_um = {1000 * part.diameter_mm:.1f}",
        f"height_um = {1000 * part.height_mm:.1f}",
        "",
        "[limits]",
        f"true_position_um = {limits['true_position_um'][1]}",
        *(f"{key} = [{limits[key][0]:.1f}, {limits[key][1]:.1f}]" for key in ("diameter_um", "height_um")),
        f"seating_coplanarity_um = {limits['seating_coplanarity_um'][1]:.1f}",
        "",
    ]
    return "\n".join(lines)


def _write_pixel_truth(rendered: Rendered, place: Path) -> None:
    normals = rendered.normals.astype(np.float64)
    nowhere = np.linalg.norm(normals, axis=-1) < 0.5
    normals[nowhere] = (0, 0, 1)
    np.savez_compressed(
        place / "gt.npz",
        normals=normals.astype(np.float16),
        z=rendered.z_mm.astype(np.float16),
        id=rendered.ball,
        mixed=rendered.mixed | nowhere,
    )


def _write_balls(setup: Setup, rendered: Rendered, place: Path) -> None:
    part = setup.part
    with (place / "balls.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(BALL_COLUMNS.split(","))
        for truth in rendered.balls:
            ball = truth.ball
            height_mm = truth.top_z_mm - ball.board_z_mm
            seen = truth.x_mm, truth.y_mm, ball.centre_z_mm, truth.diameter_mm / 2
            measures = [f"{value:.6f}" for value in (*seen, height_mm, truth.top_z_mm, ball.board_z_mm)]
            nominal = ball.x_nominal_mm, ball.y_nominal_mm, part.diameter_mm / 2, part.height_mm
            places = [f"{value:.6f}" for value in nominal]
            writer.writerow([ball.number, ball.name, *measures, 1, defect_text(ball.defect), *places])


def defect_text(defect: Defect | None) -> str:
    """A defect and its sizes, "none" without."""
    if defect is None:
        return "none"
    return f"{type(defect).__name__.lower()} {json.dumps(asdict(defect))}"
