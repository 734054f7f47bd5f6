"""Inspect open scenes and measure simulated captures; rewrite a part of docs/accuracy.md, or print lines of scenes.

Scenes go the whole way: balls are found, normals estimated, shadows measured. Balls of simulated captures, which tell
whether uncertainties are right, start from their true circles, half a pixel off in the centre and 1 % in the radius.
Commands: ``make inspection`` for the page, ``BGARS_DATA=... python docs/make_inspection_accuracy.py SCENE`` for a line.
"""

from __future__ import annotations

import csv
import json
import os
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import bgars
import numpy as np
from bgars.inspection import measure_balls
from bgars.records.found_balls import FoundBall, FoundBalls
from bgars.records.measured_balls import BallMeasurement
from bgars.simulate.coplanarity import seating_plane
from numpy.typing import NDArray

PAGE = Path(__file__).parent / "accuracy.md"
START, END = "<!-- tables: docs/make_inspection_accuracy.py -->", "<!-- end of inspection tables -->"
ROUGH_PX, ROUGH_SHARE = 0.5, 0.01
SCENES = [
    "A_one_ball_diffuse",
    "C_grid_4x4_paper",
    "C_grid_4x4_paper/16bit",
    "C2_grid_4x4_gamma",
    "D_grid_5x5_defects",
    "D2_grid_5x5_defects_bow",
    "E_grid_5x5_metal",
    "E_grid_5x5_metal/16bit",
    "F_grid_6x6_near",
    "G_grid_10x10_large",
    "H_bridge",
    "K1_two_lobe",
    "K1_two_lobe/16bit",
    "K2_ball_variation",
    "K2_ball_variation/16bit",
    "K3_realistic",
    "K3_realistic/16bit",
    "K4_single_material_low_diffuse",
    "K4_single_material_low_diffuse/16bit",
]
SEEDS = 3
SETTINGS = {
    "45 degrees": {},
    "45 degrees, rig 1 degree off": {"rig_off_deg": 1.0},
    "30 degrees": {"elevation_deg": 30.0},
    "60 degrees, rig 0.5 degrees off": {"elevation_deg": 60.0, "rig_off_deg": 0.5},
    "20 um per pixel": {"pitch_um": 20.0},
    "lens blur 1 px": {"blur_px": 1.0},
    "bowed board": {"bow_um": 20.0},
    "four lights": {"lights": 4},
}
NAMES = ("x_um", "y_um", "diameter_um", "centre_z_um", "top_um")


def rough(name: str, x_px: float, y_px: float, radius_px: float, random: np.random.Generator) -> FoundBall:
    """Give the circle that a rough finder would give."""
    off = random.standard_normal(3)
    return FoundBall(
        name,
        None,
        None,
        x_px + ROUGH_PX * off[0],
        y_px + ROUGH_PX * off[1],
        radius_px * (1.0 + ROUGH_SHARE * off[2]),
        ROUGH_PX,
        ROUGH_SHARE * radius_px,
    )


def found(balls: list[FoundBall], bridges: tuple[tuple[str, str], ...] = ()) -> FoundBalls:
    """Wrap circles as the finder does."""
    return FoundBalls(tuple(balls), (), bridges, 1, 1, None, 0.0, (0.0, 0.0))


class Case(NamedTuple):
    """A measured scene and its truth."""

    measured: BallMeasurement
    rows: list[dict[str, str]]
    present: int
    lights_deg: float
    seconds: float
    pitch_um: float


def measure_scene(folder: Path) -> Case:
    """Find and measure the balls of one scene."""
    capture = bgars.read_capture(folder)
    pitch_um = float(capture.pixel_pitch_um or 1.0)
    top = folder if (folder / "balls.csv").exists() else folder.parent
    with (top / "balls.csv").open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["present"] == "1"]
    scene = json.loads((top / "scene.json").read_text(encoding="utf-8"))
    start = time.process_time()
    circles = bgars.find_balls(capture)
    field = bgars.estimate_normals(capture, anchors=circles)
    measured = measure_balls(capture, circles, field=field)
    seconds = time.process_time() - start
    by_name = {ball.name: ball for ball in measured.balls}
    expected = [row for row in rows if row["name"] in by_name]
    measured = replace(measured, balls=tuple(by_name[row["name"]] for row in expected))
    lights = np.array((scene.get("truth") or {}).get("light_directions", capture.rig.directions))
    angles = np.degrees(np.arccos(np.clip((measured.light_directions * lights).sum(axis=1), -1.0, 1.0)))
    return Case(measured, expected, len(rows), float(angles.max()), seconds, pitch_um)


def coplanarity_error_um(case: Case, known: NDArray[np.bool_]) -> float | None:
    """Measured minus true seating coplanarity over the balls that were measured."""
    places = np.array([(ball.x_um, ball.y_um, ball.top_um) for ball in case.measured.balls])
    x, y = places[:, 0], places[:, 1]
    ground = np.column_stack([np.ones(len(x)), x, y, x * x, x * y, y * y]) @ case.measured.board_coefficients_um
    apexes = np.column_stack([x, y, places[:, 2] + ground])[known]
    truth = np.array([[1000.0 * float(row[key]) for key in ("x_mm", "y_mm", "top_z_mm")] for row in case.rows])[known]
    gravity = truth[:, :2].mean(axis=0)
    planes = seating_plane(apexes, gravity), seating_plane(truth, gravity)
    return planes[0].coplanarity_um - planes[1].coplanarity_um if planes[0] and planes[1] else None


def scene_row(name: str, case: Case) -> str:
    """One line of the table of scenes."""
    true = {
        key: np.array([1000.0 * float(row[key]) for row in case.rows])
        for key in ("x_mm", "y_mm", "radius_mm", "top_height_mm")
    }
    seen = {key: np.array([getattr(ball, key) for ball in case.measured.balls]) for key in (*NAMES, "u_top_um")}
    known = np.isfinite(seen["top_um"])
    plain = known & np.array([row["shape"] == "sphere" for row in case.rows])
    centre = np.concatenate([(seen["x_um"] - true["x_mm"])[plain], (seen["y_um"] - true["y_mm"])[plain]])
    radius = (seen["diameter_um"] / 2.0 - true["radius_mm"])[plain]
    top = (seen["top_um"] - true["top_height_mm"])[plain]
    coplanarity = coplanarity_error_um(case, known)
    flats = [
        f"{ball.name} {ball.flat_top_depth_um:.0f} +- {ball.u_flat_top_depth_um:.0f}"
        for ball in case.measured.balls
        if _flat(ball)
    ]
    cells = [
        name,
        f"{known.sum()} of {case.present}",
        f"{case.pitch_um:g}",
        f"{np.sqrt(np.mean(centre**2)):.2f}",
        f"{radius.mean():+.2f} / {radius.std():.2f}",
        f"{top.mean():+.2f} / {top.std():.2f}",
        f"{1.4826 * np.median(np.abs(top - np.median(top))):.2f}",
        f"{np.median(seen['u_top_um'][plain]):.2f}",
        "-" if coplanarity is None else f"{coplanarity:+.2f}",
        f"{case.lights_deg:.3f}",
        ", ".join(flats) or "-",
        f"{case.seconds:.1f}",
    ]
    return f"| {' | '.join('-' if 'nan' in cell else cell for cell in cells)} |"


def _flat(ball: bgars.records.measured_balls.MeasuredBall) -> bool:
    return any("flat top" in reason for reason in ball.reasons)


def simulate(
    seed: int,
    *,
    elevation_deg: float = 45.0,
    rig_off_deg: float = 0.0,
    pitch_um: float = 12.0,
    blur_px: float = 0.0,
    bow_um: float = 0.0,
    lights: int = 8,
) -> tuple[BallMeasurement, bgars.SimulatedTruth]:
    """Simulate a part of 30 balls on a textured board, and measure it."""
    texture = bgars.Texture(0.25)
    board = bgars.Board(bgars.Material.matte(0.12), bow_um=bow_um, bow_radius_um=3000.0, texture=texture)
    jitter = bgars.Jitter(height_um=8.0, radius_um=3.0, position_um=5.0)
    scene = bgars.Scene.ball_array(5, 6, rotation_deg=0.3, jitter=jitter, seed=seed, board=board)
    rig = bgars.LightRig.ring(lights, elevation_deg=elevation_deg)
    camera = bgars.Camera(
        pixel_pitch_um=pitch_um, supersample=4, full_well_e=15000.0, read_noise_levels=0.15, blur_px=blur_px
    )
    capture, truth = bgars.simulate(scene, rig, bgars.Material(i_d=0.5, i_s=1.0, hardness=40), camera, seed=seed)
    random = np.random.default_rng(seed)
    turn = random.uniform(0.0, 2.0 * np.pi, lights)
    across, up = rig_off_deg * np.cos(turn) / np.cos(np.radians(elevation_deg)), rig_off_deg * np.sin(turn)
    nominal = bgars.LightRig.from_angles(np.column_stack([rig.azimuths_deg + across, rig.elevations_deg + up]))
    balls = [
        rough(ball.name, ball.x_um / pitch_um, ball.y_um / pitch_um, ball.diameter_um / 2.0 / pitch_um, random)
        for ball in truth.balls
        if ball.x_um is not None and ball.y_um is not None and ball.diameter_um is not None
    ]
    circles = found(balls)

    def normals() -> bgars.NormalField:
        return bgars.estimate_normals(replace(capture, rig=nominal), anchors=circles)

    return measure_balls(replace(capture, rig=nominal), circles, ball_field=normals), truth


def coverage_row(name: str, setting: dict[str, float], totals: dict[str, list[bool]]) -> str:
    """One line of the table of simulated captures: RMS error, uncertainty, share of errors within it."""
    errors: dict[str, list[float]] = {key: [] for key in NAMES}
    uncertainties: dict[str, list[float]] = {key: [] for key in NAMES}
    for seed in range(SEEDS):
        measured, truth = simulate(1000 + seed, **setting)  # type: ignore[arg-type]
        for key in NAMES:
            errors[key] += [getattr(a, key) - getattr(b, key) for a, b in zip(measured.balls, truth.balls, strict=True)]
            uncertainties[key] += [getattr(ball, f"u_{key}") for ball in measured.balls]
    cells = [name, str(len(errors["x_um"]))]
    for key in NAMES:
        error, u = np.array(errors[key]), np.array(uncertainties[key])
        hits = np.abs(error) < u
        totals[key] += hits.tolist()
        cells.append(f"{np.sqrt(np.mean(error**2)):.2f} / {np.median(u):.2f} / {100 * hits.mean():.0f} %")
    return f"| {' | '.join(cells)} |"


def tables(data: Path) -> list[str]:
    """All lines between the marks."""
    lines = [
        "| scene | balls | pitch (um) | centre, each axis: RMS | radius: bias / sigma | top: bias / sigma "
        "| robust sigma | u(top) | seating coplanarity: error | lights: worst (deg) "
        "| flat tops (truth: K3 C5, 60) | CPU (s) |",
        "| --- |" + " ---: |" * 11,
    ]
    for name in SCENES:
        lines.append(scene_row(name, measure_scene(data / "scenes" / name)))
        sys.stderr.write(f"{name}\n")
    totals: dict[str, list[bool]] = {key: [] for key in NAMES}
    lines += [
        "",
        "| simulated | balls | x | y | diameter | height of the centre | top |",
        "| --- |" + " ---: |" * 6,
    ]
    for name, setting in SETTINGS.items():
        lines.append(coverage_row(name, setting, totals))
        sys.stderr.write(f"{name}\n")
    shares = [f"{100 * np.mean(totals[key]):.0f} %" for key in NAMES]
    lines.append(f"| **all: share within u** | {len(totals['x_um'])} | {' | '.join(shares)} |")
    return lines


def main() -> None:
    """Rewrite the part of the page between the marks, or print the lines of the scenes that are named."""
    for name in sys.argv[1:]:
        print(scene_row(name, measure_scene(Path(os.environ["BGARS_DATA"]) / "scenes" / name)))  # noqa: T201
    if sys.argv[1:]:
        return
    head, rest = PAGE.read_text(encoding="utf-8").split(START)
    tail = rest.split(END)[1]
    body = "\n".join(tables(Path(os.environ["BGARS_DATA"])))
    PAGE.write_text(f"{head}{START}\n\n{body}\n\n{END}{tail}", encoding="utf-8")


if __name__ == "__main__":
    main()
