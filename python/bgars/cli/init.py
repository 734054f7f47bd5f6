"""The command ``bgars init``: a folder of images gets its capture.toml."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer

from bgars.cli.console import say
from bgars.errors import BgarsError, InputError
from bgars.io.atomic import atomic_file
from bgars.io.given_paths import need_file, need_folder
from bgars.io.image_listing import list_folder
from bgars.io.recipe import RECIPE_NAME, read_recipe
from bgars.io.station_file import read_station

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["register"]

T = TypeVar("T")


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("init")(init)


def init(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder with the images.", show_default=False)],
    station: Annotated[
        Path | None,
        typer.Option(
            metavar="STATION.toml", help="Calibrated station, with lights, scale and more.", show_default=False
        ),
    ] = None,
    ring: Annotated[
        str | None,
        typer.Option(
            metavar="COUNT,ELEVATION",
            help="Lights of a ring in equal steps: count, elevation and, if it is not 0, first azimuth, in degrees, "
            "such as 8,45 or 8,45,22.5.",
            show_default=False,
        ),
    ] = None,
    pixel_pitch_um: Annotated[
        float | None, typer.Option(metavar="UM", help="Size of a pixel on the board, in um.", show_default=False)
    ] = None,
    pitch_um: Annotated[float | None, typer.Option(hidden=True, help="Former name of --pixel-pitch-um.")] = None,
    dark: Annotated[
        str | None, typer.Option(metavar="IMAGE", help="Image with all lights off.", show_default=False)
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing capture.toml.")] = False,
) -> None:
    """Write capture.toml: from these options, or by asking on a terminal what they leave open.

    Exit code 2 where a capture.toml is there already, or nothing says where the lights are.
    """
    pixel_pitch_um = pitch_um if pixel_pitch_um is None else pixel_pitch_um
    place = need_folder(folder) / RECIPE_NAME
    if place.exists() and not force:
        msg = f"{place}: exists; --force replaces it"
        raise InputError(msg)
    if station is None and ring is None and sys.stdin.isatty():
        station = _asked("Station file (empty: none)", lambda text: _known_station(text, folder) if text else None)
        if station is None:
            ring = _asked(
                "Lights of a ring in equal steps: count,elevation in degrees",
                lambda text: _checked(text, folder),
                "8,45",
            )
        if station is None and pixel_pitch_um is None:
            question = "Size of a pixel on the board in um (empty: not known)"
            pixel_pitch_um = _asked(question, lambda text: _above_0(text) if text else None)
    if (station is None) == (ring is None):
        msg = "--station or --ring: give one of them, to say where the lights are"
        raise InputError(msg)
    lines = [] if pixel_pitch_um is None else [f"pixel_pitch_um = {pixel_pitch_um!r}"]
    if dark is not None:
        need_file(folder / dark)
        lines.append(f"dark = {json.dumps(dark)}")
    if station is not None:
        _known_station(station, folder)
        _need_scale(station, pitch_um)
        lines.append(f"station = {json.dumps(str(station.resolve()))}")
    if ring is not None:
        lines += [*([""] if lines else []), "[lights]", f"ring = {_ring(_checked(ring, folder))}"]
    with atomic_file(place) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")
        try:
            read_recipe(temporary)
        except InputError as error:  # what is wrong was given here, not in a file that anybody knows
            msg = str(error).removeprefix(f"{temporary}: ")
            raise InputError(msg) from None
    say(f"Written: {place}. Next: bgars info {folder}")


def _asked(question: str, read: Callable[[str], T], default: str = "") -> T:
    """Ask until the answer can be read."""

    def once(text: str) -> T:
        try:
            return read(text.strip())
        except BgarsError as error:
            raise typer.BadParameter(str(error)) from None

    try:
        found: T = typer.prompt(question, default=default, show_default=bool(default), value_proc=once)
    except typer.Abort as end:
        if isinstance(end.__context__, KeyboardInterrupt):
            raise KeyboardInterrupt from None
        say()  # ends the line of the question
        msg = "no answer: nothing was written"
        raise InputError(msg) from None
    return found


def _known_station(path: str | Path, folder: Path) -> Path:
    lights = read_station(path).lights
    if lights is not None:
        _need_images(folder, len(lights.rig), f"{path}: {len(lights.rig)} lights")
    return Path(path)


def _need_scale(path: Path, pitch_um: float | None) -> None:
    """Refuse near lights of which nothing says how far a pixel is from them."""
    known = read_station(path)
    if known.lights is not None and known.lights.rig.positions_um is not None and known.scale is None and not pitch_um:
        msg = f"--pitch-um: needed, since {path} has positions of lights, but no scale (bgars calibrate scale)"
        raise InputError(msg)


def _checked(ring: str, folder: Path) -> str:
    """The ring as it was given, once it can be read and fits the images."""
    _ring(ring)
    count = int(float(ring.split(",", maxsplit=1)[0]))
    _need_images(folder, count, f"--ring: {count} lights")
    return ring


def _need_images(folder: Path, lights: int, what: str) -> None:
    """Refuse another number of images than lights; none, one (a stack) or several a light (a bracket) may be right."""
    images = len(list_folder(folder).images)
    if images in {0, 1} or images % lights == 0:
        if images > lights:
            say(f"note: {what}, but {images} images: of an exposure bracket, add exposures_ms (docs/captures.md)")
        return
    msg = f"{what}, but {folder} holds {images} images, one a light: correct the count, or move away what is no part"
    raise InputError(msg)


def _above_0(text: str) -> float:
    value = _number(text)
    if not 0 < value < math.inf:
        msg = f"must be a number above 0, got {text!r}"
        raise InputError(msg)
    return value


def _ring(text: str) -> str:
    """The ring as an inline table."""
    try:
        values = [_number(part) for part in text.split(",")]
    except InputError:
        values = []
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
