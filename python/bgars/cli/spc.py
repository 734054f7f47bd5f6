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
from bgars.errors import InputError
from bgars.io.atomic import FolderNames, atomic_folder
from bgars.io.given_paths import need_output, need_path
from bgars.store import open_store
from bgars.studies.nelson import parse_rules
from bgars.studies.pages import chart_page, spc_page
from bgars.studies.query_chart import query_charts
from bgars.studies.trend import DEFAULT_SUBGROUP, TARGET
from bgars.studies.trend_files import expanded

__all__ = ["register"]

FEW_PARTS = 40
"""Below it subgroups of five leave less than eight points, which is no chart."""
FILES = {"spc.html": "the page to look at first", "spc.json": "every figure"}
NAMES = FolderNames(frozenset(FILES), frozenset({"spc.json"}))


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("spc")(spc)


def spc(
    results: Annotated[
        list[Path],
        typer.Argument(
            metavar="RESULT",
            help="Results of bgars inspect: result.json files, their folders, folders of such folders, patterns of "
            "these; or a store.",
            show_default=False,
        ),
    ],
    output: Annotated[
        Path,
        typer.Option(
            "--output", "-o", metavar="OUT", help="Folder for the charts; created if missing.", show_default=False
        ),
    ],
    subgroup: Annotated[
        int | None,
        typer.Option(
            help="Parts of a subgroup, in order; 1: each part is a point, with moving ranges (I-MR). By default "
            f"{DEFAULT_SUBGROUP}, and 1 below {FEW_PARTS} parts.",
            show_default=False,
        ),
    ] = None,
    target: Annotated[float, typer.Option(help="Required Ppk.")] = TARGET,
    western_electric: Annotated[
        bool, typer.Option("--western-electric", help="Also apply the Western Electric zone rules; more false alarms.")
    ] = False,
    nelson: Annotated[
        str,
        typer.Option(metavar="RULES", help="Nelson's rules to apply, such as 2,3,5; or all.", show_default=False),
    ] = "",
    where: Annotated[
        str,
        typer.Option(
            metavar="SQL", help="Condition on the parts of a store, such as \"lot = 'L7'\".", show_default=False
        ),
    ] = "",
    query: Annotated[
        str,
        typer.Option(
            metavar="SQL",
            help="Chart the numbers of this query of a store instead (I-MR); its other columns are labels; "
            "ORDER BY gives their order.",
            show_default=False,
        ),
    ] = "",
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of text.")] = False,
) -> None:
    """Chart many results over time: X-bar / S or I-MR charts, Cp, Cpk, Pp, Ppk with confidence intervals.

    Exit code 0: every characteristic with limits is in control and capable. 1: one is not, or it is unknown; the
    output says which. 2: wrong use, too few results, or results that do not belong together.
    """
    for path in results:
        for place in expanded(path):
            need_path(place)
    need_output(output, *results)
    rules = parse_rules(nelson)
    if query:
        unused = {"--where": bool(where), "--subgroup": subgroup is not None, "--target": target != TARGET}
        if ignored := next((name for name, given in unused.items() if given), None):
            msg = f"{ignored}: does not go with --query, whose chart is of single values without limits"
            raise InputError(msg)
        _chart_query(results, query, output, rules, zone_rules=western_electric, as_json=as_json)
        return
    with stage_progress() as report, atomic_folder(output, NAMES) as place:
        ordered, warnings = bgars.read_results(
            results, where=where, progress=lambda fraction: report("results", fraction)
        )
        found = bgars.process_trend(
            ordered,
            subgroup=(DEFAULT_SUBGROUP if len(ordered) >= FEW_PARTS else 1) if subgroup is None else subgroup,
            target=target,
            zone_rules=western_electric,
            nelson=rules,
            warnings=warnings,
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


def _chart_query(
    stores: list[Path], sql: str, output: Path, rules: tuple[int, ...], *, zone_rules: bool, as_json: bool
) -> None:
    if len(stores) != 1:
        msg = f"--query: goes with one store, got {len(stores)} paths"
        raise InputError(msg)
    charts = query_charts(open_store(stores[0]), sql, zone_rules=zone_rules, nelson=rules)
    values = {"format": "bgars-charts", "query": sql, "charts": [each.to_dict() for each in charts]}
    with atomic_folder(output, NAMES) as place:
        (place / "spc.html").write_text(chart_page(charts, stores[0].name, sql), encoding="utf-8")
        text = json.dumps(values, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
        (place / "spc.json").write_text(text, encoding="utf-8")
    if as_json:
        print_json(values)
    else:
        for each in charts:
            chart = each.chart
            say(
                f"{each.title}: {chart.centre:.5g}, limits {chart.low:.5g} to {chart.high:.5g}, "
                f"{len(chart.signals)} signals"
            )
        say_files(output, FILES)
    if any(each.chart.signals for each in charts):
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
