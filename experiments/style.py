"""Look of the figures: colours that colour-blind readers tell apart, the same for a method everywhere."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from bgars.normals.methods import METHODS
from matplotlib import colormaps
from matplotlib import style as matplotlib_style
from matplotlib.figure import Figure

if TYPE_CHECKING:
    from contextlib import AbstractContextManager
    from pathlib import Path

    from matplotlib.axes import Axes

__all__ = ["TRUTH_STYLE", "figure_style", "method_style", "new_figure", "panels", "save", "tidy", "value_colors"]

OKABE_ITO = ("#D55E00", "#0072B2", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
"""Okabe and Ito, Color universal design, 2008."""
MARKERS = "os^Dv*"
LINES = ("-", "--", "-.", ":", (0, (5, 1)), (0, (3, 1, 1, 1)))
TRUTH_STYLE: dict[str, Any] = {
    "color": "black",
    "linewidth": 1.2,
    "linestyle": (0, (4, 2)),
    "zorder": 4,
    "label": "truth",
}
DPI = 100
SETTINGS = {"font.size": 10, "axes.titlesize": 10, "axes.labelsize": 10, "legend.fontsize": 9, "legend.frameon": False}


def figure_style() -> AbstractContextManager[None]:
    """The settings to draw and save under, whatever the user's own are."""
    context: AbstractContextManager[None] = matplotlib_style.context(["default", SETTINGS])
    return context


def new_figure(width_in: float, height_in: float) -> Figure:
    """Return an empty white figure, laid out by constraints."""
    return Figure(figsize=(width_in, height_in), dpi=DPI, layout="constrained", facecolor="white")


def panels(figure: Any, rows: int, cols: int, **options: Any) -> list[list[Axes]]:  # noqa: ANN401 - a figure or a part of one
    """Return the axes of a grid, row by row."""
    return [list(row) for row in figure.subplots(rows, cols, squeeze=False, **options)]


def method_style(method: str) -> dict[str, Any]:
    """Colour, marker and line of a method, by its place in METHODS."""
    place = [str(name) for name in METHODS].index(method)
    return {
        "color": OKABE_ITO[place % len(OKABE_ITO)],
        "marker": MARKERS[place % len(MARKERS)],
        "linestyle": LINES[place % len(LINES)],
        "markersize": 5,
        "label": method,
    }


def value_colors(count: int) -> list[Any]:
    """Colours of increasing values, dark to light, none too pale to see."""
    return list(colormaps["viridis"](np.linspace(0.0, 0.88, count)))


def tidy(axes: Axes) -> None:
    """A light grid and no box."""
    axes.grid(visible=True, color="0.88", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def save(figure: Figure, path: Path) -> None:
    """Write a PNG that names bgars and no other software: the same figure, the same file."""
    figure.savefig(path, format="png", metadata={"Software": "bgars"}, pil_kwargs={"optimize": True})
