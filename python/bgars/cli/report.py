"""The command ``bgars report``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bgars.cli.console import print_json, say
from bgars.io.result_file import RESULT_NAME
from bgars.report.page import write_page
from bgars.report.page_source import read_page_source

__all__ = ["register"]

PAGE = "report.html"


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("report")(report)


def report(
    result: Annotated[
        Path,
        typer.Argument(metavar="RESULT", help="Folder that bgars inspect wrote, or a result.json.", show_default=False),
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="PAGE.html",
            help="The page; report.html beside the result by default.",
            show_default=False,
        ),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object for machines instead of text.")
    ] = False,
) -> None:
    """Write the page of an inspection again, from its result.json.

    One HTML file with verdict, reasons, the part, a table to sort and filter, charts and a 3-D view. It loads nothing:
    it can be mailed, archived, and opened without a network. The photograph is taken from photograph.jpg and
    report.json beside the result, where bgars inspect left them.

    Exit code 0: the page was written, whatever the verdict. 2: there is no result, or it is not one.
    """
    page = output or (result if result.is_dir() else result.parent) / PAGE
    source = read_page_source(result)
    write_page(source, page)
    if as_json:
        place = result / RESULT_NAME if result.is_dir() else result
        print_json({"result": str(place), "output": str(page), "warnings": list(source.warnings)})
        return
    say(f"{page}: open it in a browser")
    for warning in source.warnings:
        say(f"warning: {warning}")
