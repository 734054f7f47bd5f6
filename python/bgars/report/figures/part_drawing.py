"""The pictures of an inspection, drawn and written."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import TYPE_CHECKING

from bgars.io.atomic import atomic_file
from bgars.report.figure_file import drawn, write_drawn
from bgars.report.figures.balls import part_figure
from bgars.report.figures.histograms import histogram_figure
from bgars.report.figures.maps import deviation_figure
from bgars.report.figures.shadows import shadow_figure
from bgars.report.figures.style import figure_style
from bgars.report.identity import identity_line

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from matplotlib.figure import Figure

    from bgars.records.capture import Capture
    from bgars.records.part_result import PartResult
    from bgars.report.figure_file import Drawn

__all__ = ["draw_part_pictures"]


def draw_part_pictures(result: PartResult, capture: Capture, folder: Path) -> None:
    """Draw and write them, from a thinned capture."""
    line = identity_line(result.to_dict())
    figures: dict[str, Callable[[], Figure]] = {
        "part.png": partial(part_figure, result, capture),
        "shadows.png": partial(shadow_figure, result, capture),
        "deviations.png": partial(deviation_figure, result),
        "histograms.png": partial(histogram_figure, result),
    }
    with figure_style(), ThreadPoolExecutor(1) as beside:
        written = []
        for name, make in figures.items():
            figure = make()
            figure.text(0.995, 0.997, line, ha="right", va="top", fontsize=6, color="0.35", parse_math=False)
            # One is compressed while the next is drawn.
            written.append(beside.submit(_write, drawn(figure), folder / name))
        for each in written:
            each.result()


def _write(picture: Drawn, path: Path) -> None:
    with atomic_file(path) as temporary:
        write_drawn(picture, temporary)
