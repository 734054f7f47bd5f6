"""The command ``bgars report``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bgars.cli.console import print_json, say
from bgars.cli.options import JsonOption
from bgars.errors import InputError
from bgars.io.own_files import need_new_or_own
from bgars.io.result_file import RESULT_NAME
from bgars.line.lot_page import lot_facts, pages_of, write_lot_page
from bgars.line.pages import write_part_page
from bgars.report.html.page import write_page
from bgars.report.html.source import read_page_source
from bgars.store import Store, is_store, open_store

__all__ = ["register"]

PAGE = "report.html"
PAGES, OVERVIEW = "pages", "index.html"


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("report")(report)


def report(
    result: Annotated[
        Path,
        typer.Argument(
            metavar="RESULT",
            help="Folder that bgars inspect wrote, or a result.json; or a store.",
            show_default=False,
        ),
    ],
    serial: Annotated[
        str | None,
        typer.Argument(
            metavar="SERIAL",
            help="Serial number of a part of the store; without one the overview of its parts.",
            show_default=False,
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="PAGE.html",
            help="The page; by default report.html beside the result, or a file in the folder pages of a store.",
            show_default=False,
        ),
    ] = None,
    lot: Annotated[
        str | None, typer.Option(metavar="LOT", help="Write the overview of this lot of the store.", show_default=False)
    ] = None,
    round_: Annotated[
        int | None,
        typer.Option("--round", min=1, help="Number of the inspection of the serial number; the last by default."),
    ] = None,
    recipe_name: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Name of the recipe, for a serial number that was inspected under several.",
            show_default=False,
        ),
    ] = None,
    pages: Annotated[
        bool, typer.Option("--pages", help="With the overview, write the pages of its last parts, too.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Write the page of an inspection again, from its result.json, or pages of a store.

    One HTML file with verdict, reasons, the part, a table to sort and filter, charts and a 3-D view. It loads nothing:
    it can be mailed, archived, and opened without a network. The photograph is taken from photograph.jpg and
    report.json beside the result, where bgars inspect left them.

    With a store of bgars batch or bgars watch: the page of part SERIAL, or without SERIAL the overview of all
    parts or a lot: yield, defects and their places, drift, the last parts. Its pages share one plotly.min.js.

    Exit code 0: the page was written, whatever the verdict. 2: there is no result, or it is not one.
    """
    if is_store(result):
        _need_use(serial, {"--lot": lot, "--pages": pages or None}, {"--round": round_, "--recipe-name": recipe_name})
        _report_store(open_store(result), serial, output, lot, round_, recipe_name, pages=pages, as_json=as_json)
        return
    if serial is not None or lot is not None or round_ is not None or recipe_name is not None or pages:
        msg = f"{result}: is not a store: SERIAL, --lot, --round, --recipe-name and --pages need one"
        raise InputError(msg)
    page = output or (result if result.is_dir() else result.parent) / PAGE
    need_new_or_own(page, result)
    source = read_page_source(result)
    write_page(source, page)
    if as_json:
        place = result / RESULT_NAME if result.is_dir() else result
        print_json({"result": str(place), "output": str(page), "warnings": list(source.warnings)})
        return
    say(f"{page}: open it in a browser")
    for warning in source.warnings:
        say(f"warning: {warning}")


def _need_use(serial: str | None, of_overview: dict[str, object], of_part: dict[str, object]) -> None:
    """Raise InputError where an option would be ignored: those of the overview with SERIAL, those of a part without."""
    unused, rule = (of_part, "needs SERIAL") if serial is None else (of_overview, "is for the overview, without SERIAL")
    name = next((name for name, given in unused.items() if given is not None), None)
    if name is not None:
        msg = f"{name}: {rule}"
        raise InputError(msg)


def _report_store(
    store: Store,
    serial: str | None,
    output: Path | None,
    lot: str | None,
    round_: int | None,
    recipe_name: str | None,
    *,
    pages: bool,
    as_json: bool,
) -> None:
    warnings: list[str] = []
    if output is not None:
        need_new_or_own(output)
    if serial is not None:
        source, page = write_part_page(store, serial, output, round_=round_, recipe=recipe_name)
        warnings += source.warnings
    else:
        page = output or store.folder / PAGES / OVERVIEW
        page.parent.mkdir(exist_ok=True)
        if pages:
            for row in pages_of(lot_facts(store, lot)):
                beside = page.with_name(row["page_name"])
                options = {"round_": row["round"], "recipe": row["recipe"]}
                warnings += write_part_page(store, row["serial"], beside, **options)[0].warnings
        write_lot_page(store, page, lot=lot)
    if as_json:
        print_json({"store": str(store.folder), "output": str(page), "warnings": warnings})
        return
    say(f"{page}: open it in a browser")
    for warning in warnings:
        say(f"warning: {warning}")
