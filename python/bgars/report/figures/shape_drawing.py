"""The picture of shape images."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.ticker import MaxNLocator

from bgars.io.atomic import atomic_file
from bgars.report.figure_file import write_png
from bgars.report.figures.part import MAX_PICTURE_PX
from bgars.report.figures.style import add_axes, figure_style, new_figure, window_size_in

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from bgars.surface.shape_images import ShapeImages

__all__ = ["draw_shape"]

PANEL_IN = 5.2
"""Longer side of an image."""
LEFT_IN, BAR_IN, ABOVE_IN, BELOW_IN, TOP_IN = 0.85, 1.2, 0.5, 0.62, 0.45
"""Room beside an image for its labels, its colour bar and its title; above all, for the picture's."""
SHARE = 95.0
"""Per cent of the pixels within the range of colours: outlines and scratches may lie beyond it."""


def draw_shape(shape: ShapeImages, path: Path) -> None:
    """Draw the four images and write a PNG file."""
    pitch = shape.pixel_pitch_um or 1.0
    rows, cols = (side * pitch for side in shape.slope_deg.shape)
    extent = (-cols / 2, cols / 2, -rows / 2, rows / 2)
    unit = "µm" if shape.unit == "um" else "px"
    wide, tall = window_size_in(extent, PANEL_IN)
    scale = f"{shape.scale_px:g} px" + (f" = {shape.scale_px * pitch:.3g} µm" if shape.pixel_pitch_um else "")
    panels = (
        (shape.slope_deg, "Slope", "degrees", False),
        (shape.flattened, "Heights minus the smoothed surface", unit, True),
        (shape.mean_curvature, "Mean curvature: dents bright, domes dark", f"1/{unit}", True),
        (shape.gaussian_curvature, "Gaussian curvature: saddles dark", f"1/{unit}²", True),
    )
    with figure_style():
        width, height = LEFT_IN + wide + BAR_IN, BELOW_IN + tall + ABOVE_IN
        figure = new_figure(2 * width, 2 * height + TOP_IN)
        figure.suptitle(
            f"Shape images, smoothed over {scale} (standard deviation)",
            y=1.0 - 0.5 * TOP_IN / figure.get_figheight(),
            va="center",
        )
        for place, panel in enumerate(panels):
            left, bottom = (place % 2) * width + LEFT_IN, (1 - place // 2) * height + BELOW_IN
            axes = add_axes(figure, left, bottom, wide, tall)
            bar = add_axes(figure, left + wide + 0.12, bottom, 0.16, tall)
            _show(axes, bar, *panel, extent=extent)
            axes.set(xlabel=f"x ({unit})", ylabel=f"y ({unit})")
        with atomic_file(path) as temporary:
            write_png(figure, temporary)


def _show(
    axes: Axes,
    bar: Axes,
    values: NDArray[np.float32],
    title: str,
    unit: str,
    signed: bool,
    *,
    extent: tuple[float, float, float, float],
) -> None:
    """One image beside its colour bar; where it has a sign, grey is 0."""
    known = np.abs(values[np.isfinite(values)])
    top = max(float(np.percentile(known, SHARE)) if known.size else 0.0, 1e-30)
    step = max(1, math.ceil(max(values.shape) / MAX_PICTURE_PX))
    picture = axes.imshow(
        values[::step, ::step],
        extent=extent,
        interpolation="nearest",
        cmap="gray" if signed else "viridis",
        vmin=-top if signed else 0.0,
        vmax=top,
    )
    axes.set_facecolor("#f3e3c3")  # where nothing is known; no shade of grey
    axes.set_title(title)
    axes.xaxis.set_major_locator(MaxNLocator(5))
    axes.yaxis.set_major_locator(MaxNLocator(5))
    axes.figure.colorbar(picture, cax=bar, label=unit, extend="both" if signed else "max")
    bar.ticklabel_format(axis="y", scilimits=(-2, 4))
