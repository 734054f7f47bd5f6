"""What every command shares: where words go, progress on a terminal, exit codes."""

from __future__ import annotations

import json
import os
import shutil
import sys
import time
from contextlib import contextmanager
from datetime import datetime, timezone
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

__all__ = [
    "EXIT_BAD_INPUT",
    "activation",
    "error_console",
    "fail",
    "print_json",
    "say",
    "say_files",
    "shown_path",
    "stage_progress",
    "utc_now",
]

EXIT_BAD_INPUT = 2

output_console = Console(highlight=False, soft_wrap=True)
error_console = Console(stderr=True, highlight=False, soft_wrap=True)


def say(text: str = "") -> None:
    """Print a line of a command's result; brackets are taken literally."""
    output_console.print(text, markup=False)


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


def activation() -> str:
    """What to type before ``bgars ...``: the activation of this environment where the shell does not find its bgars."""
    script, found = Path(sys.prefix) / "bin" / "activate", shutil.which("bgars")
    if not script.is_file() or (found and Path(found).resolve().is_relative_to(Path(sys.prefix).resolve())):
        return ""
    return f". {shown_path(script)} && "


def print_json(values: dict[str, Any]) -> None:
    """Print a result for machines: one JSON object, nothing else."""
    sys.stdout.write(json.dumps(values, indent=2, ensure_ascii=False, allow_nan=False) + "\n")


def utc_now() -> str:
    """The time as ISO 8601, UTC, whole seconds; SOURCE_DATE_EPOCH where a build must be reproducible."""
    epoch = os.environ.get("SOURCE_DATE_EPOCH", "")
    seconds = int(epoch) if epoch.isdecimal() else time.time()
    return datetime.fromtimestamp(seconds, timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ")


def fail(message: str) -> None:
    """Print an error for people."""
    error_console.print("error:", style="bold red", end=" ")
    error_console.print(" ".join(message.splitlines()), markup=False)


@contextmanager
def stage_progress() -> Iterator[Callable[[str, float], None]]:
    """Yield ``report(stage, fraction)``; bars on a terminal, silence in pipes."""
    if not error_console.is_terminal:
        yield lambda _stage, _fraction: None
        return
    columns = (TextColumn("{task.description:<10}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn())
    with Progress(*columns, console=error_console, transient=True) as progress:
        tasks: dict[str, Any] = {}

        def report(stage: str, fraction: float) -> None:
            if stage not in tasks:
                tasks[stage] = progress.add_task(stage, total=1.0)
            progress.update(tasks[stage], completed=fraction)

        yield report
