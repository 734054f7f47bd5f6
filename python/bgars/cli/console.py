"""What every command shares: where words go, progress on a terminal, exit codes."""

from __future__ import annotations

import json
import os
import shutil
import sys
import time
import warnings
from contextlib import contextmanager
from datetime import datetime, timezone
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from bgars.errors import CaptureWarning
from bgars.files.encodable import encodable

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from rich.console import Console

__all__ = [
    "EXIT_BAD_INPUT",
    "activation",
    "error_console",
    "fail",
    "is_command",
    "may_start_processes",
    "notes_to_stderr",
    "open_page",
    "owns_process",
    "print_json",
    "say",
    "say_files",
    "shown_path",
    "stage_progress",
    "utc_now",
    "warn",
]

EXIT_BAD_INPUT = 2
_process = {"is_command": False}


def is_command() -> None:
    """Say that this process is a command's own, not one that calls it, as tests do."""
    _process["is_command"] = True


def owns_process() -> bool:
    """Whether :func:`is_command` was called."""
    return _process["is_command"]


def may_start_processes() -> bool:
    """Whether work may go to a process beside this one: the command's own, on more than one core and thread."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return owns_process() and cores > 1 and os.environ.get("RAYON_NUM_THREADS") != "1"


def error_console() -> Console:
    """The terminal for errors and progress; rich is loaded where it is needed."""
    from rich.console import Console  # noqa: PLC0415 - as above

    return Console(stderr=True, highlight=False, soft_wrap=True)


def say(text: str = "") -> None:
    """Print a line of a command's result."""
    sys.stdout.write(f"{encodable(text)}\n")


def say_files(output: Path, files: Mapping[str, str]) -> None:
    """List the files in a folder of results, each with what it holds."""
    width = max(len(str(output / name)) for name in files)
    for name, meaning in files.items():
        say(f"  {output / name!s:<{width}}  {meaning}")


def shown_path(path: Path) -> str:
    """A path as short as it can be typed from here."""
    try:
        return str(path.resolve().relative_to(Path.cwd()))
    except ValueError:
        return str(path)


def open_page(page: Path) -> bool:
    """Open a page in the browser where somebody sits before it: a terminal and a display, and no CI."""
    has_display = sys.platform in {"darwin", "win32"} or bool(
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    )
    if os.environ.get("CI") or not (sys.stdout.isatty() and has_display):
        return False
    import webbrowser  # noqa: PLC0415 - loaded where it opens something

    return webbrowser.open(page.resolve().as_uri())


def activation() -> str:
    """What to type before ``bgars ...``: the activation of this environment where the shell does not find its bgars."""
    script, found = Path(sys.prefix) / "bin" / "activate", shutil.which("bgars")
    if not script.is_file() or (found and Path(found).resolve().is_relative_to(Path(sys.prefix).resolve())):
        return ""
    return f". {shown_path(script)} && "


def print_json(values: dict[str, Any]) -> None:
    """Print a result for machines: one JSON object, nothing else."""
    sys.stdout.write(encodable(json.dumps(values, indent=2, ensure_ascii=False, allow_nan=False)) + "\n")


def utc_now() -> str:
    """The time as ISO 8601, UTC, whole seconds; SOURCE_DATE_EPOCH where a build must be reproducible."""
    epoch = os.environ.get("SOURCE_DATE_EPOCH", "")
    seconds = int(epoch) if epoch.isdecimal() else time.time()
    return datetime.fromtimestamp(seconds, timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ")


def fail(message: str) -> None:
    """Print an error for people."""
    console = error_console()
    console.print("error:", style="bold red", end=" ")
    console.print(encodable(" ".join(message.splitlines())), markup=False, emoji=False)


def warn(message: str) -> None:
    """Print, beside the result, what people should know of it."""
    sys.stderr.write(f"warning: {encodable(message)}\n")


def notes_to_stderr() -> None:
    """Print as notes, each once, what had to be assumed to read a file, and old names in it; other warnings stay."""
    other = warnings.showwarning

    def show(  # as warnings.showwarning
        message: Warning | str,
        category: type[Warning],
        filename: str,
        lineno: int,
        file: TextIO | None = None,
        line: str | None = None,
    ) -> None:
        if issubclass(category, CaptureWarning | FutureWarning):
            sys.stderr.write(f"note: {encodable(str(message))}\n")
        else:
            other(message, category, filename, lineno, file, line)

    warnings.showwarning = show
    warnings.simplefilter("once", CaptureWarning)


@contextmanager
def stage_progress() -> Iterator[Callable[[str, float], None]]:
    """Yield ``report(stage, fraction)``; bars on a terminal, silence in pipes."""
    if not sys.stderr.isatty():
        yield lambda _stage, _fraction: None
        return
    from rich.progress import (  # noqa: PLC0415 - loaded on terminals only
        BarColumn,
        Progress,
        TaskProgressColumn,
        TextColumn,
        TimeElapsedColumn,
    )

    columns = (TextColumn("{task.description:<10}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn())
    with Progress(*columns, console=error_console(), transient=True) as progress:
        tasks: dict[str, Any] = {}

        def report(stage: str, fraction: float) -> None:
            if stage not in tasks:
                tasks[stage] = progress.add_task(stage, total=1.0)
            progress.update(tasks[stage], completed=fraction)

        yield report
