"""The command ``bgars watch``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from bgars.cli.options import (
    LotOption,
    MethodOption,
    OperatorOption,
    RecipeOption,
    SerialFrom,
    StationNameOption,
    StoreOption,
)
from bgars.cli.stopping import ended_by_signals
from bgars.io.given_paths import need_path
from bgars.line.inbox import Inbox
from bgars.line.naming import Naming
from bgars.line.notify import Notifier
from bgars.line.warm import warm_up
from bgars.line.watch import Watch, watched
from bgars.normals.methods import DEFAULT_METHOD
from bgars.records.part_identity import PartIdentity
from bgars.store import open_store

__all__ = ["register"]


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("watch")(watch)


def watch(
    inbox: Annotated[
        Path,
        typer.Argument(
            metavar="INBOX",
            help="Folder into which the camera's software writes a folder for each part.",
            show_default=False,
        ),
    ],
    output: StoreOption,
    recipe: RecipeOption = None,
    rig: Annotated[
        Path | None,
        typer.Option(
            metavar="PATH",
            help="capture.toml, or a folder with it and its files, for parts that come without one.",
            show_default=False,
        ),
    ] = None,
    count: Annotated[
        int | None, typer.Option(min=1, help="Images of a complete part, masks counted.", show_default=False)
    ] = None,
    trigger: Annotated[
        str,
        typer.Option(
            metavar="NAME", help="File that is written last: with it nothing has to settle.", show_default=False
        ),
    ] = "",
    files: Annotated[
        str,
        typer.Option(
            metavar="PATTERN",
            help="Images lie in INBOX itself, and are told apart by their names: '{serial}_{image}.png'.",
            show_default=False,
        ),
    ] = "",
    settle: Annotated[
        float, typer.Option(min=0.0, help="Seconds without a change after which a part is complete.")
    ] = 0.5,
    poll: Annotated[float, typer.Option(min=0.01, help="Seconds between two looks.")] = 0.1,
    patience: Annotated[
        float, typer.Option(min=0.0, help="Seconds after which an incomplete or unreadable part counts as failed.")
    ] = 60.0,
    done: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Where parts go; INBOX/_done by default.", show_default=False)
    ] = None,
    failed: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER", help="Where parts go that cannot be inspected; INBOX/_failed.", show_default=False
        ),
    ] = None,
    on_result: Annotated[
        str,
        typer.Option(metavar="COMMAND", help="Program that gets each result as JSON on its input.", show_default=False),
    ] = "",
    post: Annotated[
        str, typer.Option(metavar="URL", help="HTTP server that gets each result as JSON.", show_default=False)
    ] = "",
    result_file: Annotated[
        str, typer.Option(metavar="FILE", help="File that holds the line of the last result.", show_default=False)
    ] = "",
    tcp: Annotated[
        str, typer.Option(metavar="HOST:PORT", help="PLC that gets the line of each result.", show_default=False)
    ] = "",
    method: MethodOption = DEFAULT_METHOD,
    serial_from: SerialFrom = "{serial}",
    lot: LotOption = "",
    station_name: StationNameOption = "",
    operator: OperatorOption = "",
    most: Annotated[
        int | None, typer.Option("--stop-after", min=1, help="Stop after this many parts.", show_default=False)
    ] = None,
) -> None:
    """Inspect parts as they come: each once, none lost, across restarts, full disks and changes of the clock.

    A part is a folder in INBOX. It is complete with --count images and when nothing changed for --settle seconds, or as
    soon as the --trigger file is there. It is inspected where it lies; its result is written to disk and reported,
    and only then the part moves to the done or failed ones: if that is interrupted, it is inspected again, and is in
    the store once. One line of key=value pairs is printed for each part; --result-file and --tcp give it to a PLC.

    SIGTERM and Ctrl-C end it after the current part.

    Exit code 0: it was ended. 2: wrong use, or another bgars watch works on INBOX.
    """
    for path in (recipe, rig):
        if path is not None:
            need_path(path)
    with watched(inbox):
        watching = Watch(
            Inbox(inbox, count=count, trigger=trigger, settle_s=settle, files=files),
            open_store(output, create=True),
            recipe,
            rig,
            done or inbox / "_done",
            failed or inbox / "_failed",
            method=method,
            naming=Naming(serial_from, PartIdentity(lot=lot, station=station_name, operator=operator)),
            notifier=Notifier(on_result, post, result_file, tcp),
            patience_s=patience,
            poll_s=poll,
            say=_say,
        )
        with ended_by_signals(watching):
            warm_up(watching.store, method)
            watching.run(most=most)


def _say(line: str) -> None:
    """Print a line at once: a program may be reading."""
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()
