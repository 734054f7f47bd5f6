"""One picture of a reconstruction to show a colleague."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib import style as matplotlib_style
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator, NullFormatter

from bgars.io.atomic import atomic_file
from bgars.report.figure_file import write_png
from bgars.report.figures.overview_content import overview_content
from bgars.report.figures.prior import show_prior
from bgars.report.figures.relief import relief

if TYPE_CHECKING:
    from os import PathLike

    from matplotlib.axes import Axes
    from matplotlib.image import AxesImage
    from numpy.typing import NDArray

    from bgars.pipelines.reconstruct import Reconstruction
    from bgars.report.figures.overview_content import OverviewContent

__all__ = ["draw_overview", "write_overview"]

SURFACE_PX = 760
DPI = 140
FLAT_PROFILE = 0.2
LINE_COLOR = "#1f4e79"
MARK_COLOR = "#d1495b"
PRIOR_COLOR = "#e69f00"
ERROR_LIMITS_DEG = (0.05, 20.0)
ERROR_TICKS_DEG = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0)


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
    draw_overview(overview_content(result), path)


def draw_overview(content: OverviewContent, path: str | PathLike[str]) -> None:
    """Draw the picture and write it."""
    with matplotlib_style.context({"axes.titley": 1.0}):  # measured titles cost a third of the drawing
        figure = _drawn(content)
        with atomic_file(path) as temporary:
            write_png(figure, temporary)


def _drawn(content: OverviewContent) -> Figure:
    # Without a layout engine, which draws everything twice.
    figure = Figure(figsize=(15.0, 9.4), dpi=DPI, facecolor="white")
    figure.suptitle(content.title, fontsize=12, y=0.985)
    axes = figure.subplot_mosaic([["input", "normals", "kept"], ["height", "surface", "profile"]])
    figure.subplots_adjust(left=0.055, right=0.925, bottom=0.085, top=0.89, wspace=0.52, hspace=0.34)
    _show_input(figure, axes["input"], content)
    _show_normals(axes["normals"], content)
    if content.error_deg is not None:
        _show_standard_error(figure, axes["kept"], content, content.error_deg)
    elif content.kept is not None:
        _show_kept_lights(figure, axes["kept"], content, content.kept)
    _show_height(figure, axes["height"], content)
    _show_surface(axes["surface"], content)
    _show_profile(axes["profile"], content)
    return figure


def _picture(
    axes: Axes,
    values: NDArray[np.generic],
    content: OverviewContent,
    title: str,
    *,
    cmap: str | None = None,
    span: tuple[float, float] = (0.0, 1.0),
) -> AxesImage:
    picture = axes.imshow(
        values,
        extent=content.extent,
        interpolation="nearest",
        cmap=cmap,
        vmin=span[0],
        vmax=max(span[1], span[0] + 1e-9),
    )
    axes.set_title(title, fontsize=11)
    axes.set_xlabel(f"x ({content.unit})")
    axes.set_ylabel(f"y ({content.unit})")
    axes.xaxis.set_major_locator(MaxNLocator(5))
    axes.yaxis.set_major_locator(MaxNLocator(5))
    return picture


def _beside(axes: Axes) -> Axes:
    """Room for a colour bar as high as the picture."""
    return axes.inset_axes((1.04, 0.0, 0.045, 1.0))


def _show_input(figure: Figure, axes: Axes, content: OverviewContent) -> None:
    image, span = content.image.astype(np.float32), (0.0, content.image_top)
    picture = _picture(axes, image, content, content.image_title, cmap="gray", span=span)
    figure.colorbar(picture, cax=_beside(axes), label="grey level")


def _show_normals(axes: Axes, content: OverviewContent) -> None:
    colors = np.where(np.isfinite(content.normals), (content.normals + 1.0) / 2.0, 1.0)
    _picture(axes, colors, content, "Normals: red = x right, green = y up, blue = z to the camera")
    show_prior(axes, content.overlay, content.extent, legend=content.prior_legend)


def _show_kept_lights(figure: Figure, axes: Axes, content: OverviewContent, kept: NDArray[np.float64]) -> None:
    most = float(content.lights)
    title = "Lights kept in the fit (white: no normal)"
    picture = _picture(axes, kept, content, title, cmap="viridis", span=(min(3.0, most - 1.0), most))
    figure.colorbar(picture, cax=_beside(axes), label="lights", ticks=MaxNLocator(6, integer=True))


def _show_standard_error(figure: Figure, axes: Axes, content: OverviewContent, error_deg: NDArray[np.float32]) -> None:
    shown = np.maximum(error_deg, np.float32(ERROR_LIMITS_DEG[0]))
    picture = _picture(axes, shown, content, "Standard error of the normals (white: no normal)", cmap="viridis_r")
    picture.set_norm(LogNorm(*ERROR_LIMITS_DEG))
    bar = figure.colorbar(picture, cax=_beside(axes), label="standard error (°)", ticks=ERROR_TICKS_DEG)
    bar.ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    bar.ax.yaxis.set_minor_formatter(NullFormatter())
    show_prior(axes, content.overlay, content.extent)


def _show_height(figure: Figure, axes: Axes, content: OverviewContent) -> None:
    whole = content.parts == 1
    title = f"Height ({'mean 0' if whole else 'each connected part has mean 0'}; hidden steps are not included)"
    picture = _picture(axes, content.height, content, title, cmap="cividis", span=content.height_range)
    figure.colorbar(picture, cax=_beside(axes), label=f"height ({content.unit})")
    show_prior(axes, content.overlay, content.extent)
    axes.axhline(content.profile.y, color=MARK_COLOR, linewidth=1.2, linestyle="--")


def _show_surface(axes: Axes, content: OverviewContent) -> None:
    surface = content.surface
    axes.imshow(np.asarray(relief(surface.z, surface.spacing, surface.colors, SURFACE_PX)))
    axes.set_axis_off()
    axes.set_title(surface.title, fontsize=11)


def _show_profile(axes: Axes, content: OverviewContent) -> None:
    profile = content.profile
    x = (np.arange(profile.cols) + 0.5 - profile.cols / 2) * profile.pitch
    axes.plot(x, profile.height, color=LINE_COLOR, linewidth=1.6, label="measured")
    if profile.prior.any():
        drawn = np.where(profile.prior, profile.height, np.nan)
        axes.plot(x, drawn, color=PRIOR_COLOR, linewidth=2.4, marker=".", markersize=3, label=content.prior)
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2), frameon=False, fontsize=9, ncols=2)
    flat = profile.rise < FLAT_PROFILE * profile.cols * profile.pitch
    if flat:
        axes.set_box_aspect(0.6)
    else:
        axes.set_aspect("equal", adjustable="box")
    axes.margins(x=0.0, y=0.12)
    axes.xaxis.set_major_locator(MaxNLocator(5))
    scale = "height stretched" if flat else "true to scale"
    axes.set_title(f"Profile along row {profile.row} (dashed line), {scale}", fontsize=11)
    axes.set_xlabel(f"x ({content.unit})")
    axes.set_ylabel(f"height ({content.unit})")
    axes.grid(visible=True, color="0.88", linewidth=0.8)
    axes.spines[["top", "right"]].set_visible(False)
