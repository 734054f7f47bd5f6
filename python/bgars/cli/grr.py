"""The command ``bgars grr``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import bgars
from bgars.cli.console import print_json, say, say_files, stage_progress
from bgars.cli.inspect import EXIT_NOT_PASSED
from bgars.cli.options import MethodOption
from bgars.errors import InputError
from bgars.io.atomic import FolderNames, atomic_folder
from bgars.io.given_paths import need_file, need_folder, need_output
from bgars.normals.methods import DEFAULT_METHOD
from bgars.studies.pages import grr_page
from bgars.studies.readings import readings_csv
from bgars.studies.study_folder import write_single_results

if TYPE_CHECKING:
    from bgars.studies import GaugeStudy

__all__ = ["register"]

FILES = {
    "grr.html": "the page to look at first",
    "grr.json": "every figure",
    "readings.csv": "all readings, one per line",
}
NAMES = FolderNames(frozenset(FILES), frozenset({"grr.json"}))
RESULTS = "results"
RESULTS_MEANING = "the results of all runs, for bgars report and to repeat the study"


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("grr")(grr)


def grr(
    folder: Annotated[
        Path,
        typer.Argument(
            metavar="FOLDER",
            help="Folders part/placement/repeat (or part/repeat, or repeat); each repeat is a folder that bgars "
            "inspect wrote, or a capture folder.",
            show_default=False,
        ),
    ],
    output: Annotated[
        Path,
        typer.Option(
            "--output", "-o", metavar="OUT", help="Folder for the study; created if missing.", show_default=False
        ),
    ],
    recipe: Annotated[
        Path | None,
        typer.Option(
            "--recipe",
            "-r",
            metavar="PART.toml",
            help="Recipe for captures; results contain theirs.",
            show_default=False,
        ),
    ] = None,
    references: Annotated[
        Path | None,
        typer.Option(
            metavar="REFERENCES.csv",
            help="Reference values: part,ball,characteristic,reference (docs/studies.md).",
            show_default=False,
        ),
    ] = None,
    method: MethodOption = DEFAULT_METHOD,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of text.")] = False,
) -> None:
    """Compute how repeatable the gauge is: gauge R&R by analysis of variance, from repeated measurements of parts.

    Captures are inspected, and their results kept in OUT/results, in folders of the same names.

    Exit code 0: GRR is at most 10 % of every tolerance. 1: it is more, or unknown; the output says why. 2:
    wrong use, a design that is not balanced, runs that do not belong together, or a capture that cannot be measured.
    """
    need_folder(folder)
    need_output(output, folder)
    for file in (recipe, references):
        need_file(file)
    _check_results(folder, output)
    with stage_progress() as report, atomic_folder(output, NAMES) as place:
        known = None if references is None else bgars.read_references(references)
        study = bgars.read_study(folder, recipe, method=method, progress=lambda fraction: report("runs", fraction))
        if not study.inspected and method != DEFAULT_METHOD:
            msg = f"--method: goes with captures; {folder} holds finished results"
            raise InputError(msg)
        found = bgars.gauge_rr(study, known)
        (place / "grr.html").write_text(grr_page(found), encoding="utf-8")
        (place / "grr.json").write_text(_json(found), encoding="utf-8")
        (place / "readings.csv").write_text(readings_csv(study), encoding="utf-8")
        if study.inspected:
            write_single_results(study, place / RESULTS)
    if as_json:
        print_json(found.to_dict())
    else:
        _tell(found, output)
    if found.verdict != "pass":
        raise typer.Exit(EXIT_NOT_PASSED)


def _check_results(folder: Path, output: Path) -> None:
    """Refuse, before any work, to leave results of an earlier study beside the figures of this one."""
    earlier = output / RESULTS
    if earlier.exists() and earlier.resolve() != folder.resolve():
        msg = f"{earlier}: holds the results of an earlier study; name another folder with -o, or remove it"
        raise InputError(msg)


def _json(found: GaugeStudy) -> str:
    return json.dumps(found.to_dict(), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def _tell(found: GaugeStudy, output: Path) -> None:
    study = found.study
    say(f"{found.name}: {found.verdict.upper()}")
    for reason in found.reasons:
        say(f"  {reason}")
    for name, left_out in found.left_out:
        say(f"left out: {name}: {left_out}")
    for warning in found.warnings:
        say(f"warning: {warning}")
    say(f"{len(study.runs)} runs, {'inspected' if study.inspected else 'read from finished results'}")
    say()
    say(f"{'characteristic':<26} {'GRR':>9} {'EV':>9} {'AV':>9} {'of tolerance':>13} {'ndc':>5}  verdict")
    for each in found.figures:
        cells = [_cell(each.spread(name).sigma) for name in ("GRR", "EV", "AV")]
        percent = each.spread("GRR").percent_tolerance
        share = "-" if percent != percent else f"{percent:.1f} %"  # noqa: PLR0124 - NaN
        ndc = "-" if each.ndc is None else str(each.ndc)
        say(
            f"{each.characteristic:<26} {cells[0]:>9} {cells[1]:>9} {cells[2]:>9} {share:>13} {ndc:>5}  "
            f"{each.verdict or '-'}"
        )
    say()
    say_files(output, FILES | ({RESULTS: RESULTS_MEANING} if study.inspected else {}))


def _cell(value: float) -> str:
    return "-" if value != value else f"{value:.3g}"  # noqa: PLR0124 - NaN
