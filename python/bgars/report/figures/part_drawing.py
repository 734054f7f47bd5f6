"""The pictures of an inspection, drawn and written."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bgars.io.atomic import atomic_file
from bgars.report.figures.balls import part_figure
from bgars.report.figures.histograms import histogram_figure
from bgars.report.figures.maps import deviation_figure
from bgars.report.figures.shadows import shadow_figure
from bgars.report.figures.style import figure_style, save
from bgars.report.identity import identity_line

if TYPE_CHECKING:
    from pathlib import Path

    from bgars.records.capture import Capture
    from bgars.records.part_result import PartResult

__all__ = ["draw_part_pictures"]


def draw_part_pictures(result: PartResult, capture: Capture, folder: Path) -> None:
    """Draw and write them, from a thinned capture."""
    line = identity_line(result.to_dict())
    with figure_style():
        figures = {
            "part.png": part_figure(result, capture),
            "shadows.png": shadow_figure(result, capture),
            "deviations.png": deviation_figure(result),
            "histograms.png": histogram_figure(result),
        }
        for name, figure in figures.items():
            figure.text(0.995, 0.997, line, ha="right", va="top", fontsize=6, color="0.35", parse_math=False)
            with atomic_file(folder / name) as temporary:
                save(figure, temporary)
