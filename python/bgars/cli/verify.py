"""The command ``bgars verify``: a station against a part of known sizes."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import bgars
from bgars.cli.calibrate_station import said_values
from bgars.cli.console import print_json, say, stage_progress, utc_now
from bgars.cli.station_output import need_different, need_places, shown_severity, write_pages
from bgars.errors import InputError
from bgars.files.counted import counted
from bgars.io.station_file import read_station
from bgars.records.remark import Remark
from bgars.records.same_images import refuse_seen
from bgars.station.verify import READINGS, read_known
from bgars.station.verify import verify as compare

if TYPE_CHECKING:
    from bgars.records.station import Verification

__all__ = ["register"]

EXIT_BROKEN = 1
CAPTURES = 3
"""Of one part that is taken out and put back in between: fewer say little of how well readings repeat."""
PART_AGAIN = "take the part out and put it back in between"


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("verify")(verify)


def verify(
    folders: Annotated[
        list[Path], typer.Argument(metavar="FOLDER", help="Captures of the known part.", show_default=False)
    ],
    known: Annotated[
        Path,
        typer.Option(
            metavar="KNOWN.csv",
            help="CSV table of calibrated sizes: name, height_um, diameter_um, u_um.",
            show_default=False,
        ),
    ],
    station: Annotated[
        Path, typer.Option(metavar="STATION.toml", help="Station file; the result is added to it.", show_default=False)
    ],
    recipe: Annotated[
        Path | None,
        typer.Option(
            "--recipe", "-r", metavar="PART.toml", help="Part recipe, which names the balls.", show_default=False
        ),
    ] = None,
    mpe_um: Annotated[
        float | None,
        typer.Option(metavar="UM", help="Maximum permissible error of a single reading.", show_default=False),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of text.")] = False,
) -> None:
    """Compare a station with a part of known sizes: bias, linearity, repeatability (protocol: docs/station.md).

    Exit code 0: within --mpe-um, or none was given. 1: an error is beyond it, or it cannot be shown to be within.
    """
    if mpe_um is not None and not (math.isfinite(mpe_um) and mpe_um > 0):
        msg = f"--mpe-um: must be finite and above 0, got {mpe_um:g}"
        raise InputError(msg)
    need_different(folders, PART_AGAIN)
    sizes = read_known(known)
    kept = read_station(station)
    need_places(station)
    results = []
    seen: dict[str, str] = {}
    with stage_progress() as report:
        for index, folder in enumerate(folders):
            capture = bgars.read_capture(folder, station=kept)
            refuse_seen(capture, seen, PART_AGAIN)
            results.append(bgars.inspect(capture, recipe))
            report("known part", (index + 1) / len(folders))
    found: list[Verification] = []
    said: list[Remark] = []
    for quantity in READINGS:
        if any(math.isfinite(getattr(one, f"{quantity}_um")) for one in sizes.values()):
            one, remarks = compare(results, sizes, quantity=quantity, mpe_um=mpe_um)
            found.append(one)
            said += remarks
    if len(folders) < CAPTURES:
        message = (
            f"{counted(len(folders), 'capture')} of the part: that readings repeat is not shown; take it out, turn it "
            f"and put it back, {CAPTURES} captures or more"
        )
        said.append(Remark("doubt", message, "few-captures", len(folders), CAPTURES))
    new = replace(kept, verified=tuple(found), verified_utc=utc_now())
    write_pages(new, ["verified"], tuple(said), station)
    broken = any(remark.severity == "fail" for remark in said)
    if as_json:
        print_json({"station": str(station), "verified": [_values(one) for one in found], **said_values(tuple(said))})
    else:
        for one in found:
            slope = (
                ""
                if math.isnan(one.slope)
                else f", {1000 * one.slope:+.1f} um per millimetre (u {1000 * one.u_slope:.1f})"
            )
            again = "" if math.isnan(one.repeatability_um) else f", repeats to {one.repeatability_um:.2f} um"
            u = "" if math.isnan(one.u_bias_um) else f" (u {one.u_bias_um:.2f} um)"
            say(
                f"{one.quantity}: bias {one.bias_um:+.2f} um{u}{slope}{again}; largest error "
                f"{one.largest_um:.2f} um, {counted(one.balls, 'ball')} in {counted(one.captures, 'capture')}"
            )
        for remark in said:
            say(f"{shown_severity(remark)}: {remark.message}")
    if broken:
        raise typer.Exit(EXIT_BROKEN)


def _values(one: Verification) -> dict[str, object]:
    """A comparison as plain values; what was not measured is null."""
    return {key: None if value != value else value for key, value in vars(one).items()}  # noqa: PLR0124 - NaN
