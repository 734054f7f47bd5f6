"""The command ``bgars batch``."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn
from rich.progress import Progress as Bar

from bgars.cli.console import error_console, print_json, say
from bgars.cli.inspect import EXIT_NOT_PASSED
from bgars.cli.options import (
    JsonOption,
    LotOption,
    MethodOption,
    OperatorOption,
    RecipeOption,
    RoundOption,
    SerialFrom,
    StationNameOption,
    StoreOption,
)
from bgars.errors import InputError
from bgars.files.counted import counted
from bgars.line.batch import Batch, Progress, inspect_many
from bgars.line.naming import Naming
from bgars.normals.methods import DEFAULT_METHOD
from bgars.records.part_identity import PartIdentity

__all__ = ["register"]

MOST_FAILURES = 10
LINE_EVERY_S = 10.0
"""Between two lines of progress where there is no terminal."""


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("batch")(batch)


def batch(
    folders: Annotated[
        list[str],
        typer.Argument(
            metavar="FOLDER",
            help="Captures, folders of captures, or patterns such as 'lots/L7/*', which bgars expands itself.",
            show_default=False,
        ),
    ],
    output: StoreOption,
    recipe: RecipeOption = None,
    method: MethodOption = DEFAULT_METHOD,
    processes: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=1024,
            help="Number of processes, each with one part; by default together with --threads one thread per core.",
            show_default=False,
        ),
    ] = None,
    threads: Annotated[
        int | None, typer.Option(min=1, max=1024, help="Number of threads of each process.", show_default=False)
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(
            metavar="tcp://HOST:PORT",
            help="Use this Dask cluster, whose workers see the same folders.",
            show_default=False,
        ),
    ] = None,
    send_images: Annotated[
        bool, typer.Option("--send-images", help="Send the images to a cluster that does not see the folders.")
    ] = False,
    serial_from: SerialFrom = "{serial}",
    lot: LotOption = "",
    station_name: StationNameOption = "",
    operator: OperatorOption = "",
    round_: RoundOption = None,
    as_json: JsonOption = False,
) -> None:
    """Inspect many captures into one store: all cores, failures kept with their reason, killed runs resumed.

    A part is not inspected again if the store has its images, recipe and version. No pages are written: see 'bgars
    report STORE' for the overview, 'bgars report STORE SERIAL' for a part, 'bgars query STORE' for queries.

    Exit code 0: every part passes. 1: a part does not, or could not be inspected. 2: wrong use, or a store that cannot
    be written. 130: interrupted; run it again to continue.
    """
    if send_images and scheduler is None:
        msg = "--send-images: goes with --scheduler"
        raise InputError(msg)
    naming = Naming(serial_from, PartIdentity(lot=lot, station=station_name, operator=operator, round=round_))
    with _progress() as report:
        done = inspect_many(
            folders,
            recipe,
            store=output,  # made when folders and recipe were found
            method=method,
            naming=naming,
            processes=processes,
            threads=threads,
            scheduler=scheduler,
            send_images=send_images,
            progress=report,
        )
    if as_json:
        told = {name: value for name, value in vars(done).items() if name not in {"results", "failures"}}
        failures = [{"folder": folder, "reason": reason} for folder, reason in done.failures]
        print_json({**told, "inspected": done.inspected, "failures": failures, "store": str(output)})
    else:
        _tell(done, output)
    if done.failures or done.verdicts["fail"] or done.verdicts["undecided"]:
        raise typer.Exit(EXIT_NOT_PASSED)


def _tell(done: Batch, output: Path) -> None:
    verdicts = ", ".join(f"{count} {verdict}" for verdict, count in done.verdicts.items())
    rate = f", {60 * done.inspected / done.seconds:.1f} parts per minute" if done.inspected and done.seconds > 0 else ""
    say(f"{counted(done.inspected, 'part')} inspected: {verdicts} ({done.seconds:.1f} s{rate})")
    if done.known:
        say(f"{done.known} were in the store already and were skipped")
    for note in done.notes[:MOST_FAILURES]:
        say(f"note: {note}")
    if len(done.notes) > MOST_FAILURES:
        say(f"note: so are {len(done.notes) - MOST_FAILURES} more serial numbers")
    if done.failures:
        say(f"{len(done.failures)} could not be inspected; the next run tries again:")
        for folder, reason in done.failures[:MOST_FAILURES]:
            say(f"  {reason}" if reason.startswith(f"{folder}: ") else f"  {folder}: {reason}")
        if len(done.failures) > MOST_FAILURES:
            say(f"  ... and {len(done.failures) - MOST_FAILURES} more: bgars query {output} 'select * from failures'")
    say()
    say(f'Next: bgars report {output}    or: bgars query {output} "select serial, verdict, reason from parts"')


@contextmanager
def _progress() -> Iterator[Callable[[Progress], None]]:
    """A bar on a terminal, a line every ten seconds elsewhere; both on stderr, with rate and remaining time."""
    if not error_console().is_terminal:
        last = time.monotonic()

        def tell(now: Progress) -> None:
            nonlocal last
            if time.monotonic() - last >= LINE_EVERY_S:
                last = time.monotonic()
                sys.stderr.write(f"{now.done} of {now.total}, {_words(now)}\n")
                sys.stderr.flush()

        yield tell
        return
    columns = (TextColumn("parts"), BarColumn(), MofNCompleteColumn(), TextColumn("{task.description}"))
    with Bar(*columns, console=error_console(), transient=True) as bar:
        task = bar.add_task("", total=None)
        yield lambda now: bar.update(task, completed=now.done, total=now.total, description=_words(now))


def _words(now: Progress) -> str:
    left = now.remaining_s
    time_left = f"{left:.0f} s" if left < 100 else f"{left / 60:.0f} min"  # noqa: PLR2004
    failed = f", {now.failed} not inspected" if now.failed else ""
    return f"{now.per_minute:.1f} per minute, {time_left} left{failed}"
