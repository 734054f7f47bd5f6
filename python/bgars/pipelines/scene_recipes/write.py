"""A simulated capture as a folder that `bgars.read_capture` reads, its truth beside it."""

from __future__ import annotations

import csv
import json
import math
from dataclasses import asdict, fields
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import imageio.v3 as iio
import numpy as np

from bgars.errors import InputError
from bgars.files.csv_cells import harmless
from bgars.io.atomic import atomic_folder
from bgars.io.given_paths import capture_marks
from bgars.pipelines.scene_recipes.dump import ALBEDO_MAP, setup_values
from bgars.simulate import BallTruth

if TYPE_CHECKING:
    from collections.abc import Callable
    from os import PathLike

    from bgars.records.capture import Capture
    from bgars.simulate import PlaneTruth, SimulatedTruth

__all__ = ["write_simulation", "write_simulation_of"]

RESPONSE_TABLE = "response.csv"
LIT_TYPES = ((8, np.uint8), (16, np.uint16), (32, np.uint32), (64, np.uint64))


def write_simulation(capture: Capture, truth: SimulatedTruth, folder: str | PathLike[str]) -> list[str]:
    """Write a simulated capture and its truth, all files or none.

    ``light_00.png`` ... and ``capture.toml`` are what :func:`bgars.read_capture` reads; ``gt.npz`` is what
    :func:`bgars.read_truth` and ``bgars evaluate`` read (normals, id, z in mm, lit: bit k = light k);
    ``balls.csv`` and ``truth.json`` hold the ball table and the coplanarity; ``scene.json`` is the recipe that makes
    the same bits again (:func:`bgars.read_scene`).

    Parameters
    ----------
    capture, truth : Capture, SimulatedTruth
        From :func:`bgars.simulate`.
    folder : path
        Made if missing; must not hold a capture. Other files of it stay.

    Returns
    -------
    list of str
        The files written.

    Raises
    ------
    FileFormatError
        The folder cannot be written.
    InputError
        More than 64 lights, or a folder that holds a capture already.
    """
    return write_simulation_of(lambda: (capture, truth), folder)[0]


def write_simulation_of(
    run: Callable[[], tuple[Capture, SimulatedTruth]], folder: str | PathLike[str]
) -> tuple[list[str], SimulatedTruth]:
    """Like :func:`write_simulation`, but try the folder before the work of `run`, so that none is lost."""
    found = capture_marks(Path(folder))
    if found:
        msg = (
            f"{folder}: holds a capture already ({', '.join(found)}): two would be mixed; "
            "name another folder, or remove that one"
        )
        raise InputError(msg)
    with atomic_folder(folder) as place:
        capture, truth = run()
        lights = len(capture.rig)
        if lights > LIT_TYPES[-1][0]:
            msg = f"rig: must have {LIT_TYPES[-1][0]} lights or fewer to be written, got {lights}"
            raise InputError(msg)
        digits = max(len(str(lights - 1)), 2)
        names = [f"light_{light:0{digits}d}.png" for light in range(lights)]
        for name, image in zip(names, capture.images, strict=True):
            iio.imwrite(place / name, image)
        _write_text(place / "capture.toml", _capture_toml(capture, truth, names))
        _write_truth(place / "gt.npz", truth)
        _write_balls(place / "balls.csv", truth.balls)
        _write_json(place / "truth.json", _truth_values(truth))
        _write_json(place / "scene.json", setup_values(truth.setup, version("bgars")))
        albedo_map = truth.setup.scene.board.albedo_map
        if albedo_map is not None:
            np.save(place / ALBEDO_MAP, albedo_map)
        table = truth.setup.camera.response_table
        if table is not None:
            rows = "".join(f"{level!r},{radiance!r}\n" for level, radiance in table)
            _write_text(place / RESPONSE_TABLE, f"grey_level,radiance\n{rows}")
        return sorted(path.name for path in place.iterdir()), truth


def _capture_toml(capture: Capture, truth: SimulatedTruth, names: list[str]) -> str:
    camera, rig = truth.setup.camera, capture.rig
    response = '"linear"'
    if camera.response_table is not None:
        response = f'{{ table = "{RESPONSE_TABLE}" }}'
    elif camera.gamma != 1.0:
        response = f"{{ gamma = {camera.gamma!r} }}"
    intensities = rig.intensities
    lines = [
        f"pixel_pitch_um = {float(camera.pixel_pitch_um)!r}",
        *_declared(capture),
        f"images = {json.dumps(names)}",
        f"response = {response}",
        f"black_level = {float(capture.black_level)!r}",
        f"saturation = {float(capture.saturation)!r}",
        "",
        "[lights]",
    ]
    if rig.positions_um is None or rig.intensity_distance_um is None:
        lines.append(f"directions = {json.dumps(rig.directions.tolist())}")
    else:
        # One distance for all lights: E = I (d0 / d)^2 is the same with I' = I (d0 / d0')^2.
        distance_um = float(rig.intensity_distance_um[0])
        intensities = intensities * (rig.intensity_distance_um / distance_um) ** 2
        lines.append(f"positions_mm = {json.dumps((rig.positions_um / 1000.0).tolist())}")
        lines.append(f"intensity_distance_mm = {distance_um / 1000.0!r}")
    lines.append(f"intensities = {json.dumps(intensities.tolist())}")
    if rig.u_deg is not None:
        lines.append(f"u_deg = {json.dumps(rig.u_deg.tolist())}")
    return "\n".join(lines) + "\n"


def _declared(capture: Capture) -> list[str]:
    """What a capture states of its scale and camera."""
    lines = []
    if capture.pixel_pitch_u_um is not None:
        lines.append(f"pixel_pitch_u_um = {float(capture.pixel_pitch_u_um)!r}")
    distance_mm = capture.camera_distance_mm
    if distance_mm is not None:
        camera = '"telecentric"' if math.isinf(distance_mm) else f"{{ distance_mm = {float(distance_mm)!r} }}"
        lines.append(f"camera = {camera}")
    return lines


def _write_truth(path: Path, truth: SimulatedTruth) -> None:
    lights = len(truth.lit)
    kind = next(kind for bits, kind in LIT_TYPES if lights <= bits)
    lit = np.zeros(truth.lit.shape[1:], dtype=kind)
    for light, mask in enumerate(truth.lit):
        lit |= mask.astype(kind) << kind(light)
    z_mm = truth.height_px * np.float32(truth.setup.camera.pixel_pitch_um / 1000.0)
    np.savez_compressed(path, normals=truth.normals, id=np.asarray(truth.ball_ids), z=z_mm, lit=lit)


def _write_balls(path: Path, balls: tuple[BallTruth, ...]) -> None:
    with path.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.DictWriter(stream, [field.name for field in fields(BallTruth)], lineterminator="\n")
        writer.writeheader()
        writer.writerows(asdict(ball) | {"name": harmless(ball.name)} for ball in balls)


def _truth_values(truth: SimulatedTruth) -> dict[str, Any]:
    names = [ball.name for ball in truth.balls if ball.present]
    return {
        **truth.summary(),
        "seating_plane": _plane_values(truth.seating, names),
        "regression_plane": _plane_values(truth.regression, names),
        "ball_table": [asdict(ball) for ball in truth.balls],
    }


def _plane_values(plane: PlaneTruth | None, names: list[str]) -> dict[str, Any] | None:
    if plane is None:
        return None
    return {
        "a": plane.a,
        "b": plane.b,
        "c_um": plane.c_um,
        "balls": [names[index] for index in plane.balls],
        "coplanarity_um": plane.coplanarity_um,
    }


def _plain(value: object) -> object:
    """A number of numpy as one of Python."""
    if isinstance(value, np.generic):
        return value.item()
    msg = f"{type(value).__name__} is not a value of a recipe"
    raise TypeError(msg)


def _write_json(path: Path, values: dict[str, Any]) -> None:
    _write_text(path, json.dumps(values, indent=2, allow_nan=False, default=_plain) + "\n")


def _write_text(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")
