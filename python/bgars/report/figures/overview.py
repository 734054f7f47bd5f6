"""One picture of a reconstruction to show a colleague."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import style as matplotlib_style
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator, NullFormatter

from bgars.files.light_names import light_name
from bgars.io.atomic import atomic_file
from bgars.report.color_ramp import cividis
from bgars.report.figure_file import write_png
from bgars.report.figures.prior import prior_label, prior_overlay, prior_pixels, show_prior, stripes
from bgars.report.figures.relief import relief

if TYPE_CHECKING:
    from os import PathLike

    from matplotlib.axes import Axes
    from matplotlib.image import AxesImage
    from numpy.typing import NDArray

    from bgars.pipelines.reconstruct import Reconstruction
    from bgars.records.height_map import HeightMap

    Overlay = NDArray[np.uint8] | None

__all__ = ["write_overview"]

MAX_SURFACE_POINTS = 240
SURFACE_PX = 760
MAX_PICTURE_PX = 1600
DPI = 140
FLAT_PROFILE = 0.2
AMBIENT = 0.25
PICTURE_LIGHT = (-0.55, -0.4, 0.73)
LINE_COLOR = "#1f4e79"
MARK_COLOR = "#d1495b"
PRIOR_COLOR = "#e69f00"
WEIGHING_METHODS = ("reflectance", "blind")
ERROR_LIMITS_DEG = (0.05, 20.0)
ERROR_TICKS_DEG = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0)
TITLE_WIDTH = 150
SURFACE_STRIPES = 45


def write_overview(result: Reconstruction, path: str | PathLike[str]) -> None:
    """Write a PNG with an input image, normals, kept lights, height, a shaded 3-D view and a profile.

    Stripes lie over normals that are a prior, not a measurement, and over what was made of them. Where a method weighs
    all lights instead of choosing some, the standard error of the normals is shown in place of the kept lights.

    Parameters
    ----------
    result : Reconstruction
        From :func:`bgars.reconstruct`.
    path : path
        PNG file to write.

    Raises
    ------
    FileFormatError
        The file cannot be written.
    """
    with matplotlib_style.context({"axes.titley": 1.0}):  # measured titles cost a third of the drawing
        figure = _drawn(result)
        with atomic_file(path) as temporary:
            write_png(figure, temporary)


def _drawn(result: Reconstruction) -> Figure:
    # Without a layout engine, which draws everything twice.
    figure = Figure(figsize=(15.0, 9.4), dpi=DPI, facecolor="white")
    height = result.height
    figure.suptitle(_title(result), fontsize=12, y=0.985)
    axes = figure.subplot_mosaic([["input", "normals", "kept"], ["height", "surface", "profile"]])
    figure.subplots_adjust(left=0.055, right=0.925, bottom=0.085, top=0.89, wspace=0.52, hspace=0.34)
    row = _profile_row(height)
    overlay = prior_overlay(result.field)
    _show_input(figure, axes["input"], result)
    _show_normals(axes["normals"], result, overlay)
    if result.field.method in WEIGHING_METHODS:
        _show_standard_error(figure, axes["kept"], result, overlay)
    else:
        _show_kept_lights(figure, axes["kept"], result)
    _show_height(figure, axes["height"], result, row, overlay)
    _show_surface(axes["surface"], result)
    _show_profile(axes["profile"], result, row)
    return figure


def _title(result: Reconstruction) -> str:
    capture, height = result.capture, result.height
    scale = "pixel pitch unknown" if capture.pixel_pitch_um is None else f"{capture.pixel_pitch_um:g} µm per pixel"
    parts = len(height.components)
    title = (
        f"{capture.name}: {len(capture.rig)} lights, {capture.images.shape[2]} x {capture.images.shape[1]} px, "
        f"{scale}; "
        f"method {result.field.method}; {parts} connected part{'s' if parts != 1 else ''}"
    )
    choice = textwrap.wrap(f"Normals: {result.field.method_reason}", TITLE_WIDTH) if result.field.method_reason else []
    return "\n".join([title, *choice])


def _unit(height: HeightMap) -> str:
    return "µm" if height.unit == "um" else "px"


def _extent(height: HeightMap) -> tuple[float, float, float, float]:
    """Left, right, bottom, top of the image in the height's unit, origin at the image centre."""
    rows, cols = height.mask.shape
    pitch = height.pixel_pitch_um or 1.0
    return (-cols / 2 * pitch, cols / 2 * pitch, -rows / 2 * pitch, rows / 2 * pitch)


def _picture(
    axes: Axes,
    values: NDArray[np.generic],
    height: HeightMap,
    title: str,
    *,
    cmap: str | None = None,
    span: tuple[float, float] = (0.0, 1.0),
) -> AxesImage:
    picture = axes.imshow(
        values,
        extent=_extent(height),
        interpolation="nearest",
        cmap=cmap,
        vmin=span[0],
        vmax=max(span[1], span[0] + 1e-9),
    )
    axes.set_title(title, fontsize=11)
    axes.set_xlabel(f"x ({_unit(height)})")
    axes.set_ylabel(f"y ({_unit(height)})")
    axes.xaxis.set_major_locator(MaxNLocator(5))
    axes.yaxis.set_major_locator(MaxNLocator(5))
    return picture


def _thinned(values: NDArray[Any], height: HeightMap) -> NDArray[Any]:
    """As many pixels as a picture shows: thinned before anything is made of them."""
    step = max(1, int(np.ceil(max(height.mask.shape) / MAX_PICTURE_PX)))
    return values[::step, ::step]


def _beside(axes: Axes) -> Axes:
    """Room for a colour bar as high as the picture."""
    return axes.inset_axes((1.04, 0.0, 0.045, 1.0))


def _show_input(figure: Figure, axes: Axes, result: Reconstruction) -> None:
    capture = result.capture
    image = _thinned(capture.images[0], result.height).astype(np.float32)
    inside = image[_thinned(capture.mask, result.height)]
    top = float(np.percentile(inside if inside.size else image, 99.8))
    rig = capture.rig
    place = f"azimuth {rig.azimuths_deg[0]:.0f}°, elevation {rig.elevations_deg[0]:.0f}°"
    title = f"Input: {light_name(0, capture.files)} of {len(rig)}\n{place}"
    picture = _picture(axes, image, result.height, title, cmap="gray", span=(0.0, top))
    figure.colorbar(picture, cax=_beside(axes), label="grey level")


def _show_normals(axes: Axes, result: Reconstruction, overlay: Overlay) -> None:
    normals = _thinned(result.field.normals, result.height)
    colors = np.where(np.isfinite(normals), (normals + 1.0) / 2.0, 1.0)
    _picture(axes, colors, result.height, "Normals: red = x right, green = y up, blue = z to the camera")
    show_prior(axes, result.field, _extent(result.height), legend=True, overlay=overlay)


def _show_kept_lights(figure: Figure, axes: Axes, result: Reconstruction) -> None:
    most = float(len(result.capture.rig))
    mask, lights_kept = (_thinned(each, result.height) for each in (result.field.mask, result.field.lights_kept))
    kept = np.where(mask, lights_kept, np.nan)
    title = "Lights kept in the fit (white: no normal)"
    picture = _picture(axes, kept, result.height, title, cmap="viridis", span=(min(3.0, most - 1.0), most))
    figure.colorbar(picture, cax=_beside(axes), label="lights", ticks=MaxNLocator(6, integer=True))


def _show_standard_error(figure: Figure, axes: Axes, result: Reconstruction, overlay: Overlay) -> None:
    field = result.field
    mask, error_deg = (_thinned(each, result.height) for each in (field.mask, field.standard_error_deg))
    error_deg = np.where(mask, np.maximum(error_deg, ERROR_LIMITS_DEG[0]), np.nan)
    picture = _picture(
        axes, error_deg, result.height, "Standard error of the normals (white: no normal)", cmap="viridis_r"
    )
    picture.set_norm(LogNorm(*ERROR_LIMITS_DEG))
    bar = figure.colorbar(picture, cax=_beside(axes), label="standard error (°)", ticks=ERROR_TICKS_DEG)
    bar.ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    bar.ax.yaxis.set_minor_formatter(NullFormatter())
    show_prior(axes, field, _extent(result.height), legend=False, overlay=overlay)


def _show_height(figure: Figure, axes: Axes, result: Reconstruction, row: int, overlay: Overlay) -> None:
    height = result.height
    values = _thinned(height.height, height)
    known = values[np.isfinite(values)]
    low, high = (float(level) for level in np.percentile(known if known.size else height.height_px, [0.5, 99.5]))
    whole = len(height.components) == 1
    title = f"Height ({'mean 0' if whole else 'each connected part has mean 0'}; hidden steps are not included)"
    picture = _picture(axes, values, height, title, cmap="cividis", span=(low, high))
    figure.colorbar(picture, cax=_beside(axes), label=f"height ({_unit(height)})")
    y = (height.mask.shape[0] / 2 - row - 0.5) * (height.pixel_pitch_um or 1.0)
    show_prior(axes, result.field, _extent(height), legend=False, overlay=overlay)
    axes.axhline(y, color=MARK_COLOR, linewidth=1.2, linestyle="--")


def _show_surface(axes: Axes, result: Reconstruction) -> None:
    """Shaded relief of the largest part, thinned to a drawable number of points."""
    height = result.height
    largest = int(np.argmax([part.pixels for part in height.components]))
    inside = height.labels == largest
    rows, cols = np.flatnonzero(inside.any(axis=1)), np.flatnonzero(inside.any(axis=0))
    step = max(1, int(np.ceil(max(np.ptp(rows), np.ptp(cols)) / MAX_SURFACE_POINTS)))
    thinned = (slice(rows[0], rows[-1] + 1, step), slice(cols[0], cols[-1] + 1, step))
    pitch = height.pixel_pitch_um or 1.0
    z = np.where(inside[thinned], height.height[thinned], np.nan).astype(np.float64)
    colors = _shaded_colors(z, pitch * step)
    colors *= 1.0 - stripes(prior_pixels(result.field)[thinned], SURFACE_STRIPES)[..., None]
    picture = relief(z, pitch * step, colors, SURFACE_PX)
    axes.imshow(np.asarray(picture))
    axes.set_axis_off()
    part = ", largest part" if len(height.components) > 1 else ""
    wide, deep = (np.ptp(cols) + 1) * pitch, (np.ptp(rows) + 1) * pitch
    rise = float(np.nanmax(z) - np.nanmin(z))
    size = f"{wide:.4g} x {deep:.4g} x {rise:.4g} {_unit(height)} (x, y, z)"
    axes.set_title(f"Surface, true to scale{part}\n{size}", fontsize=11)


def _shaded_colors(z: NDArray[np.float64], spacing: float) -> NDArray[np.float64]:
    """(H, W, 3) colours of a relief: by height, as bright as a light from the lower left makes it."""
    filled = np.where(np.isfinite(z), z, np.nanmin(z))
    slope_down, slope_right = np.gradient(filled, spacing) if min(z.shape) > 1 else (np.zeros_like(z),) * 2
    normals = np.stack([-slope_right, slope_down, np.ones_like(z)], axis=2)
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    brightness = AMBIENT + (1.0 - AMBIENT) * np.clip(normals @ np.array(PICTURE_LIGHT), 0.0, 1.0)
    low, high = np.nanpercentile(z, [0.5, 99.5])
    colors = cividis((filled - low) / max(high - low, 1e-9))
    shaded: NDArray[np.float64] = np.clip(colors * brightness[..., None] * 1.25, 0.0, 1.0)
    return shaded


def _profile_row(height: HeightMap) -> int:
    """The row through the highest point: it crosses a ball, if there is one."""
    highest = int(np.argmax(np.where(height.mask, height.height_px, -np.inf)))
    return highest // int(height.mask.shape[1])


def _show_profile(axes: Axes, result: Reconstruction, row: int) -> None:
    height = result.height
    pitch = height.pixel_pitch_um or 1.0
    cols = height.mask.shape[1]
    x = (np.arange(cols) + 0.5 - cols / 2) * pitch
    axes.plot(x, height.height[row], color=LINE_COLOR, linewidth=1.6, label="measured")
    prior = prior_pixels(result.field)[row]
    if prior.any():
        drawn = np.where(prior, height.height[row], np.nan)
        axes.plot(x, drawn, color=PRIOR_COLOR, linewidth=2.4, marker=".", markersize=3, label=prior_label(result.field))
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2), frameon=False, fontsize=9, ncols=2)
    rise = float(np.ptp(height.height[row][height.mask[row]]))
    flat = rise < FLAT_PROFILE * cols * pitch
    if flat:
        axes.set_box_aspect(0.6)
    else:
        axes.set_aspect("equal", adjustable="box")
    axes.margins(x=0.0, y=0.12)
    axes.xaxis.set_major_locator(MaxNLocator(5))
    scale = "height stretched" if flat else "true to scale"
    axes.set_title(f"Profile along row {row} (dashed line), {scale}", fontsize=11)
    axes.set_xlabel(f"x ({_unit(height)})")
    axes.set_ylabel(f"height ({_unit(height)})")
    axes.grid(visible=True, color="0.88", linewidth=0.8)
    axes.spines[["top", "right"]].set_visible(False)
