"""One picture of a reconstruction to show a colleague."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.colors import LightSource
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from bgars.io.atomic import atomic_file

if TYPE_CHECKING:
    from os import PathLike

    from matplotlib.axes import Axes
    from mpl_toolkits.mplot3d import Axes3D

    from bgars.pipeline import Reconstruction
    from bgars.records import FloatArray, HeightMap

__all__ = ["write_overview"]

MAX_SURFACE_POINTS = 240
MAX_PICTURE_PX = 1600
DPI = 140
SURFACE_COLOR = (0.80, 0.82, 0.86)
LINE_COLOR = "#1f4e79"
MARK_COLOR = "#d1495b"


def write_overview(result: Reconstruction, path: str | PathLike[str]) -> None:
    """Write a PNG with an input image, normals, kept lights, height, a shaded 3-D view and a profile.

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
    figure = Figure(figsize=(15.0, 9.4), dpi=DPI, layout="constrained", facecolor="white")
    height = result.height
    figure.suptitle(_title(result), fontsize=14)
    axes = figure.subplot_mosaic(
        [["input", "normals", "kept"], ["height", "surface", "profile"]],
        per_subplot_kw={"surface": {"projection": "3d"}},
    )
    row = _profile_row(height)
    _show_input(figure, axes["input"], result)
    _show_normals(axes["normals"], result)
    _show_kept_lights(figure, axes["kept"], result)
    _show_height(figure, axes["height"], height, row)
    _show_surface(axes["surface"], height)
    _show_profile(axes["profile"], height, row)
    with atomic_file(path) as temporary:
        figure.savefig(temporary, format="png")


def _title(result: Reconstruction) -> str:
    capture, height = result.capture, result.height
    scale = "pixel pitch unknown" if capture.pixel_pitch_um is None else f"{capture.pixel_pitch_um:g} µm per pixel"
    parts = len(height.components)
    return (
        f"{capture.name}: {len(capture.rig)} lights, {capture.images.shape[2]} x {capture.images.shape[1]} px, {scale}; "
        f"method {result.field.method}; {parts} connected part{'s' if parts != 1 else ''}"
    )


def _unit(height: HeightMap) -> str:
    return "µm" if height.unit == "um" else "px"


def _extent(height: HeightMap) -> tuple[float, float, float, float]:
    """Left, right, bottom, top of the image in the height's unit, origin at the image centre."""
    rows, cols = height.mask.shape
    pitch = height.pixel_pitch_um or 1.0
    return (-cols / 2 * pitch, cols / 2 * pitch, -rows / 2 * pitch, rows / 2 * pitch)


def _picture(axes: Axes, values: Any, height: HeightMap, title: str, **kwargs: Any) -> Any:
    step = max(1, int(np.ceil(max(height.mask.shape) / MAX_PICTURE_PX)))
    picture = axes.imshow(values[::step, ::step], extent=_extent(height), interpolation="nearest", **kwargs)
    axes.set_title(title, fontsize=11)
    axes.set_xlabel(f"x ({_unit(height)})")
    axes.set_ylabel(f"y ({_unit(height)})")
    axes.xaxis.set_major_locator(MaxNLocator(5))
    axes.yaxis.set_major_locator(MaxNLocator(5))
    return picture


def _show_input(figure: Figure, axes: Axes, result: Reconstruction) -> None:
    capture = result.capture
    image = np.asarray(capture.images[0], dtype=np.float32)
    top = float(np.percentile(image[capture.mask], 99.8))
    rig = capture.rig
    title = f"Input: light 1 of {len(rig)} (azimuth {rig.azimuths_deg[0]:.0f}°, elevation {rig.elevations_deg[0]:.0f}°)"
    picture = _picture(axes, image, result.height, title, cmap="gray", vmin=0.0, vmax=max(top, 1e-12))
    figure.colorbar(picture, ax=axes, label="grey level", shrink=0.85)


def _show_normals(axes: Axes, result: Reconstruction) -> None:
    normals = result.field.normals
    colors = np.where(np.isfinite(normals), (normals + 1.0) / 2.0, 1.0)
    _picture(axes, colors, result.height, "Normals: red = x right, green = y up, blue = z to the camera")


def _show_kept_lights(figure: Figure, axes: Axes, result: Reconstruction) -> None:
    lights = len(result.capture.rig)
    kept = np.where(result.field.mask, result.field.lights_kept, 0).astype(np.float32)
    kept[~result.field.mask] = np.nan
    picture = _picture(
        axes, kept, result.height, "Lights kept in the fit (white: no normal)", cmap="viridis", vmin=3, vmax=max(lights, 4)
    )
    figure.colorbar(picture, ax=axes, label="lights", shrink=0.85, ticks=MaxNLocator(6, integer=True))


def _show_height(figure: Figure, axes: Axes, height: HeightMap, row: int) -> None:
    values = height.height
    low, high = np.nanpercentile(values, [0.5, 99.5])
    picture = _picture(
        axes, values, height, "Height (each connected part has mean 0)", cmap="cividis", vmin=low, vmax=max(high, low + 1e-9)
    )
    figure.colorbar(picture, ax=axes, label=f"height ({_unit(height)})", shrink=0.85)
    y = (height.mask.shape[0] / 2 - row - 0.5) * (height.pixel_pitch_um or 1.0)
    axes.axhline(y, color=MARK_COLOR, linewidth=1.2, linestyle="--")


def _show_surface(axes: Axes3D, height: HeightMap) -> None:
    """Shaded relief of the largest part, thinned to a drawable number of points."""
    largest = int(np.argmax([part.pixels for part in height.components]))
    inside = height.labels == largest
    rows, cols = np.flatnonzero(inside.any(axis=1)), np.flatnonzero(inside.any(axis=0))
    window = (slice(rows[0], rows[-1] + 1), slice(cols[0], cols[-1] + 1))
    values = np.where(inside, height.height, np.nan)[window]
    step = max(1, int(np.ceil(max(values.shape) / MAX_SURFACE_POINTS)))
    pitch = height.pixel_pitch_um or 1.0
    z = values[::step, ::step].astype(np.float64)
    shape = height.mask.shape
    x = (np.arange(cols[0], cols[-1] + 1)[::step] + 0.5 - shape[1] / 2) * pitch
    y = (shape[0] / 2 - np.arange(rows[0], rows[-1] + 1)[::step] - 0.5) * pitch
    grid_x, grid_y = np.meshgrid(x, y)
    filled = np.where(np.isfinite(z), z, np.nanmin(z))
    # Row 0 is the top of the image, so dy is negative; the light stands where the camera of the picture can see its effect.
    light = LightSource(azdeg=300, altdeg=50)
    base = np.broadcast_to(np.array(SURFACE_COLOR), (*z.shape, 3))
    spacing = pitch * step
    shaded = light.shade_rgb(base, filled, vert_exag=1.0, dx=spacing, dy=-spacing, blend_mode="soft", fraction=1.0)
    faces = np.concatenate([shaded, np.isfinite(z)[..., None].astype(np.float64)], axis=2)
    axes.plot_surface(grid_x, grid_y, z, facecolors=faces, rstride=1, cstride=1, linewidth=0, antialiased=False, shade=False)
    span = [np.ptp(x) or 1.0, np.ptp(y) or 1.0, max(float(np.nanmax(z) - np.nanmin(z)), 0.05 * max(np.ptp(x), np.ptp(y)))]
    axes.set_box_aspect(span, zoom=1.15)
    axes.view_init(elev=38, azim=-62)
    axes.set_title("Surface, true to scale" + (" (largest part)" if len(height.components) > 1 else ""), fontsize=11)
    axes.set_xlabel(f"x ({_unit(height)})", labelpad=8)
    axes.set_ylabel(f"y ({_unit(height)})", labelpad=8)
    axes.set_zlabel(f"z ({_unit(height)})", labelpad=2)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(4))
    axes.zaxis.set_major_locator(MaxNLocator(3))
    axes.tick_params(labelsize=8)


def _profile_row(height: HeightMap) -> int:
    """The row through the highest point of the smoothed height: it crosses a ball, if there is one."""
    values: FloatArray = np.where(height.mask, height.height_px, -np.inf).astype(np.float32)
    return int(np.unravel_index(int(np.argmax(values)), values.shape)[0])


def _show_profile(axes: Axes, height: HeightMap, row: int) -> None:
    pitch = height.pixel_pitch_um or 1.0
    cols = height.mask.shape[1]
    x = (np.arange(cols) + 0.5 - cols / 2) * pitch
    axes.plot(x, height.height[row], color=LINE_COLOR, linewidth=1.6)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_title(f"Profile along row {row} (dashed line), true to scale", fontsize=11)
    axes.set_xlabel(f"x ({_unit(height)})")
    axes.set_ylabel(f"height ({_unit(height)})")
    axes.grid(visible=True, color="0.88", linewidth=0.8)
    axes.spines[["top", "right"]].set_visible(False)
