"""Measure bilateral integration and anchors on open maps and scenes; rewrite a part of docs/accuracy.md.

Commands: ``make bilateral`` for the page and its pictures,
``BGARS_DATA=... python docs/make_bilateral.py NAME`` for the lines of a map or a scene.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path

import bgars
import numpy as np
from bgars import _bgars
from bilateral_pictures import draw_cliff, draw_profile
from numpy.typing import NDArray
from PIL import Image

PAGE = Path(__file__).parent / "accuracy.md"
PICTURES = Path(__file__).parent / "images" / "method"
START, END = "<!-- tables: make bilateral -->", "<!-- end of bilateral tables -->"
PUBLISHED_MM = {"bear": 0.334, "cat": 0.074, "goblet": 9.018, "harvest": 1.838, "pot1": 0.636}
SCENES = ("C_grid_4x4_paper", "D_grid_5x5_defects", "H_bridge")
PICTURED = "C_grid_4x4_paper"
JUDGED_N_Z = 0.3


def read_map(folder: Path) -> tuple[NDArray[np.float32], NDArray[np.bool_], bgars.Pinhole]:
    """Normals, mask and camera of a DiLiGenT map."""
    codes, bits = _bgars.read_color(folder / "normal_map.png", 100.0)
    normals = codes[..., :3].astype(np.float64) / (2**bits - 1) * 2 - 1
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    mask = np.asarray(Image.open(folder / "mask.png").convert("L")) > 0
    return normals.astype(np.float32), mask, bgars.Pinhole(np.loadtxt(folder / "K.txt"))


def made_mm(found: bgars.DepthMap, folder: Path) -> float:
    """Mean absolute depth error after scaling by the median ratio."""
    truth = np.load(folder / "depth_gt.npz")["depth_gt"]
    return float(np.nanmean(abs(found.depth * np.nanmedian(truth / found.depth) - truth)))


def map_line(name: str, data: Path) -> tuple[str, NDArray[np.float64]]:
    """One line of the first table, and its errors: k = 0, compatible, converged, published."""
    folder = data / "normal_maps" / "diligent" / name
    normals, mask, camera = read_map(folder)

    def run(**options: object) -> bgars.DepthMap:
        return bgars.integrate_normals(normals, mask=mask, method="bilateral", camera=camera, **options)  # type: ignore[call-overload, no-any-return]

    smooth, compatible, converged = run(k=0.0), run(solver="compatible"), run(solver="converged")
    errors = [made_mm(found, folder) for found in (smooth, compatible, converged)]
    cells = [f"{error:.3f}" for error in (*errors, PUBLISHED_MM[name])]
    for found in (compatible, converged):
        energies = found.bilateral.energies
        cells.append(f"{energies[-1]:.1f} ({len(energies)})")
    return f"| {name} | " + " | ".join(cells) + " |", np.array([*errors, PUBLISHED_MM[name]])


def scene_lines(name: str, data: Path) -> Iterator[str]:
    """Lines of the second table: one for exact and estimated normals, each method, free and anchored."""
    folder = data / "scenes" / name
    capture, truth = bgars.read_capture(folder), bgars.read_truth(folder)
    if truth.height_um is None or truth.ball_ids is None:
        return
    estimated = bgars.estimate_normals(capture)
    try:
        anchors = bgars.anchors_from_part(bgars.inspect(capture), capture.mask.shape)
    except bgars.BgarsError:
        anchors = None
    exact = np.nan_to_num(truth.normals)
    seen = np.isfinite(truth.normals).all(-1) & (truth.normals[..., 2] > 0)
    sources = {"exact": (exact, seen), "estimated": (estimated, estimated.mask)}
    methods: dict[str, dict[str, object]] = {
        "least squares": {},
        "least squares, confidence": {"weights": "confidence"},
        "bilateral": {"method": "bilateral"},
        "least squares, anchors": {"anchors": anchors},
        "bilateral, anchors": {"anchors": anchors, "method": "bilateral"},
    }
    found: dict[tuple[str, str], bgars.HeightMap] = {}
    for source, (normals, mask) in sources.items():
        for method, options in methods.items():
            if (source == "exact" and "weights" in options) or ("anchors" in options and anchors is None):
                continue
            height = bgars.integrate_normals(normals, mask=mask, pixel_pitch_um=capture.pixel_pitch_um, **options)  # type: ignore[call-overload]
            found[source, method] = height
            yield (
                f"| {name} | {source} | {method} | " + " | ".join(errors_um(height, truth, "anchors" in options)) + " |"
            )
    if name == PICTURED:
        draw_profile({method: found["estimated", method] for method in methods}, truth, PICTURES / "anchors.png")


def errors_um(found: bgars.HeightMap, truth: bgars.Truth, absolute: bool) -> list[str]:
    """Shape of the balls, their tops, board, everything; free maps are put on the board's median first."""
    assert found.height_um is not None
    assert truth.height_um is not None
    assert truth.ball_ids is not None
    judged = (truth.normals[..., 2] > JUDGED_N_Z) & np.isfinite(truth.height_um) & found.mask & (truth.ball_ids >= 0)
    error = found.height_um - truth.height_um
    board = judged & (truth.ball_ids == 0)
    if not absolute:
        error = error - np.median(error[board])
    shapes, tops = [], []
    for ball in range(1, int(truth.ball_ids.max()) + 1):
        own = judged & (truth.ball_ids == ball)
        if own.any():
            shapes.append(np.var(error[own]))
            tops.append(np.mean(error[own & (truth.height_um >= np.sort(truth.height_um[own])[-9])]))
    numbers = (np.mean(shapes), np.mean(np.square(tops)), np.mean(error[board] ** 2), np.mean(error[judged] ** 2))
    return [f"{np.sqrt(number):.2f}" for number in numbers]


def tables(data: Path) -> str:
    """Both tables."""
    lines = [
        "Mean absolute depth error in mm on DiLiGenT maps (scaled by the median ratio); last energy (re-weightings):",
        "",
        "| map | k = 0 | compatible | converged | published | energy, compatible | energy, converged |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    total = np.zeros(4)
    for name in PUBLISHED_MM:
        line, errors = map_line(name, data)
        lines.append(line)
        total += errors
    mean = " | ".join(f"{error:.3f}" for error in total / len(PUBLISHED_MM))
    lines += [
        f"| mean | {mean} | | |",
        "",
        "Root mean square height errors in um over pixels with n_z > 0.3; *shape*: each ball's own mean removed;",
        "*tops*: the nine highest pixels of each ball; without anchors the board's median is put on the truth:",
        "",
        "| scene | normals | method | shape | tops | board | all |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for name in SCENES:
        lines += scene_lines(name, data)
    return "\n".join(lines)


def main() -> None:
    """Rewrite the page, or print lines."""
    data = Path(os.environ["BGARS_DATA"])
    for name in sys.argv[1:]:
        lines = [map_line(name, data)[0]] if name in PUBLISHED_MM else scene_lines(name, data)
        sys.stdout.writelines(f"{line}\n" for line in lines)
    if len(sys.argv) > 1:
        return
    draw_cliff(PICTURES / "bilateral.png")
    page = PAGE.read_text(encoding="utf-8")
    before, rest = page.split(START)
    after = rest.split(END)[1]
    PAGE.write_text(f"{before}{START}\n\n{tables(data)}\n\n{END}{after}", encoding="utf-8")


if __name__ == "__main__":
    main()
