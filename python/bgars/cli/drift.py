"""The command ``bgars calibrate drift``, which is ``bgars check --station``, too."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

import bgars
from bgars.cli.calibrate_station import (
    FolderArgument,
    JsonOption,
    OutlineOption,
    circles_of,
    raw_capture,
    said_values,
)
from bgars.cli.camera_option import CameraOption, seen_by
from bgars.cli.console import print_json, say, utc_now
from bgars.cli.station_output import shown_severity
from bgars.errors import CalibrationError, InputError
from bgars.io.station_file import read_station
from bgars.records.result_text import log_pairs
from bgars.station import drift as station_drift
from bgars.station.drift import COMPARED

if TYPE_CHECKING:
    from bgars.records.remark import Remark

__all__ = ["drift", "register"]

EXIT_MOVED = 1
LARGEST = {
    "light_moved_deg": "light-moved",
    "light_strength": "light-strength",
    "evenness": "evenness",
    "level": "level",
    "scale": "scale",
}
"""Keys of the log line, and the codes whose largest change they hold."""


def register(group: typer.Typer) -> None:
    """Add the command to the group ``calibrate``."""
    group.command("drift")(drift)


def drift(
    folder: FolderArgument,
    station: Annotated[Path, typer.Option(metavar="STATION.toml", help="The station.", show_default=False)],
    reference: Annotated[
        Literal["mirror", "matt", "flat"] | None,
        typer.Option(help="Reference in view; by default the kind of ball of the calibration.", show_default=False),
    ] = None,
    outline: OutlineOption = None,
    camera: CameraOption = None,
    as_json: JsonOption = False,
    log_line: Annotated[
        bool, typer.Option("--log", help="Print one line of key=value pairs for a log instead of text.")
    ] = False,
) -> None:
    """Say what moved since the calibration, on a new capture of its reference.

    Exit code 0: nothing beyond its limit. 1: something moved. 2: wrong use, or the reference cannot be read.
    """
    if as_json and log_line:
        msg = "--log and --json: give one of them"
        raise InputError(msg)
    known = read_station(station)
    kind = reference or (known.lights.sphere if known.lights is not None else "flat")
    capture = seen_by(raw_capture(folder, replace(known, scale=None) if kind == "flat" else known), camera)
    circles = circles_of(outline, [capture])
    try:
        found = station_drift(known, capture, reference=reference, outline=None if circles is None else circles[0])
    except CalibrationError as error:
        if reference is not None or kind == "flat":
            raise
        msg = (
            f"{error}; the folder was read as one of the {kind} ball of the calibration: is it a board (bgars "
            "calibrate drift --reference flat), or a part, which is no reference (bgars check without --station)?"
        )
        raise CalibrationError(msg) from None
    moved = [finding for finding in found if finding.severity == "fail"]
    if as_json:
        print_json({"station": str(station), "moved": len(moved), **said_values(found)})
    elif log_line:
        say(_log_line(known.name, capture.name, found))
    else:
        _tell(known.name, found)
    if moved:
        raise typer.Exit(EXIT_MOVED)


def _tell(name: str, found: tuple[Remark, ...]) -> None:
    for finding in found:
        if finding.severity != "note":
            say(f"{shown_severity(finding)}: {finding.message}")
    compared = sum(finding.code in COMPARED for finding in found)
    moved = sum(finding.severity == "fail" for finding in found)
    say(
        f"{name}: {moved} of {compared} comparisons exceed the limit"
        if moved
        else f"{name}: nothing moved ({compared} comparisons)"
    )
    for finding in found:
        if finding.code == "not-compared":
            say(f"note: {finding.message}")


def _log_line(station: str, capture: str, found: tuple[Remark, ...]) -> str:
    """The comparison, as key=value pairs: of many lights the largest change."""
    moved = [finding for finding in found if finding.severity == "fail"]
    doubts = [finding for finding in found if finding.severity == "doubt"]

    def largest(code: str) -> float | None:
        values = [finding.value for finding in found if finding.code == code and finding.value is not None]
        return max(values, key=abs, default=None)

    pairs: dict[str, float | str | None] = {
        "time": utc_now(),
        "station": station,
        "capture": capture,
        "verdict": "fail" if moved else "pass",
        "moved": len(moved),
        "compared": sum(finding.code in COMPARED for finding in found),
        **{key: largest(code) for key, code in LARGEST.items()},
        "reason": moved[0].message if moved else "",
        "warnings": len(doubts),
        "version": bgars.__version__,
    }
    return log_pairs(pairs)
