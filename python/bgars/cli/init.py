"""The command ``bgars init``: a folder of images gets its capture.toml."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import Annotated

import typer

from bgars.cli.console import say
from bgars.errors import InputError
from bgars.io.atomic import atomic_file
from bgars.io.given_paths import need_file, need_folder
from bgars.io.recipe import RECIPE_NAME, read_recipe
from bgars.io.station_file import read_station

__all__ = ["register"]


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("init")(init)


def init(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder with the images.", show_default=False)],
    station: Annotated[
        Path | None,
        typer.Option(
            metavar="station.toml", help="Calibrated station, with lights, scale and more.", show_default=False
        ),
    ] = None,
    ring: Annotated[
        str | None,
        typer.Option(
            metavar="COUNT,ELEVATION[,AZIMUTH0]",
            help="Lights of a ring in equal steps: count, elevation and first azimuth in degrees, such as 8,45.",
            show_default=False,
        ),
    ] = None,
    pitch_um: Annotated[
        float | None, typer.Option(metavar="UM", help="Size of a pixel on the board, in um.", show_default=False)
    ] = None,
    dark: Annotated[
        str | None, typer.Option(metavar="IMAGE", help="Image with all lights off.", show_default=False)
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing capture.toml.")] = False,
) -> None:
    """Write capture.toml: from these options, or by asking on a terminal what they leave open.

    Exit code 2 where a capture.toml is there already, or nothing says where the lights are.
    """
    place = need_folder(folder) / RECIPE_NAME
    if place.exists() and not force:
        msg = f"{place}: exists; --force replaces it"
        raise InputError(msg)
    if station is None and ring is None and sys.stdin.isatty():
        answer = typer.prompt("Station file (empty: none)", default="", show_default=False)
        station = Path(answer) if answer else None
        if station is None:
            ring = typer.prompt("Lights of a ring in equal steps: count,elevation in degrees", default="8,45")
        if station is None and pitch_um is None:
            answer = typer.prompt(
                "Size of a pixel on the board in um (empty: not known)", default="", show_default=False
            )
            pitch_um = _number(answer) if answer else None
    if (station is None) == (ring is None):
        msg = "--station or --ring: give one of them, to say where the lights are"
        raise InputError(msg)
    lines = [] if pitch_um is None else [f"pixel_pitch_um = {pitch_um!r}"]
    if dark is not None:
        need_file(folder / dark)
        lines.append(f"dark = {json.dumps(dark)}")
    if station is not None:
        read_station(station)
        lines.append(f"station = {json.dumps(str(station.resolve()))}")
    if ring is not None:
        lines += ["", "[lights]", f"ring = {_ring(ring)}"]
    with atomic_file(place) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")
        try:
            read_recipe(temporary)
        except InputError as error:  # what is wrong was given here, not in a file that anybody knows
            msg = str(error).removeprefix(f"{temporary}: ")
            raise InputError(msg) from None
    say(f"Written: {place}. Next: bgars info {folder}")


def _ring(text: str) -> str:
    """The ring as an inline table."""
    values = [_number(part) for part in text.split(",")]
    names = ("count", "elevation_deg", "azimuth0_deg")
    if not 1 < len(values) <= len(names) or not all(map(math.isfinite, values)) or values[0] != int(values[0]):
        msg = f"--ring: must be COUNT,ELEVATION or COUNT,ELEVATION,AZIMUTH0, got {text!r}"
        raise InputError(msg)
    if 0 < values[1] <= math.pi / 2:  # no ring stands so low, and every one does in radians
        elevation_deg = f"{math.degrees(values[1]):.0f} degrees"
        msg = f"--ring: ELEVATION must be in degrees, got {values[1]:g}, which looks like radians ({elevation_deg})"
        raise InputError(msg)
    pairs = [
        f"{name} = {int(value) if name == 'count' else value!r}" for name, value in zip(names, values, strict=False)
    ]
    return "{ " + ", ".join(pairs) + " }"


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        msg = f"must be a number, got {text!r}"
        raise InputError(msg) from None
