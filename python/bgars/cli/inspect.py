"""The command ``bgars inspect``."""

from __future__ import annotations

import math
from contextlib import ExitStack
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import bgars
from bgars.cli.console import print_json, say, say_files, stage_progress, utc_now, warn
from bgars.cli.drawing import PART_PICTURES, picture_process
from bgars.cli.first_check import check_first, tell_first
from bgars.cli.inspect_files import NAMES, Wanted, clear_places, refuse_foreign_places, start_pictures, write_result
from bgars.cli.inspect_strip import inspect_strip, tell_strip
from bgars.cli.options import (
    ForceOption,
    JsonOption,
    LotOption,
    MethodOption,
    OperatorOption,
    RecipeOption,
    RoundOption,
    StationNameOption,
    StationOption,
)
from bgars.errors import InputError
from bgars.extras import how_to_install, missing
from bgars.io.atomic import atomic_folder
from bgars.io.given_paths import need_file, need_folder, need_output
from bgars.line.naming import identity_of
from bgars.normals.methods import DEFAULT_METHOD
from bgars.pipelines.check import told_by
from bgars.pipelines.inspect import inspected
from bgars.records.part_identity import PartIdentity
from bgars.report.html.budget import main_causes

if TYPE_CHECKING:
    from collections.abc import Callable

    from bgars.records.part_result import PartResult

__all__ = ["EXIT_NOT_PASSED", "register"]

EXIT_NOT_PASSED = 1
MAX_ROWS = 30


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("inspect")(inspect)


def inspect(
    folder: Annotated[
        Path,
        typer.Argument(
            metavar="FOLDER", help="Capture folder, as for bgars reconstruct, with a pixel pitch.", show_default=False
        ),
    ],
    output: Annotated[
        Path,
        typer.Option(
            "--output", "-o", metavar="OUT", help="Folder for the results; created if missing.", show_default=False
        ),
    ],
    recipe: RecipeOption = None,
    method: MethodOption = DEFAULT_METHOD,
    station: StationOption = None,
    serial: Annotated[
        str,
        typer.Option(
            metavar="SERIAL", help="Serial number of the part; by default that of capture.toml.", show_default=False
        ),
    ] = "",
    lot: LotOption = "",
    station_name: StationNameOption = "",
    operator: OperatorOption = "",
    round_: RoundOption = None,
    parquet: Annotated[
        # The help is markup: a bracket that is no style is escaped.
        bool,
        typer.Option("--parquet", help=r"Also write balls.parquet (needs pip install 'bgars\[parquet]')."),
    ] = False,
    cfx: Annotated[
        bool, typer.Option("--cfx", help="Also write cfx.json: the IPC-CFX message UnitsInspected.")
    ] = False,
    pictures: Annotated[bool, typer.Option("--pictures/--no-pictures", help="Draw the four pictures (PNG).")] = True,
    page: Annotated[bool, typer.Option("--report/--no-report", help="Write report.html and its side files.")] = True,
    force: ForceOption = False,
    log_line: Annotated[
        bool, typer.Option("--log", help="Print one line of key=value pairs for a log instead of text.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Find, measure and judge the solder balls of a part.

    Writes report.html, which is the page to look at first, result.json, balls.csv and four pictures. Files that an
    earlier inspection left in OUT are removed before FOLDER is read: where it cannot be measured, no verdict is left.
    Files of others are never touched: OUT may not hold a capture, nor files of these names that bgars did not write.

    Where the recipe has a strip, FOLDER shows many parts: each gets a folder of its own in OUT, named after its place
    (R1C1: first row and column of the image), and strip.html and parts.csv are the overview. --json and --log
    print one row per part.

    The capture is checked first ('bgars check'): where its lights and images do not fit, there is no verdict.

    Exit code 0: the part passes. 1: it fails, or is undecided because something is too near its limit, was not
    measured, or has no limit; the output says which. 2: wrong use, a bad recipe, or a capture that cannot be measured.
    """
    if log_line and as_json:
        msg = "--log and --json: give one of them"
        raise InputError(msg)
    if parquet:
        from bgars.io.parquet import need_pyarrow  # noqa: PLC0415 - seldom wanted

        need_pyarrow()
    need_file(recipe)
    need_file(station)
    need_folder(folder)
    need_output(output, folder)
    refuse_foreign_places(output)
    pictures = _is_drawn(pictures, "the pictures are left out: drawing them", "matplotlib")
    page = _is_drawn(page, "report.html is left out: it", "plotly")
    wanted = Wanted(pictures=pictures, page=page, parquet=parquet, cfx=cfx)
    with stage_progress() as report, atomic_folder(output, NAMES) as place, ExitStack() as beside:
        clear_places(output)
        part = None if recipe is None else bgars.read_part_recipe(recipe)
        is_drawn = pictures and (part is None or part.strip is None)
        painter = beside.enter_context(picture_process(PART_PICTURES, wanted=is_drawn))
        capture = bgars.read_capture(folder, station=station)
        named, identity = identity_of(
            capture, PartIdentity(lot=lot, station=station_name, operator=operator, round=round_), station
        )
        serial = serial or named
        if part is not None and part.strip is not None:
            told = told_by(check_first(capture, force=force))
            rows = inspect_strip(
                capture, part, part.strip, output, place, wanted, method, serial, identity, told, report
            )
        else:
            stamped = partial(_stamped, serial, identity, cache(utc_now))

            def judged(result: PartResult) -> None:
                if painter is not None:
                    start_pictures(painter, stamped(result), capture, place)

            result = inspected(
                capture,
                part,
                tell=lambda findings: told_by(tell_first(capture, findings, force=force)),
                method=method,
                surface=page,
                progress=report,
                judged=judged,
            )
            result = stamped(result)
            files = write_result(result, capture, place, wanted, painter)
    if part is not None and part.strip is not None:
        tell_strip(rows, output, as_json=as_json, log_line=log_line)
        verdicts = {row.verdict for row in rows}
    else:
        verdicts = {result.verdict}
        if as_json:
            print_json({**result.to_dict(), "output": list(files)})
        elif log_line:
            say(result.summary_line())
        else:
            _tell(result, output, files)
    if verdicts != {"pass"}:
        raise typer.Exit(EXIT_NOT_PASSED)


def _stamped(serial: str, identity: PartIdentity, now: Callable[[], str], result: PartResult) -> PartResult:
    return replace(result, serial=serial, identity=identity, inspected_utc=now())


def _is_drawn(wanted: bool, words: str, package: str) -> bool:
    """Whether what was asked for can be drawn; where it cannot, say so at once."""
    if wanted and missing(package):
        warn(f"{words} {how_to_install(package)}")
        return False
    return wanted


def _tell(result: PartResult, output: Path, files: dict[str, str]) -> None:
    say(f"{result.name}: {result.verdict.upper()}")
    for reason in result.reasons:
        say(f"  {reason}")
    say(_summary(result))
    if causes := main_causes(result.to_dict()):
        told = ", ".join(f"{cause} {u_um:.2g} um" for cause, u_um in causes)
        say(f"U of a typical height, by cause: {told}")
    for warning in result.warnings:
        say(f"warning: {warning}")
    say()
    lines = result.to_table().splitlines()
    rows = list(zip(lines[1:], result.balls, strict=True))
    if len(rows) > MAX_ROWS:
        rows = [(line, ball) for line, ball in rows if ball.verdict != "pass"]
    if rows:
        say(lines[0])
    for line, _ in rows[:MAX_ROWS]:
        say(line)
    if len(rows) > MAX_ROWS:
        say(f"... and {len(rows) - MAX_ROWS} more in balls.csv")
    say()
    say_files(output, files)


def _summary(result: PartResult) -> str:
    readings = (
        ("seating coplanarity", result.seating_coplanarity_um, result.u_seating_coplanarity_um),
        ("regression coplanarity", result.regression_coplanarity_um, result.u_regression_coplanarity_um),
        ("warpage", result.warpage_um, result.u_warpage_um),
        ("pitch", result.pitch_um, result.u_pitch_um),
    )
    told = []
    for name, value, u in readings:
        if not math.isfinite(value):
            told.append(f"{name} not measured")
        else:
            told.append(f"{name} {value:.2f} um" + (f" (U = {2 * u:.2g} um)" if math.isfinite(u) else ""))
    return "; ".join(told)
