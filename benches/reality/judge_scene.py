"""Inspect one rendered part and lay the result beside its truth."""

from __future__ import annotations

import csv
import json
import math
import os
import time
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import bgars
import numpy as np
from records import READINGS, BallRecord, NormalsRecord, Reading, SceneRecord

if TYPE_CHECKING:
    from numpy.typing import NDArray

DEFAULT: Final = "reflectance"
SIMPLE: Final = ("lambertian", "specular-filter", "robust-filter")
JUDGED_N_Z = 0.3
"""Normals are judged where the surface leans no further (z component)."""
WITHIN_2 = 2.45
"""Radius, in standard deviations, that holds 95 % of a two-dimensional normal distribution."""


def judge_scene(folder: Path, *, normals: bool = True) -> SceneRecord:
    """Inspect a scene; whatever it raises is kept in the record."""
    scene = json.loads((folder / "scene.json").read_text(encoding="utf-8"))
    record: dict[str, Any] = {
        "scene": folder.name,
        "deviations": tuple(scene["deviations"]),
        "pixel_um": 1000 * scene["pixel_pitch_mm"],
    }
    start = time.monotonic()
    try:
        capture = bgars.read_capture(folder)
        if normals:
            record["normals"] = _judge_normals(capture, folder)
        start = time.monotonic()
        with warnings.catch_warnings():
            # Kept in the result, too.
            warnings.simplefilter("ignore", bgars.CaptureWarning)
            result = bgars.inspect(capture, folder / "part.toml")
        record |= _beside_truth(result, scene, folder)
    except (bgars.InputError, bgars.CalibrationError) as error:
        record["refused"] = _said(error, folder)
    except (KeyboardInterrupt, SystemExit):
        raise
    except BaseException as error:  # A panic of the core is no Exception.
        record["crashed"] = _said(error, folder)
    return SceneRecord(**record, seconds=round(time.monotonic() - start, 1))


def _said(error: BaseException, folder: Path) -> str:
    """Kind and text of an exception, without the place of the scene."""
    return f"{type(error).__name__}: {error}".replace(f"{folder}{os.sep}", "")


def _beside_truth(result: bgars.PartResult, scene: dict[str, Any], folder: Path) -> dict[str, Any]:
    with (folder / "balls.csv").open(encoding="utf-8") as file:
        truths = list(csv.DictReader(file))
    limits, seen = scene["limits"], {ball.name: ball for ball in result.balls}
    balls = tuple(
        _ball_record(truth, offset_um, limits, seen.get(truth["name"]))
        for truth, offset_um in zip(truths, true_positions_um(truths), strict=True)
    )
    true_um = 1e3 * scene["coplanarity"]["seating_max_dev_mm"]
    return {
        "verdict": result.verdict,
        "reasons": tuple(result.reasons),
        "warnings": tuple(result.warnings),
        "balls": balls,
        "invented": tuple(sorted({ball.name for ball in result.balls if ball.present} - {t["name"] for t in truths})),
        "coplanarity": _reading(result.seating_coplanarity_um, true_um, result.u_seating_coplanarity_um),
        "part_bad": any(ball.bad for ball in balls) or true_um > limits["seating_coplanarity_um"][1],
    }


def true_positions_um(truths: list[dict[str, str]]) -> NDArray[np.float64]:
    """Distances (n,) of the true centres from the grid, fitted to them (turned and moved) as a recipe wants."""
    places, grid = (
        1e3 * np.array([[float(row[x]), float(row[y])] for row in truths])
        for x, y in (("x_mm", "y_mm"), ("x_nom_mm", "y_nom_mm"))
    )
    places, grid = places - places.mean(0), grid - grid.mean(0)
    turn = np.arctan2((grid[:, 0] * places[:, 1] - grid[:, 1] * places[:, 0]).sum(), (grid * places).sum())
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    return np.asarray(np.linalg.norm(places - grid @ rotation.T, axis=1))


def _ball_record(
    truth: dict[str, str], offset_um: float, limits: dict[str, tuple[float, float]], seen: bgars.BallResult | None
) -> BallRecord:
    true_um = {
        "x": 1e3 * float(truth["x_mm"]),
        "y": 1e3 * float(truth["y_mm"]),
        "diameter": 2e3 * float(truth["radius_mm"]),
        "top": 1e3 * float(truth["top_height_mm"]),
    }
    judged = {"height_um": true_um["top"], "diameter_um": true_um["diameter"], "true_position_um": offset_um}
    bad = not all(limits[name][0] <= value <= limits[name][1] for name, value in judged.items())
    common = truth["name"], truth["defect"], bad
    if seen is None:
        return BallRecord(*common, present=False, verdict=None)
    readings: dict[str, Reading] = {}
    for name in READINGS if seen.present else ():
        reading = _reading(getattr(seen, f"{name}_um"), true_um[name], getattr(seen, f"u_{name}_um"))
        if reading:
            readings[name] = reading
    return BallRecord(*common, seen.present, seen.verdict, tuple(seen.reasons), readings)


def _reading(value: float | None, true: float, u: float | None) -> Reading | None:
    """A reading beside its truth; None where nothing was measured."""
    if value is None or not math.isfinite(value):
        return None
    return Reading(float(value - true), float(u) if u is not None and math.isfinite(u) else None)


def _judge_normals(capture: bgars.Capture, folder: Path) -> dict[str, NormalsRecord]:
    with np.load(folder / "gt.npz") as kept:
        true = kept["normals"].astype(float)
        on_balls = (kept["id"] > 0) & ~kept["mixed"]
    true /= np.linalg.norm(true, axis=-1, keepdims=True)
    on_balls &= true[..., 2] > JUDGED_N_Z
    records = {}
    for method in (*SIMPLE, DEFAULT):
        try:
            field = bgars.estimate_normals(capture, method=method)
        except bgars.BgarsError as error:
            records[method] = NormalsRecord(error=f"{type(error).__name__}: {error}")
            continue
        records[method] = _normals_record(field, true, on_balls, stated=method == DEFAULT)
    return records


def _normals_record(
    field: Any,  # noqa: ANN401 - what a method states beside its normals differs
    true: NDArray[np.float64],
    on_balls: NDArray[np.bool_],
    *,
    stated: bool,
) -> NormalsRecord:
    """Errors over the true pixels of balls; where nothing was found, a normal straight up is taken."""
    normals = np.nan_to_num(np.asarray(field.normals, float))
    length = np.linalg.norm(normals, axis=-1, keepdims=True)
    normals = np.where(length > 1e-9, normals / np.maximum(length, 1e-12), (0, 0, 1.0))
    error_deg = np.degrees(np.arccos(np.clip((normals * true).sum(-1), -1, 1)))
    mean_deg = float(error_deg[on_balls].mean())
    if not stated or getattr(field, "is_measured", None) is None:
        return NormalsRecord(mean_deg)
    measured = on_balls & np.asarray(field.is_measured)
    share = float(measured.sum() / on_balls.sum())
    if not measured.any():
        return NormalsRecord(mean_deg, share)
    error_deg, stated_deg = error_deg[measured], np.asarray(field.standard_error_deg, float)[measured]
    within_1, within_2 = (float((error_deg <= factor * stated_deg).mean()) for factor in (1.0, WITHIN_2))
    return NormalsRecord(mean_deg, share, within_1, within_2)
