"""Rebuild an independent renderer's scenes with `bgars.simulate`, compare, rewrite the tables of docs/simulator.md."""

from __future__ import annotations

import csv
import json
import math
import os
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import bgars
import imageio.v3 as iio
import numpy as np
from numpy.typing import NDArray

SCENES = ("A_one_ball_diffuse", "C_grid_4x4_paper", "D_grid_5x5_defects", "D2_grid_5x5_defects_bow")
TRUTH_SCENES = ("F_grid_6x6_near", "H_bridge")
"""Near lights, and a bridge: their images hold interreflections, so only truth is compared."""
NOISY_SCENE = "C2_grid_4x4_gamma"
PAGE = Path(__file__).parent / "simulator.md"
START, END = "<!-- tables: make simulator -->", "<!-- end of tables -->"
SUPERSAMPLE = 8
"""The renderer averages 64 samples over a pixel; so does the check."""
HIGHLIGHT_LEVELS = 1.0
"""A lit ball pixel belongs to the highlight where its specular part is above this many grey levels."""
FULL = 255.0
MIN_PIXELS = 1000
LOWEST_LEVEL, HIGHEST_LEVEL = 40.0, 240.0
Bool = NDArray[np.bool_]
Levels = NDArray[np.float64]


@dataclass(frozen=True)
class Rebuilt:
    """A scene of the renderer, its images and truth, and the arguments that simulate it."""

    name: str
    scene: bgars.Scene
    rig: bgars.LightRig
    material: bgars.Material
    camera: bgars.Camera
    images: Levels
    truth: dict[str, Any]
    facts: dict[str, Any]

    def simulated(self, material: bgars.Material) -> tuple[Levels, bgars.SimulatedTruth]:
        """Grey levels of 255 of a simulation with this material, and its truth."""
        capture, truth = bgars.simulate(self.scene, self.rig, material, self.camera)
        return capture.images / capture.full_scale * FULL, truth


def conductor_reflectance(cosine: float, eta: float, k: float) -> float:
    """Unpolarised Fresnel reflectance of a metal with refractive index eta - ik (Born & Wolf, section 14.2)."""
    index = complex(eta, -k)
    inside = np.sqrt(1.0 - (1.0 - cosine**2) / index**2)
    across = (cosine - index * inside) / (cosine + index * inside)
    along = (index * cosine - inside) / (index * cosine + inside)
    return float((abs(across) ** 2 + abs(along) ** 2) / 2.0)


def balls_of(path: Path, joined: set[str]) -> list[bgars.Ball]:
    """Balls of balls.csv, in micrometres; missing ones at their nominal places."""
    balls = []
    with path.open(encoding="utf-8", newline="") as stream:
        for number, row in enumerate(csv.DictReader(stream)):
            present = row["present"] == "1"
            nominal_um = (float(row["x_nom_mm"]) * 1e3, float(row["y_nom_mm"]) * 1e3)
            radius_um = float(row["radius_mm" if present else "radius_nom_mm"]) * 1e3
            centre_um = float(row["z_centre_mm"]) * 1e3 - float(row["board_z_mm"]) * 1e3 if present else 0.0
            place_um = (float(row["x_mm"]) * 1e3, float(row["y_mm"]) * 1e3) if present else nominal_um
            vertical_um = float(row["radius_z_mm"]) * 1e3 if present else radius_um
            top_um = float(row["top_height_mm"]) * 1e3 if present else radius_um
            clipped_um = max(centre_um + vertical_um - top_um, 0.0) if row["shape"] == "clipped" else 0.0
            balls.append(
                bgars.Ball(
                    *place_um,
                    radius_um=radius_um,
                    centre_z_um=centre_um,
                    aspect_ratio=vertical_um / radius_um,
                    flat_top_depth_um=clipped_um,
                    name=row["name"],
                    row=1 + number,
                    x_nominal_um=nominal_um[0],
                    y_nominal_um=nominal_um[1],
                    present=present,
                    defect="bridged" if row["name"] in joined else row["defect"],
                )
            )
    return balls


def images_of(folder: Path, facts: dict[str, Any]) -> Levels:
    """Rendered images in grey levels of 255: 16-bit files where there are some, else 8-bit ones."""
    place = folder / "16bit" if facts["has_16bit"] else folder
    stack = np.stack([iio.imread(place / name) for name in facts["lights"]["files"]]).astype(np.float64)
    return stack * (FULL / (65535.0 if facts["has_16bit"] else 255.0))


def rig_of(facts: dict[str, Any]) -> bgars.LightRig:
    """Distant or near lights."""
    lights = facts["lights"]
    if lights["positions_mm"] is None:
        return bgars.LightRig.from_directions(lights["directions"], intensities=lights["intensities"])
    return bgars.LightRig.from_positions(
        np.array(lights["positions_mm"]) * 1e3,
        intensities=lights["intensities"],
        intensity_distance_um=lights["near"]["distance"] * 1e3,
    )


def scene_of(folder: Path, facts: dict[str, Any], board: bgars.Board) -> bgars.Scene:
    """Balls and bridge."""
    bridge = facts["bridge"]
    if bridge is None:
        return bgars.Scene(tuple(balls_of(folder / "balls.csv", set())), board=board)
    joint = bgars.Bridge(*bridge["names"], radius_um=bridge["r"] * 1e3, z_um=bridge["z"] * 1e3)
    return bgars.Scene(tuple(balls_of(folder / "balls.csv", set(bridge["names"]))), (joint,), board)


def material_of(facts: dict[str, Any], rig: bgars.LightRig) -> bgars.Material:
    """The renderer's mixture of a diffuse surface and a rough metal, in the simulator's terms."""
    material, gain = facts["material"], facts["radiance_to_signal_gain"]
    # f = (1 - w) Id / pi + w F D G / (4 N.L N.V) with D_0 = 1 / (pi m^2): the peak of the lobe is gain w F D_0 / 4.
    cosine = math.sqrt((1.0 + float(rig.directions[0, 2])) / 2.0)
    mirror = conductor_reflectance(cosine, material["eta"], material["k"])
    i_s = gain * material["w"] * mirror / (4.0 * math.pi * material["alpha"] ** 2)
    i_d = gain * (1.0 - material["w"]) * material["Id"] / math.pi
    return bgars.Material(i_d=i_d, i_s=i_s, roughness=material["alpha"])


def rebuild(folder: Path) -> Rebuilt:
    """Translate scene.json, balls.csv and gt.npz."""
    facts = json.loads((folder / "scene.json").read_text(encoding="utf-8"))
    images = images_of(folder, facts)
    with np.load(folder / "gt.npz") as arrays:
        truth = {name: arrays[name] for name in arrays.files}
    truth["lit"] = np.stack([(truth["lit"] >> light) & 1 for light in range(len(images))]).astype(bool)
    rig = rig_of(facts)
    gain = facts["radiance_to_signal_gain"]
    material = bgars.Material() if facts["scene"] in TRUTH_SCENES else material_of(facts, rig)
    board_i_d = gain * facts["substrate"]["reflectance"] / math.pi
    albedo_map = None
    if facts["substrate"]["texture_contrast"] and facts["scene"] not in TRUTH_SCENES:
        albedo_map = texture_from(images, truth, rig) / board_i_d
    tilt, bow = facts["board"], facts["board"]["bow_mm"] * 1e3
    board = bgars.Board(
        material=bgars.Material.matte(board_i_d),
        tilt_x_deg=math.degrees(math.atan(tilt["tilt_x"])),
        tilt_y_deg=math.degrees(math.atan(tilt["tilt_y"])),
        bow_um=bow,
        bow_radius_um=tilt["Rb_mm"] * 1e3,
        albedo_map=albedo_map,
    )
    return Rebuilt(
        name=facts["scene"],
        scene=scene_of(folder, facts, board),
        rig=rig,
        material=material,
        camera=bgars.Camera(
            pixel_pitch_um=facts["pixel_pitch_mm"] * 1e3,
            shape=(facts["height"], facts["width"]),
            bit_depth=16 if facts["has_16bit"] else 8,
            supersample=SUPERSAMPLE,
        ),
        images=images,
        truth=truth,
        facts=facts,
    )


def texture_from(images: Levels, truth: dict[str, Any], rig: bgars.LightRig) -> Levels:
    """Signal of a facing board from the images: the median over the lights that reach all of a pixel's neighbourhood.

    Where there is none, over those that reach the pixel's centre: shadows mix in there.
    """
    facing = rig.directions[:, 2, None, None] * rig.intensities[:, None, None]
    reached = truth["lit"] & (truth["id"] == 0)
    clear = reached & ~contours_of(truth)
    signal: Levels = np.zeros(truth["id"].shape)
    for chosen in (reached, clear):
        known = chosen.any(axis=0)
        signal[known] = np.nanmedian(np.where(chosen, images / FULL / facing, np.nan)[:, known], axis=0)
    # Under the rim of a ball the board is seen by a part of the pixel only, and its albedo not known at all.
    return np.where(reached.any(axis=0), signal, np.median(signal[clear.any(axis=0)]))


def contours_of(truth: dict[str, Any]) -> Bool:
    """(L, H, W) pixels whose neighbourhood has another label or another shadow."""
    return np.stack([_edges(truth["id"]) | _edges(mask) | truth["mixed"] for mask in truth["lit"]])


def classes_of(rebuilt: Rebuilt, specular: Levels) -> dict[str, Bool]:
    """Pixel classes, one (L, H, W) mask each, from the renderer's own truth and the size of the specular part."""
    ids, lit = rebuilt.truth["id"], rebuilt.truth["lit"]
    contour = contours_of(rebuilt.truth)
    ball = np.broadcast_to(ids > 0, lit.shape)
    shiny = specular > HIGHLIGHT_LEVELS
    return {
        "lit board": ~ball & lit & ~contour,
        "shadowed board": ~ball & ~lit & ~contour,
        "ball diffuse": ball & lit & ~contour & ~shiny,
        "ball highlight": ball & lit & ~contour & shiny,
        "ball in shadow": ball & ~lit & ~contour,
        "contour": contour,
    }


def _edges(values: NDArray[Any]) -> Bool:
    """Pixels with another value among their eight neighbours, and the image border, whose neighbours nobody sees."""
    padded = np.pad(values, 1, mode="edge")
    rows, cols = values.shape
    found: Bool = np.zeros(values.shape, dtype=np.bool_)
    for down in range(3):
        for right in range(3):
            found |= padded[down : down + rows, right : right + cols] != values
    found[[0, -1]] = True
    found[:, [0, -1]] = True
    return found


def check(folder: Path) -> tuple[dict[str, dict[str, Levels]], Rebuilt, bgars.SimulatedTruth, int]:
    """Absolute differences by masking term and class, pixels clipped in both images left out."""
    rebuilt = rebuild(folder)
    matte, truth = rebuilt.simulated(replace(rebuilt.material, i_s=0.0))
    results: dict[str, dict[str, Levels]] = {}
    clipped = 0
    for masking in ("cook-torrance", "smith"):
        shown, _ = rebuilt.simulated(replace(rebuilt.material, masking=masking))
        both = (shown >= FULL) & (rebuilt.images >= FULL)
        clipped = int(both.sum())
        difference = np.abs(shown - rebuilt.images)
        classes = classes_of(rebuilt, shown - matte)
        results[masking] = {name: difference[mask & ~both] for name, mask in classes.items()}
    return results, rebuilt, truth, clipped


def truth_of(folder: Path) -> tuple[Rebuilt, bgars.SimulatedTruth]:
    """Truth of a scene whose images are not compared."""
    rebuilt = rebuild(folder)
    rebuilt = replace(rebuilt, camera=replace(rebuilt.camera, supersample=1))
    return rebuilt, rebuilt.simulated(rebuilt.material)[1]


def truth_row(rebuilt: Rebuilt, truth: bgars.SimulatedTruth) -> str:
    """Largest differences of the two truths."""
    known = rebuilt.truth
    same = truth.ball_ids == known["id"]
    angle = bgars.angular_error_deg(truth.normals, known["normals"])[same]
    height_um = np.abs(truth.height_um - known["z"] * 1e3)[same]
    seating = rebuilt.facts["coplanarity"]
    planes = "-"
    if seating is not None:
        theirs = (seating["seating_max_dev_mm"] * 1e3, seating["lsq_range_mm"] * 1e3)
        planes = (
            f"{truth.seating_coplanarity_um:.3f} / {theirs[0]:.3f}; "
            f"{truth.regression_coplanarity_um:.3f} / {theirs[1]:.3f}"
        )
    return (
        f"| {rebuilt.name} | {angle.max():.4f} | {height_um.max():.4f} | {int((~same).sum())} | "
        f"{int((truth.lit != known['lit']).sum())} of {truth.lit.size} | {planes} |"
    )


def noise_rows(folder: Path) -> list[str]:
    """Deviations from the noise-free picture: of the renderer's noisy 8-bit gamma images, and of simulated ones."""
    rebuilt = rebuild(folder)
    noise = rebuilt.facts["noise"]
    linear = replace(rebuilt.camera, bit_depth=16)
    camera = replace(rebuilt.camera, bit_depth=8, gamma=2.2)
    read_levels = noise["read_e"] / noise["full_well_e"] * FULL
    noisy = replace(camera, full_well_e=noise["full_well_e"], read_noise_levels=read_levels)
    matte, _ = replace(rebuilt, camera=linear).simulated(replace(rebuilt.material, i_s=0.0))
    shiny, _ = replace(rebuilt, camera=linear).simulated(rebuilt.material)
    clean, _ = replace(rebuilt, camera=replace(camera, bit_depth=16)).simulated(rebuilt.material)
    ours, _ = replace(rebuilt, camera=noisy).simulated(rebuilt.material)
    # Pixels about to clip have one-sided noise, and near black a gamma is anything but straight.
    steady = (clean > LOWEST_LEVEL) & (clean < HIGHEST_LEVEL)
    rows = []
    for kind, mask in classes_of(rebuilt, shiny - matte).items():
        chosen = mask & steady
        if chosen.sum() > MIN_PIXELS:
            cells = []
            for images in (rebuilt.images, ours):
                residual = (images - clean)[chosen]
                cells.append(f" {residual.mean():+.3f} | {residual.std():.3f} |")
            rows.append(f"| C2 | {kind} | {int(chosen.sum())} |{''.join(cells)}")
    return rows


def main() -> None:
    """Rewrite the tables between the marks of the page."""
    data = Path(os.environ["BGARS_DATA"]) / "scenes"
    lines = [
        "| scene | class | pixels x lights | median | 95 % | max | with Smith's masking: median | 95 % | max |",
        "| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |",
    ]
    truths = [
        "| scene | normals, max (deg) | heights, max (um) | labels that differ | lit masks that differ "
        "| seating; regression coplanarity, bgars / renderer (um) |",
        "| --- | ---: | ---: | ---: | ---: | ---: |",
    ]
    for name in SCENES:
        results, rebuilt, truth, clipped = check(data / name)
        short = name.split("_", maxsplit=1)[0]
        for kind, ours in results["cook-torrance"].items():
            lines.append(f"| {short} | {kind} | {ours.size} |{shown(ours)}{shown(results['smith'][kind])}")
        lines.append(f"| {short} | clipped in both (left out above) | {clipped} | - | - | - | - | - | - |")
        truths.append(truth_row(rebuilt, truth))
        sys.stderr.write(f"{name}\n")
    for name in TRUTH_SCENES:
        truths.append(truth_row(*truth_of(data / name)))
    noises = [
        "| scene | class | pixels x lights | renderer: mean | standard deviation | bgars: mean | standard deviation |",
        "| --- | --- | ---: | ---: | ---: | ---: | ---: |",
        *noise_rows(data / NOISY_SCENE),
    ]
    head, rest = PAGE.read_text(encoding="utf-8").split(START)
    tail = rest.split(END)[1]
    body = "\n".join(
        ["### Grey levels", "", *lines, "", "### Truth", "", *truths, "", "### Noise and response", "", *noises]
    )
    PAGE.write_text(f"{head}{START}\n\n{body}\n\n{END}{tail}", encoding="utf-8")


def shown(differences: Levels) -> str:
    """Three cells: median, 95th percentile, largest."""
    if not differences.size:
        return " - | - | - |"
    return f" {np.median(differences):.2f} | {np.percentile(differences, 95):.2f} | {differences.max():.2f} |"


if __name__ == "__main__":
    main()
