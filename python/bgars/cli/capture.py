"""The command ``bgars capture``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import bgars
from bgars.cli.console import print_json, say, stage_progress
from bgars.cli.describe import describe, describe_in_words
from bgars.cli.first_check import warn
from bgars.cli.options import JsonOption
from bgars.io.given_paths import need_file
from bgars.io.recipe import RECIPE_NAME
from bgars.line.camera import camera_of, take_capture

__all__ = ["register"]


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("capture")(capture)


def capture(
    camera: Annotated[
        str,
        typer.Argument(
            metavar="CAMERA",
            help="MODULE:CALLABLE that returns an object with grab(light) -> pixels; or folder:PATH, which shows the "
            "images of a folder.",
            show_default=False,
        ),
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FOLDER", help="New capture folder.", show_default=False)
    ],
    lights: Annotated[int, typer.Option(min=1, help="Number of lights, one image each.")] = 8,
    rig: Annotated[
        Path | None,
        typer.Option(
            metavar="PATH",
            help="capture.toml that describes the rig, or its folder; copied into the capture.",
            show_default=False,
        ),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Take an image under each light with a camera, write a capture folder, read it again and describe it.

    The folder appears when it is complete, so that it may be in the inbox of bgars watch. The capture is then checked
    as by 'bgars check'.
    """
    rig = rig / RECIPE_NAME if rig is not None and rig.is_dir() else rig
    need_file(rig)
    with stage_progress() as report:
        files = take_capture(
            camera_of(camera), output, lights=lights, rig=rig, progress=lambda fraction: report("lights", fraction)
        )
    taken = None if rig is None else bgars.read_capture(output)
    facts = None if taken is None else describe(taken)
    findings = None if taken is None else bgars.check(taken)
    if as_json:
        found = {} if findings is None else findings.to_dict()
        print_json({"output": str(output), "files": files, "capture": facts, **found})
        return
    say(f"{output}: {lights} images")
    for line in [] if facts is None else describe_in_words(facts):
        say(line)
    if facts is None:
        say("no --rig was given: put a capture.toml into the folder (bgars init)")
    for finding in () if findings is None else findings.told:
        warn(finding)
    if findings is not None and not findings.told:
        say("no faults found")
