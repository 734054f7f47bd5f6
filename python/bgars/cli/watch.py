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
from bgars.files.encodable import encodable
from bgars.io.given_paths import need_path
from bgars.line.inbox import Inbox
from bgars.line.inbox_lock import watched
from bgars.line.naming import Naming
from bgars.line.notify import Notifier
from bgars.line.warm import warm_up
from bgars.line.watch import Watch, need_outside
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
        int | None, typer.Option(min=1, help="Number of images of a complete part, masks included.", show_default=False)
    ] = None,
    trigger: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="Name of a file that is written last; with it --settle is not used.",
            show_default=False,
        ),
    ] = "",
    files: Annotated[
        str,
        typer.Option(
            metavar="PATTERN",
            help="Pattern of images in INBOX itself, such as '{serial}_{image}.png', or {number} for digits; needs "
            "--count.",
            show_default=False,
        ),
    ] = "",
    settle: Annotated[
        float, typer.Option(min=0.0, help="Time without a change after which a part is complete, in s.")
    ] = 0.5,
    poll: Annotated[float, typer.Option(min=0.01, max=3600.0, help="Polling interval, in s.")] = 0.1,
    patience: Annotated[
        float, typer.Option(min=0.0, help="Time after which an incomplete or unreadable part counts as failed, in s.")
    ] = 60.0,
    done: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Folder for inspected parts; INBOX/_done by default.", show_default=False),
    ] = None,
    failed: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="Folder for parts that cannot be inspected; INBOX/_failed by default.",
            show_default=False,
        ),
    ] = None,
    on_result: Annotated[
        str,
        typer.Option(metavar="COMMAND", help="Program that receives each result as JSON on stdin.", show_default=False),
    ] = "",
    post: Annotated[
        str, typer.Option(metavar="URL", help="HTTP server that receives each result as JSON.", show_default=False)
    ] = "",
    result_file: Annotated[
        str, typer.Option(metavar="FILE", help="File that holds the log line of the last result.", show_default=False)
    ] = "",
    tcp: Annotated[
        str,
        typer.Option(metavar="HOST:PORT", help="PLC that receives the log line of each result.", show_default=False),
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
    """Inspect parts as they arrive: each once, none lost, across restarts, full disks and changes of the clock.

    A part is a folder in INBOX. It is complete with --count images and no change for --settle seconds, or as soon as
    the --trigger file exists. It is inspected in place; its result is written to disk and reported, and only then is
    the part moved to the done or failed folder. After an interruption it is inspected again, and is in the store once.
    One line of key=value pairs is printed per part; --result-file and --tcp pass it to a PLC.

    SIGTERM and Ctrl-C end it after the current part.

    Exit code 0: ended by a signal or --stop-after. 2: wrong use, or another bgars watch works on INBOX.
    """
    for path in (recipe, rig):
        if path is not None:
            need_path(path)
    done, failed = done or inbox / "_done", failed or inbox / "_failed"
    need_outside(inbox, output, done, failed, *(() if rig is None or rig.parent == inbox else (rig,)))
    notifier = Notifier(on_result, post, result_file, tcp)
    with watched(inbox):
        watching = Watch(
            Inbox(inbox, count=count, trigger=trigger, settle_s=settle, files=files),
            open_store(output, create=True),
            recipe,
            rig,
            done,
            failed,
            method=method,
            naming=Naming(serial_from, PartIdentity(lot=lot, station=station_name, operator=operator)),
            notifier=notifier,
            patience_s=patience,
            poll_s=poll,
            say=_say,
        )
        with ended_by_signals(watching):
            warm_up(watching.store, method)
            if sys.stderr.isatty():
                sys.stderr.write(f"watching {inbox}; Ctrl-C ends it\n")
            watching.run(most=most)


def _say(line: str) -> None:
    """Print a line at once: a program may be reading."""
    sys.stdout.write(f"{encodable(line)}\n")
    sys.stdout.flush()
