"""The command ``bgars spc``."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Annotated

import typer

import bgars
from bgars.cli.console import print_json, say, say_files, stage_progress
from bgars.cli.inspect import EXIT_NOT_PASSED
from bgars.io.atomic import FolderNames, atomic_folder
from bgars.io.given_paths import need_output, need_path
from bgars.studies.pages import spc_page
from bgars.studies.trend import DEFAULT_SUBGROUP, TARGET

__all__ = ["register"]

FILES = {"spc.html": "the page to look at first", "spc.json": "every figure"}
NAMES = FolderNames(frozenset(FILES), frozenset({"spc.json"}))


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("spc")(spc)


def spc(
    results: Annotated[
        list[Path],
        typer.Argument(
            metavar="RESULT...",
            help="Results of bgars inspect: result.json files, their folders, or folders of such folders.",
            show_default=False,
        ),
    ],
    output: Annotated[
        Path,
        typer.Option(
            "--output", "-o", metavar="OUT", help="Folder for the charts; made if missing.", show_default=False
        ),
    ],
    subgroup: Annotated[int, typer.Option(help="Consecutive parts of a subgroup.")] = DEFAULT_SUBGROUP,
    target: Annotated[float, typer.Option(help="Ppk that is wanted.")] = TARGET,
    western_electric: Annotated[
        bool, typer.Option("--western-electric", help="Look for the zone patterns, too; more false alarms.")
    ] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object for machines instead of text.")
    ] = False,
) -> None:
    """Chart many results over time: X-bar / S charts, Cp, Cpk, Pp, Ppk with confidence intervals.

    Exit code 0: every characteristic with limits is in control and capable. 1: one is not, or it cannot be said; the
    output says which. 2: wrong use, too few results, or results that do not belong together.
    """
    for path in results:
        need_path(path)
    need_output(output, *results)
    with stage_progress() as report, atomic_folder(output, NAMES) as place:
        ordered, warnings = bgars.read_results(results, progress=lambda fraction: report("results", fraction))
        found = bgars.process_trend(
            ordered, subgroup=subgroup, target=target, zone_rules=western_electric, warnings=warnings
        )
        (place / "spc.html").write_text(spc_page(found), encoding="utf-8")
        text = json.dumps(found.to_dict(), indent=2, ensure_ascii=False, allow_nan=False) + "\n"
        (place / "spc.json").write_text(text, encoding="utf-8")
    if as_json:
        print_json(found.to_dict())
    else:
        _tell(found, output)
    if found.verdict != "pass":
        raise typer.Exit(EXIT_NOT_PASSED)


def _tell(found: bgars.ProcessTrend, output: Path) -> None:
    say(f"{found.part}: {found.verdict.upper()}")
    for reason in found.reasons:
        say(f"  {reason}")
    for warning in found.warnings:
        say(f"warning: {warning}")
    say()
    say(f"{'characteristic':<26} {'mean':>9} {'sigma':>9} {'Ppk':>7} {'95 % interval':>16} {'signals':>8}  verdict")
    for each in found.trends:
        index = each.overall.centred
        interval = f"{index.low:.2f} to {index.high:.2f}" if math.isfinite(index.value) else "-"
        ppk = f"{index.value:.2f}" if math.isfinite(index.value) else "-"
        say(
            f"{each.characteristic:<26} {each.mean:>9.4g} {each.sigma_overall:>9.3g} {ppk:>7} {interval:>16} "
            f"{len(each.chart.signals):>8}  {each.verdict or '-'}"
        )
    say()
    say_files(output, FILES)
