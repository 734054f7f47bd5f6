"""The files of an inspection in its folder."""

from __future__ import annotations

import json
from contextlib import suppress
from typing import TYPE_CHECKING, NamedTuple

import bgars
from bgars.cli.drawing import PART_PICTURES
from bgars.errors import FileFormatError
from bgars.io.atomic import FolderNames, atomic_folder
from bgars.io.own_files import foreign_files
from bgars.line.strip_page import PLACE
from bgars.report.figures.part import PICTURES, check_pictures, thinned
from bgars.report.html.files import REPORT_FILES

if TYPE_CHECKING:
    from pathlib import Path

    from bgars.records.capture import Capture
    from bgars.records.part_result import PartResult
    from bgars.report.figures.process import PictureProcess

__all__ = ["NAMES", "STRIP_FILES", "Wanted", "clear_places", "refuse_foreign_places", "start_pictures", "write_result"]

FILES = {
    "result.json": "everything: readings, uncertainties, limits, verdicts, reasons, checksums of the input",
    "balls.csv": "one row per ball, for a spreadsheet",
}
STRIP_FILES = {
    "strip.html": "the overview: every place with its verdict, and links to the parts",
    "parts.csv": "one row per part, for a spreadsheet",
}
PARQUET = "balls.parquet"
CFX = "cfx.json"
NAMES = FolderNames(
    frozenset({*FILES, *STRIP_FILES, *PICTURES, *REPORT_FILES, PARQUET, CFX}), frozenset({"result.json", PARQUET, CFX})
)


class Wanted(NamedTuple):
    """What is written beside result.json and balls.csv."""

    pictures: bool
    page: bool
    parquet: bool
    cfx: bool


def start_pictures(painter: PictureProcess, result: PartResult, capture: Capture, place: Path) -> None:
    """Begin to draw the pictures of a part, which need no surface."""
    check_pictures(result, capture)
    painter.start(PART_PICTURES, "draw_part_pictures", result, thinned(capture), place)


def write_result(
    result: PartResult, capture: Capture, place: Path, wanted: Wanted, painter: PictureProcess | None = None
) -> dict[str, str]:
    """Write the files of a part into a folder; return their names and what they are.

    `painter` draws the pictures since :func:`start_pictures`.
    """
    files = dict(FILES)
    if painter is None and wanted.pictures:
        files |= bgars.write_part_pictures(result, capture, place)
    (place / "result.json").write_text(result.to_json(), encoding="utf-8")
    (place / "balls.csv").write_text(result.to_csv(), encoding="utf-8")
    pages = bgars.write_report(result, place / "report.html", capture=capture) if wanted.page else {}
    if painter is not None:
        painter.finish()
        files |= PICTURES
    files = {name: pages.pop(name) for name in ("report.html",) if wanted.page} | files | pages
    if wanted.parquet:
        bgars.write_parquet(result, place / PARQUET)
        files[PARQUET] = "the same in full digits, units in the columns' metadata"
    if wanted.cfx:
        (place / CFX).write_text(json.dumps(bgars.to_cfx(result), indent=2) + "\n", encoding="utf-8")
        files[CFX] = "IPC-CFX message UnitsInspected"
    return files


def refuse_foreign_places(output: Path) -> None:
    """Refuse folders of places that hold files of these names which bgars did not write, before anything is touched.

    Raises
    ------
    FileFormatError
        There is one.
    """
    for folder in _places(output):
        found = foreign_files(folder, NAMES.written)
        if found:
            msg = (
                f"{folder}: holds {', '.join(found)}, which bgars did not write: nothing of it is overwritten; "
                "name another folder with -o, or move what is there"
            )
            raise FileFormatError(msg)


def clear_places(output: Path) -> None:
    """Remove what an earlier run on a strip left in the folders of its places: no verdict of it may stay."""
    for folder in _places(output):
        with atomic_folder(folder, NAMES):
            pass
        with suppress(OSError):  # something of somebody else is in it
            folder.rmdir()


def _places(output: Path) -> list[Path]:
    if not output.is_dir():
        return []
    return sorted(folder for folder in output.iterdir() if folder.is_dir() and PLACE.fullmatch(folder.name))
