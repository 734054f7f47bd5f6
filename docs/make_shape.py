"""Photograph a known plate, reconstruct it, and write the picture and the table of docs/shape.md.

Command: ``make shape-page``.
"""

from __future__ import annotations

from pathlib import Path

import bgars
import numpy as np
from bgars.report.figures.style import figure_style, new_figure
from numpy.typing import NDArray

Floats = NDArray[np.float64]

HERE = Path(__file__).parent
PAGE, FOLDER = HERE / "shape.md", HERE / "images" / "shape"
START, END = "<!-- make shape-page -->", "<!-- end -->"
SIZE_PX = (240, 360)
PITCH_UM = 10.0
DENT_UM, SCRATCH_UM, MARK_UM = 6.0, 1.5, 2.0
"""Depth of the dent and of the scratch, height of the embossed mark."""
NOISE_LEVELS = 0.5
SPOT_PX = 38
"""Radius of a printed spot."""
SCALES_PX = (1.0, 2.0, 4.0)


def plate_um() -> Floats:
    """Heights of a bowed plate with a dent, a scratch and an embossed mark, y upward."""
    row, col = np.mgrid[: SIZE_PX[0], : SIZE_PX[1]].astype(float)
    bow = -2e-3 * PITCH_UM * ((row - 120) ** 2 + 0.5 * (col - 180) ** 2) / 4.0
    dent = -DENT_UM * np.exp(-((row - 75) ** 2 + (col - 85) ** 2) / (2 * 11.0**2))
    across = (row - 60) * 0.5 - (col - 220) * 0.866
    scratch = -SCRATCH_UM * np.exp(-(across**2) / (2 * 1.2**2)) / (1.0 + np.exp(np.abs(row - 112) - 88))
    ring = np.hypot(row - 165, col - 100) - 32.0
    mark = MARK_UM / (1.0 + np.exp((np.abs(ring) - 6.0) / 1.2))
    return bow + dent + scratch + mark


def printed_albedo() -> Floats:
    """A print that photographs show best: stripes and a spot, neither of which has any height."""
    row, col = np.mgrid[: SIZE_PX[0], : SIZE_PX[1]]
    stripes = np.where((col // 14) % 2 == 0, 0.32, 0.52)
    return np.where(np.hypot(row - 170, col - 270) < SPOT_PX, 0.18, stripes)


def photographs(height_um: Floats, rig: bgars.LightRig) -> NDArray[np.uint8]:
    """Eight images of a matt print under a weak, wide highlight, with noise."""
    down, right = np.gradient(height_um, PITCH_UM)
    normals = np.dstack([-right, down, np.ones_like(right)])
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    random = np.random.default_rng(0)
    images = []
    for light in rig.directions:
        half = light + np.array([0.0, 0.0, 1.0])
        shine = 0.10 * np.maximum(normals @ (half / np.linalg.norm(half)), 0.0) ** 60
        levels = 255.0 * (printed_albedo() * np.maximum(normals @ light, 0.0) + shine)
        images.append(np.rint(np.clip(levels + random.normal(0.0, NOISE_LEVELS, levels.shape), 0, 255)))
    return np.array(images, dtype=np.uint8)


def table(height: bgars.HeightMap, truth: bgars.HeightMap) -> list[str]:
    """Root mean square of each image of the true surface, and of the measured image's error, by scale."""
    lines = [
        "| scale (px) | slope (°) | its error | mean curvature (1/m) | its error | fine relief (µm) | its error |",
        "| ---: | ---: | ---: | ---: | ---: | ---: | ---: |",
    ]
    for scale in SCALES_PX:
        found, true = (bgars.shape_images(each, scale_px=scale) for each in (height, truth))
        cells = [f"{scale:g}"]
        for name, factor in (("slope_deg", 1.0), ("mean_curvature", 1e6), ("flattened", 1.0)):
            right = factor * getattr(true, name).astype(np.float64)
            error = factor * getattr(found, name).astype(np.float64) - right
            cells += [f"{np.sqrt(np.nanmean(values**2)):.3g}" for values in (right, error)]
        lines.append(f"| {' | '.join(cells)} |")
    return lines


def main() -> None:
    """Render, reconstruct, draw, write."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    rig, height_um = bgars.LightRig.ring(8, elevation_deg=40.0), plate_um()
    capture = bgars.Capture(photographs(height_um, rig), rig, np.ones(SIZE_PX, bool), pixel_pitch_um=PITCH_UM)
    height = bgars.integrate_normals(bgars.estimate_normals(capture, method="robust-filter"))
    bgars.write_shape_images(bgars.shape_images(height, scale_px=2.0), FOLDER)
    for path in FOLDER.glob("*.tif"):
        path.unlink()
    with figure_style():
        figure = new_figure(6.0, 4.3)
        capture.plot(0, axes=figure.add_subplot()).set(
            title="The plate under one of eight lights", xticks=[], yticks=[]
        )
        figure.savefig(FOLDER / "photograph.png", bbox_inches="tight")
    truth = bgars.HeightMap.from_array(height_um.astype(np.float32), pixel_pitch_um=PITCH_UM)
    text = PAGE.read_text(encoding="utf-8")
    before, after = text[: text.index(START) + len(START)], text[text.index(END) :]
    lines = table(height, truth)
    PAGE.write_text("\n".join([before, "", *lines, "", after]), encoding="utf-8")


if __name__ == "__main__":
    main()
