"""Measure the calibration of stations and rewrite the tables of docs/station.md.

Balls by Mitsuba are judged where benches/station/render_balls.py rendered them; benches/station/judged.json keeps it.

Commands: ``make station`` for the page (needs BGARS_DATA for the photographs; 5 minutes),
``python docs/make_station.py balls|near|photographs|psm|board|disc|solder|parts`` for one table.
"""

from __future__ import annotations

import json
import os
import sys
import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import bgars
import imageio.v3 as iio
import numpy as np
from bgars.io.capture import read_unlit
from numpy.typing import NDArray
from scipy import ndimage

sys.path.append(str(Path(__file__).parent.parent / "tests" / "unit"))
from rendered_spheres import render, ring
from station_trial import LIGHTS, SIDE, as_capture, calibrated, dome, hardware, spoiled, trial, unit
from station_wanted import DOME_PX, ERROR_DEG, NEAR_SHARE, OF_EXACT, TWO, WITHIN_2U, WITHIN_U, covered, marked

Array = NDArray[np.float64]
HERE = Path(__file__).parent
PAGE = HERE / "station.md"
MITSUBA = HERE.parent / "benches" / "station" / "balls"
JUDGED = HERE.parent / "benches" / "station" / "judged.json"
RENDERED = {
    "board": "mirror on a board, Mitsuba",
    "grey": "mirror in a grey room, Mitsuba",
    "matt": "matt on a dark board, Mitsuba",
}
SEEDS, MATT_SEEDS, NEAR_SEEDS, PARTS = 12, 6, 3, 10
DISC_PX = 1200.0


def apart_deg(one: Array, other: Array) -> Array:
    """(L,) angles between directions."""
    return np.degrees(2.0 * np.arcsin(np.clip(np.linalg.norm(one - other, axis=1) / 2.0, 0.0, 1.0)))


def on_axes_deg(found: Array, true: Array) -> Array:
    """(L, 2) errors on two axes across."""
    level = np.cross([0.0, 0.0, 1.0], true)
    level /= np.linalg.norm(level, axis=1, keepdims=True)
    up = np.cross(true, level)
    return np.degrees(np.stack([np.sum((found - true) * axis, axis=1) for axis in (level, up)], axis=1))


def case(seed: int, kind: str) -> tuple[Array, bgars.Capture]:
    """Eight lamps of 2 degrees and a ball of about 200 pixels, drawn from a seed."""
    rng = np.random.default_rng([seed, 300])
    lights = ring(8, rng.uniform(25, 70), rng.uniform(0, 45))
    lights += rng.normal(0, 0.05, lights.shape)
    lights /= np.linalg.norm(lights, axis=1, keepdims=True)
    ball = (*rng.uniform(-12, 12, 2), 100.0 + rng.uniform(-2, 2))
    images = render(
        lights, ball=ball, size=(260, 260), kind=kind, samples=3, seed=seed,
        board=float(rng.uniform(0.1, 0.8)) if kind == "mirror" else 0.05,
        lamp_level=float(10 ** rng.uniform(-0.1, 1.8)), blur_px=float(rng.uniform(0.4, 0.9)),
    )  # fmt: skip
    return lights, as_capture(images, bgars.LightRig.ring(8))


def row(name: str, captures: int, errors: list[Array], scaled: list[Array]) -> str:
    """A line of the table of balls."""
    error, z = np.concatenate(errors), np.concatenate(scaled).ravel()
    return (
        f"| {name} | {captures} | {marked(f'{error.mean():.3f}', reached=error.mean() < ERROR_DEG)} | "
        f"{np.percentile(error, 95):.3f} | {error.max():.3f} | {covered(z)} |"
    )


def balls() -> Iterator[str]:
    """Rendered balls: error of directions and coverage of u."""
    yield "| balls of 200 px, 8 bit | captures | mean error (deg) | 95 % | largest | within u | within 2 u |"
    yield "|---|---|---|---|---|---|---|"
    yield f"| wanted | | {ERROR_DEG:g} | | | {WITHIN_U:.0f} % | {WITHIN_2U:.0f} % |"
    for kind, seeds in (("mirror", SEEDS), ("matt", MATT_SEEDS)):
        errors, scaled = [], []
        for seed in range(seeds):
            lights, capture = case(seed, kind)
            found = bgars.calibrate_lights(capture, kind, near=False)  # type: ignore[arg-type]
            errors.append(apart_deg(found.rig.directions, lights))
            scaled.append(on_axes_deg(found.rig.directions, lights) / found.u_deg[:, None])
        yield row(f"{kind}, own ray tracer", seeds, errors, scaled)
    if MITSUBA.is_dir():
        judged = json.loads(JUDGED.read_text(encoding="utf-8")) if JUDGED.exists() else {}
        for folder in sorted(one for one in MITSUBA.iterdir() if (one / "truth.json").exists()):
            truth = json.loads((folder / "truth.json").read_text(encoding="utf-8"))
            lights = np.array(truth["lights"])
            try:
                kind = "matt" if truth["kind"] == "matt" else "mirror"
                found = bgars.calibrate_lights(read_unlit(folder), kind, near=False)  # type: ignore[arg-type]
            except bgars.CalibrationError as error:
                judged[folder.name] = {"refused": str(error)}
                continue
            off = apart_deg(found.rig.directions, lights)
            z = on_axes_deg(found.rig.directions, lights) / found.u_deg[:, None]
            judged[folder.name] = {"off_deg": off.round(5).tolist(), "scaled": z.round(4).tolist()}
        JUDGED.write_text(json.dumps(judged, indent=1) + "\n", encoding="utf-8")
    if JUDGED.exists():
        judged = json.loads(JUDGED.read_text(encoding="utf-8"))
        for kind, words in RENDERED.items():
            these = [one for name, one in judged.items() if name.startswith(kind) and "off_deg" in one]
            refused = sum(name.startswith(kind) and "refused" in one for name, one in judged.items())
            said = f"{words}, {refused} more refused" if refused else words
            errors = [np.array(one["off_deg"]) for one in these]
            yield row(said, len(these), errors, [np.array(one["scaled"]) for one in these])


def near() -> Iterator[str]:
    """Rendered near lamps: a ball of 120 px at three places."""
    head = "near lamps at 500 to 800 px, a ball of 120 px at three places"
    yield f"| {head} | lamps | median error, of the distance | 95 % | within u | within 2 u |"
    yield "|---|---|---|---|---|---|"
    yield f"| wanted | | {NEAR_SHARE:g} % | | {WITHIN_U:.0f} % | {WITHIN_2U:.0f} % |"
    share, scaled = [], []
    for seed in range(NEAR_SEEDS):
        rng = np.random.default_rng([seed, 301])
        lamps = ring(6, 45.0, rng.uniform(0, 60)) * rng.uniform(500, 800, (6, 1))
        captures = []
        for place, (x, y) in enumerate([(-70.0, -45.0), (75.0, -40.0), (5.0, 75.0)]):
            images = render(
                lamps, ball=(x, y, 60.0), size=(290, 290), near=True, seed=10 * seed + place, samples=3,
                blur_px=0.6, lamp_level=3.0,
            )  # fmt: skip
            captures.append(as_capture(images, bgars.LightRig.ring(6), 20.0))
        found = bgars.calibrate_lights(captures, near=True)
        if found.rig.positions_um is None or found.u_positions_um is None:
            continue
        off = found.rig.positions_um / 20.0 - lamps
        share += (np.linalg.norm(off, axis=1) / np.linalg.norm(lamps, axis=1)).tolist()
        scaled.append(20.0 * off / found.u_positions_um)
    middle = 100 * float(np.median(share))
    yield (
        f"| mirror, own ray tracer | {len(share)} | {marked(f'{middle:.2f} %', reached=middle < NEAR_SHARE)} | "
        f"{100 * np.percentile(share, 95):.2f} % | {covered(np.concatenate(scaled))} |"
    )


def frog_ball(folder: Path) -> tuple[bgars.Capture, Array]:
    """A chrome ball of the frog set and its published outline (column, row from the bottom, radius)."""
    images = np.stack(
        [np.rint(iio.imread(folder / f"Image_{i:02d}.JPG").astype(float).mean(axis=2)) for i in range(1, 21)]
    )
    col, up, radius = np.loadtxt(folder / "circle_data.txt")
    height, width = images.shape[1:]
    shape = (height, width)
    capture = bgars.Capture(
        images.astype(np.uint8), bgars.LightRig.ring(20), np.ones(shape, np.bool_), saturation=250.0
    )
    return capture, np.array([col - 0.5 - width / 2.0, up - 0.5 - height / 2.0, radius])


def photographs() -> Iterator[str]:
    """Two calibrations of the same lights, by photographs."""
    real = Path(os.environ["BGARS_DATA"]) / "real"
    yield "| photographs | median difference (deg) | largest | expected by u, median | within 2 u |"
    yield "|---|---|---|---|---|"
    yield f"| wanted | | | | {WITHIN_2U:.0f} % |"
    chrome = bgars.calibrate_lights(bgars.read_capture(real / "psm_chrome"))
    gray = bgars.calibrate_lights(bgars.read_capture(real / "psm_gray"), "matt")
    one, two = (frog_ball(real / "harv_frog" / name) for name in ("chrome1", "chrome2"))
    first, second = (bgars.calibrate_lights(capture, outline=circle) for capture, circle in (one, two))
    both = bgars.calibrate_lights([one[0], two[0]], outline=[one[1], two[1]], near=False)
    for name, a, b in (("psm: chrome ball and matt ball", chrome, gray), ("frog: either chrome ball", first, second)):
        yield against(name, apart_deg(a.rig.directions, b.rig.directions), np.hypot(a.u_deg, b.u_deg))
    own = np.loadtxt(real / "psm_chrome" / "light_directions.txt")
    yield against("psm: chrome ball and published", apart_deg(chrome.rig.directions, unit(own)), chrome.u_deg)
    probes = unit(np.loadtxt(real / "harv_frog" / "light_directions_probes.txt"))
    yield against("frog: both balls and published", apart_deg(both.rig.directions, probes), both.u_deg)


def against(name: str, off: Array, u: Array) -> str:
    """A line of the table of photographs; an error of u on either axis is one of 1.18 u in its median."""
    share = 100 * float(np.mean(off < TWO * np.sqrt(2) * u))
    cell = marked(f"{share:.0f} %", reached=round(share) >= WITHIN_2U)
    return f"| {name} | {np.median(off):.2f} | {off.max():.2f} | {1.18 * np.median(u):.2f} | {cell} |"


def psm() -> Iterator[str]:
    """Reconstruction with our directions beside the published ones."""
    real = Path(os.environ["BGARS_DATA"]) / "real"
    ours = bgars.calibrate_lights(bgars.read_capture(real / "psm_chrome")).rig
    yield "| psm set | measure | published directions | ours (wanted: no larger) |"
    yield "|---|---|---|---|"
    for name in ("gray", "cat", "buddha", "horse"):
        capture = bgars.read_capture(real / f"psm_{name}")
        rigs = (capture.rig, replace(ours, files=capture.rig.files))
        cells = []
        for rig in rigs:
            field = bgars.estimate_normals(replace(capture, rig=rig))
            cells.append(sphere_error(field, real) if name == "gray" else left(capture, rig, field))
        measure = "median error against the sphere (deg)" if name == "gray" else "residual of the images (%)"
        ours_cell = marked(f"{cells[1]:.2f}", reached=cells[1] <= cells[0])
        yield f"| {name} | {measure} | {cells[0]:.2f} | {ours_cell} |"


def sphere_error(field: bgars.NormalField, real: Path) -> float:
    """Median angle between normals and those of the published circle."""
    col, line, radius = np.loadtxt(real / "psm_gray" / "sphere_cx_cy_r.txt")
    rows, cols = np.mgrid[: field.mask.shape[0], : field.mask.shape[1]]
    x, y = (cols - col) / radius, (line - rows) / radius
    inside = field.mask & (np.hypot(x, y) < 0.9)  # noqa: PLR2004 - the rim is steep
    true = np.stack([x, y, np.sqrt(np.maximum(1.0 - x**2 - y**2, 0.0))], axis=-1)
    cosine = np.sum(field.normals[inside] * true[inside], axis=1)
    return float(np.degrees(np.median(np.arccos(np.clip(cosine, -1.0, 1.0)))))


def left(capture: bgars.Capture, rig: bgars.LightRig, field: bgars.NormalField) -> float:
    """Root mean square of what Lambert's law leaves of lit pixels with the best normals, per cent of their level."""
    levels = capture.images[:, field.mask].astype(np.float64)
    lit = levels > np.percentile(levels, 20)
    shading = rig.directions @ field.normals[field.mask].T
    shading[~lit | (shading < 0.1)] = 0.0  # noqa: PLR2004 - grazing
    albedo = np.sum(levels * shading, axis=0) / np.maximum(np.sum(shading**2, axis=0), 1e-9)
    off = np.where(shading > 0, levels - albedo * shading, 0.0)
    return float(100.0 * np.sqrt(np.sum(off**2) / np.sum(np.where(shading > 0, levels, 0.0) ** 2)))


def board() -> Iterator[str]:
    """A flat board through the simulated station: what is left of flatness."""
    yield f"| flat board, 290 px | dome (px, of 1,200 px; wanted calibrated: {DOME_PX:g}) |"
    yield "|---|---|"
    real = hardware(7)
    station = calibrated(real)
    lit = real.intensities * real.lights[:, 2]
    flat = 0.55 * (lit / lit.max())[:, None, None] * np.ones((SIDE, SIDE))
    seen = as_capture(spoiled(flat, real.rng), bgars.LightRig.ring(LIGHTS))
    for name, capture in (("uncalibrated", seen), ("calibrated station", bgars.with_station(seen, station))):
        field = bgars.estimate_normals(capture)
        surface = bgars.integrate_normals(field)
        height = surface.height[5:-5, 5:-5] / (surface.pixel_pitch_um or 1.0)
        rows, cols = np.mgrid[: height.shape[0], : height.shape[1]]
        use = ndimage.binary_erosion(field.mask, iterations=5)[5:-5, 5:-5] & np.isfinite(height)
        # A dome grows with the square of the width that it spans, as a share of it with the width.
        yield f"| {name} | {dome(height[use], rows[use], cols[use]) * (DISC_PX / SIDE) ** 2:.1f} |"


def disc() -> Iterator[str]:
    """A flat disc with turned grooves under near lamps and a lens that vignettes: the dome that it comes out as."""
    head = "flat turned disc, 1,200 px, lamps at 2,000 px, vignetting 20 %"
    yield f"| {head} | dome (px; wanted with the flat field: {DOME_PX:g}) |"
    yield "|---|---|"
    side = int(DISC_PX)
    rng = np.random.default_rng(61)
    lamps = ring(8, 45.0) * 2000.0
    middle = np.arange(side) + 0.5 - side / 2.0
    x, y = np.meshgrid(middle, -middle)
    radius = np.hypot(x, y)
    # Grooves of 7 pixels, 6 degrees steep: what a lathe leaves.
    slope = 0.1 * np.sin(2.0 * np.pi * radius / 7.0)
    normals = np.stack([-slope * x / radius, -slope * y / radius, np.ones_like(x)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    lens = 1.0 - 0.2 * (radius / radius.max()) ** 2

    def photograph(facing: Array, albedo: float) -> bgars.Capture:
        images = []
        for lamp in lamps:
            way = lamp - np.stack([x, y, np.zeros_like(x)], axis=-1)
            distance = np.linalg.norm(way, axis=-1)
            lit = np.maximum(np.sum(facing * way, axis=-1), 0.0) / distance**3 * 2000.0**2
            images.append(np.clip(np.rint(255.0 * albedo * lens * lit + rng.normal(0.0, 1.0, x.shape)), 0, 255))
        return as_capture(np.array(images, np.uint8), bgars.LightRig.from_directions(ring(8, 45.0)))

    board, _ = bgars.calibrate_flat(photograph(np.broadcast_to([0.0, 0.0, 1.0], normals.shape), 0.7))
    seen = photograph(normals, 0.5)
    inside = radius < 0.48 * side
    for name, capture in (
        ("uncalibrated", seen),
        ("flat field of a board", bgars.with_station(seen, bgars.Station("disc", flat=board))),
    ):
        field = bgars.estimate_normals(replace(capture, mask=inside))
        surface = bgars.integrate_normals(field)
        use = inside & field.mask & np.isfinite(surface.height)
        height = (
            ndimage.uniform_filter(np.where(use, surface.height, 0.0), 15)[use]
            / ndimage.uniform_filter(use.astype(np.float64), 15)[use]
        )
        yield f"| {name} | {dome(height, x[use], y[use]) / (surface.pixel_pitch_um or 1.0):.1f} |"


def parts() -> Iterator[str]:
    """Ten parts by the calibrated station, against exact knowledge."""
    yield "| ten parts of nine balls, error (um, rms) | balls | height | diameter | x | y |"
    yield "|---|---|---|---|---|---|"
    exact, station, spoilt = trial(PARTS)
    wanted_um = OF_EXACT * exact.rms_um
    yield "| wanted of the calibrated station | | " + " | ".join(f"{value:.2f}" for value in wanted_um) + " |"
    for one in (exact, station, spoilt):
        good = (one.rms_um < wanted_um) | (one is not station)
        cells = [marked(f"{value:.2f}", reached=bool(fine)) for value, fine in zip(one.rms_um, good, strict=True)]
        yield f"| {one.name} | {one.balls} | {' | '.join(cells)} |"


def solder() -> Iterator[str]:
    """Lights from the solder balls of rendered parts, whose rigs are stated wrong."""
    reality = Path(os.environ["BGARS_DATA"]) / "reality"
    yield "| rendered parts | lights | rig as stated, error (deg) | found, mean | 95 % | within u | within 2 u |"
    yield "|---|---|---|---|---|---|---|"
    yield f"| wanted | | | below the rig's | | {WITHIN_U:.0f} % | {WITHIN_2U:.0f} % |"
    errors, scaled, before, refused, parts = [], [], [], 0, 0
    for folder in sorted(reality.iterdir(), key=lambda one: int(one.name)):
        true = np.array(json.loads((folder / "scene.json").read_text(encoding="utf-8"))["true_light_directions"])
        capture = bgars.read_capture(folder)
        parts += 1
        try:
            found = bgars.calibrate_lights(capture, "balls", recipe=folder / "part.toml")
        except bgars.BgarsError:
            refused += 1
            continue
        before.append(apart_deg(capture.rig.directions, true))
        errors.append(apart_deg(found.rig.directions, true))
        scaled.append(on_axes_deg(found.rig.directions, true) / found.u_deg[:, None])
    error, stated = np.concatenate(errors), float(np.concatenate(before).mean())
    yield (
        f"| {parts}, of which {refused} refused | {len(error)} | {stated:.2f} | "
        f"{marked(f'{error.mean():.2f}', reached=error.mean() < stated)} | {np.percentile(error, 95):.2f} | "
        f"{covered(np.concatenate(scaled))} |"
    )


PARTS_OF_THE_PAGE = (balls, near, photographs, psm, board, disc, solder, parts)
TABLES: dict[str, Callable[[], Iterator[str]]] = {one.__name__: one for one in PARTS_OF_THE_PAGE}


def main(names: list[str]) -> None:
    """Print tables and write each to its place on the page; with none named, all of them."""
    warnings.simplefilter("ignore", bgars.CaptureWarning)
    for name in names or list(TABLES):
        table = "\n".join(TABLES[name]())
        print(table, flush=True)  # noqa: T201 - what it is for
        page = PAGE.read_text(encoding="utf-8")
        start, end = f"<!-- table {name}: make station -->", f"<!-- end of {name} -->"
        before, rest = page.split(start)
        _, after = rest.split(end)
        PAGE.write_text(f"{before}{start}\n\n{table}\n\n{end}{after}", encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
