"""The option ``--camera``: what lens a reference was seen by."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated

import typer

from bgars.errors import InputError

if TYPE_CHECKING:
    from bgars.records.capture import Capture

__all__ = ["CameraOption", "seen_by"]

CameraOption = Annotated[
    str | None,
    typer.Option(
        metavar="telecentric|MM",
        help="Lens, if capture.toml does not state it: telecentric, or its distance from the board in mm. Otherwise "
        "the uncertainty covers both.",
        show_default=False,
    ),
]


def seen_by(capture: Capture, camera: str | None) -> Capture:
    """Return the capture with the camera that the command line states."""
    if camera is None:
        return capture
    try:
        distance_mm = math.inf if camera == "telecentric" else float(camera)
    except ValueError:
        distance_mm = math.nan
    if not distance_mm > 0:
        msg = f"--camera: must be telecentric or a distance in mm above 0, got {camera!r}"
        raise InputError(msg)
    return replace(capture, camera_distance_mm=distance_mm)
