"""Pictures of a command beside its other work."""

from __future__ import annotations

from contextlib import nullcontext
from typing import TYPE_CHECKING

from bgars.cli.console import may_start_processes
from bgars.extras import missing

if TYPE_CHECKING:
    from contextlib import AbstractContextManager

    from bgars.report.figures.process import PictureProcess

__all__ = ["OVERVIEW", "PART_PICTURES", "picture_process"]

OVERVIEW, PART_PICTURES = "bgars.report.figures.overview", "bgars.report.figures.part_drawing"
"""Modules that draw."""


def picture_process(module: str, *, wanted: bool = True) -> AbstractContextManager[PictureProcess | None]:
    """A process for pictures, where this one is the command's own and may use more than one core.

    It is started before anything is read: what it loads takes as long as reading and checking a capture.
    """
    if not wanted or missing("matplotlib") or not may_start_processes():
        return nullcontext()
    from bgars.report.figures.process import PictureProcess  # noqa: PLC0415 - loaded when it is used

    return PictureProcess(module)
