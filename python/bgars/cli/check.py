"""The command ``bgars check``."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import bgars
from bgars.checks.response import DOUBT
from bgars.cli.calibrate_station import OutlineOption
from bgars.cli.camera_option import CameraOption
from bgars.cli.console import print_json, say
from bgars.cli.drift import drift
from bgars.errors import CaptureWarning, InputError
from bgars.files.counted import counted
from bgars.io.atomic import FolderNames, atomic_file, atomic_folder
from bgars.io.given_paths import need_folder, need_output
from bgars.io.own_files import need_new_or_own
from bgars.report.html.check_page import check_page

if TYPE_CHECKING:
    from bgars.records.findings import Findings

__all__ = ["EXIT_WRONG", "register"]

EXIT_WRONG = 1
PAGE_NAME = "check.html"
NAMES = FolderNames(frozenset({PAGE_NAME}), frozenset(), judged=False)
PAGE_SUFFIXES = (".html", ".htm")


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("check")(check)


def check(
    folder: Annotated[
        Path,
        typer.Argument(metavar="FOLDER", help="Capture folder, as for bgars reconstruct.", show_default=False),
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="PAGE",
            help="Page with a picture for each finding: a file .html, or a folder that gets check.html.",
            show_default=False,
        ),
    ] = None,
    station: Annotated[
        Path | None,
        typer.Option(
            metavar="STATION.toml",
            help="Compare with the calibration of this station: FOLDER shows its reference again.",
            show_default=False,
        ),
    ] = None,
    outline: OutlineOption = None,
    camera: CameraOption = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of text.")] = False,
    log_line: Annotated[
        bool,
        typer.Option("--log", help="With --station: print one line of key=value pairs for a log instead of text."),
    ] = False,
) -> None:
    """Check whether images and lights belong together, and find other faults of a capture, before it is measured.

    Order and handedness of the lights, lights below the surface, the same image twice, dead and uneven lamps, exposure,
    partly lit frames, ambient light, vignetting, motion, focus, noise, response, bit depth. What a capture cannot show
    (a flat part has no shading) is not judged. With --station (and --outline, --camera, --log): changes since its
    calibration (docs/station.md).

    Exit code 0: no error was found (there may be warnings). 1: an error was found: numbers from this capture would be
    wrong. 2: wrong use, or a capture that cannot be read.
    """
    need_folder(folder)
    if station is not None:
        if output is not None:
            msg = "--station, --output: give one of them; bgars calibrate writes the page of a station"
            raise InputError(msg)
        drift(folder, station, None, outline, camera, as_json, log_line)
        return
    if alone := [name for name, given in (("--outline", outline), ("--camera", camera), ("--log", log_line)) if given]:
        msg = f"{alone[0]}: goes with --station only; a capture that is checked by itself has no use for it"
        raise InputError(msg)
    if output is not None and not _is_page(output):
        need_output(output, folder)
    with warnings.catch_warnings():
        # What the check says of such files need not be said twice.
        warnings.filterwarnings("ignore", message=f".*{DOUBT}", category=CaptureWarning)
        capture = bgars.read_capture(folder)
    findings = bgars.check(capture)
    page = None if output is None else _write_page(output, check_page(capture, findings))
    if as_json:
        print_json({"capture": capture.name, **findings.to_dict()})
    else:
        _tell(capture.name, findings)
        if page is not None:
            say()
            say(f"  {page}  {'a picture for each finding' if findings.findings else 'says that nothing was found'}")
    if findings.errors:
        raise typer.Exit(EXIT_WRONG)


def _is_page(output: Path) -> bool:
    return output.suffix.lower() in PAGE_SUFFIXES


def _write_page(output: Path, page: str) -> Path:
    """Write the file that is named, or check.html into a folder; return its path."""
    if not _is_page(output):
        with atomic_folder(output, NAMES) as place:
            (place / PAGE_NAME).write_text(page, encoding="utf-8")
        return output / PAGE_NAME
    need_new_or_own(output)
    output.parent.mkdir(parents=True, exist_ok=True)
    with atomic_file(output) as temporary:
        temporary.write_text(page, encoding="utf-8")
    return output


def _tell(name: str, findings: Findings) -> None:
    if not findings.findings:
        say(f"{name}: no faults found")
        return
    errors, warnings = len(findings.errors), len(findings.told) - len(findings.errors)
    say(f"{name}: {counted(errors, 'error')}, {counted(warnings, 'warning')}")
    for finding in findings:
        say(f"{finding.severity}: {finding.kind}: {finding.message}")
        say(f"  {finding.advice}")
