"""The pictures of an inspection."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from bgars.errors import InputError
from bgars.io.atomic import atomic_file

if TYPE_CHECKING:
    from os import PathLike

    from bgars.records.capture import Capture
    from bgars.records.part_result import PartResult

__all__ = ["PICTURES", "write_part_pictures"]

PICTURES = {
    "part.png": "the picture to look at first: every ball outlined, named, coloured by its deviation",
    "shadows.png": "the fitted shadows over the images: what heights rest on",
    "deviations.png": "maps of heights and of offsets from the grid",
    "histograms.png": "how readings are spread, against their limits",
}


def write_part_pictures(result: PartResult, capture: Capture, folder: str | PathLike[str]) -> dict[str, str]:
    """Write four PNG files of an inspection.

    Parameters
    ----------
    result : PartResult
        From :func:`bgars.inspect`.
    capture : Capture
        That it was made from.
    folder : path
        An existing folder.

    Returns
    -------
    dict of str
        Names of the files and what they show.

    Raises
    ------
    InputError
        A capture without a pixel pitch, or with another number of lights than the result.
    FileFormatError
        A file cannot be written.
    """
    if capture.pixel_pitch_um is None:
        msg = "capture.pixel_pitch_um: needed for pictures in um, got none"
        raise InputError(msg)
    if len(result.light_directions) != len(capture.images):
        msg = f"capture: must have the {len(result.light_directions)} lights of the result, got {len(capture.images)}"
        raise InputError(msg)
    # Imported here: the names of the pictures are wanted where matplotlib is not.
    from bgars.report.figures.balls import part_figure  # noqa: PLC0415
    from bgars.report.figures.histograms import histogram_figure  # noqa: PLC0415
    from bgars.report.figures.maps import deviation_figure  # noqa: PLC0415
    from bgars.report.figures.shadows import shadow_figure  # noqa: PLC0415
    from bgars.report.figures.style import figure_style, save  # noqa: PLC0415
    from bgars.report.identity import identity_line  # noqa: PLC0415

    folder = Path(folder)
    with figure_style():
        figures = {
            "part.png": part_figure(result, capture),
            "shadows.png": shadow_figure(result, capture),
            "deviations.png": deviation_figure(result),
            "histograms.png": histogram_figure(result),
        }
        line = identity_line(result.to_dict())
        for name, figure in figures.items():
            figure.text(0.995, 0.997, line, ha="right", va="top", fontsize=6, color="0.35", parse_math=False)
            with atomic_file(folder / name) as temporary:
                save(figure, temporary)
    return dict(PICTURES)
