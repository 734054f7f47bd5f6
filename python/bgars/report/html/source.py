"""What the page is made from: the content of result.json, and what lies beside it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from bgars.report.html.photograph import SIDE_FILE, Lamp, Photograph, lamps_of, photograph_of, read_side_files

if TYPE_CHECKING:
    from pathlib import Path

    from bgars.records.capture import Capture
    from bgars.records.part_result import PartResult
    from bgars.records.part_surface import PartSurface

__all__ = ["PageSource", "read_page_source", "source_of"]


@dataclass(frozen=True, eq=False)
class PageSource:
    """Everything on the page.

    Attributes
    ----------
    result : dict
        As :meth:`bgars.PartResult.to_dict` returns it; None = not measured.
    photograph : Photograph or None
        The part as the camera saw it.
    lamps : tuple of Lamp
        The lights as the rig gives them; empty when unknown.
    surface : PartSurface or None
        Integrated heights; None: the 3-D view falls back to spheroids.
    warnings : tuple of str
        What lies beside the result but could not be used.
    """

    result: dict[str, Any]
    photograph: Photograph | None = None
    lamps: tuple[Lamp, ...] = ()
    surface: PartSurface | None = None
    warnings: tuple[str, ...] = ()


def source_of(result: PartResult, capture: Capture | None) -> PageSource:
    """Gather the page of an inspection that was just made."""
    if capture is None:
        return PageSource(result.to_dict(), surface=result.surface)
    return PageSource(result.to_dict(), photograph_of(capture), lamps_of(capture), result.surface)


def read_page_source(path: Path) -> PageSource:
    """Read result.json (or the folder that holds it), and photograph and surface that lie beside it.

    Raises
    ------
    FileFormatError
        There is no result, or it is not one.
    """
    from bgars.io.result_file import read_result  # noqa: PLC0415 - its schema is not needed for a result just made

    result = read_result(path).to_dict()
    folder = path if path.is_dir() else path.parent
    return PageSource(result, *read_side_files(folder / SIDE_FILE))
