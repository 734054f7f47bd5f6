"""The commands ``bgars calibrate response | scale``."""

from __future__ import annotations

import math
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
import typer

import bgars
from bgars.cli.calibrate_station import JsonOption, OutputOption, said_values
from bgars.cli.console import print_json, say
from bgars.cli.measured_scale import measured_scale, numbers
from bgars.cli.station_output import existing_station, keep_part, need_different, tell_findings
from bgars.errors import InputError
from bgars.io.capture import read_unlit
from bgars.records.remark import Remark
from bgars.station import response_from_bracket, response_from_sums, srgb_response
from bgars.station.scale import GRID_AGAIN

if TYPE_CHECKING:
    from bgars.records.response_curve import ResponseCurve
    from bgars.records.station import Station

__all__ = ["register"]

SUMS = 3


def register(group: typer.Typer) -> None:
    """Add the commands to the group ``calibrate``."""
    group.command("response")(response)
    group.command("scale")(scale)


def response(
    output: OutputOption,
    folder: Annotated[
        Path | None,
        typer.Argument(metavar="FOLDER", help="Images of one scene; not needed with --srgb.", show_default=False),
    ] = None,
    exposures: Annotated[
        str | None,
        typer.Option(
            metavar="T,T,...", help="Exposure times of the images, in their order and in any unit.", show_default=False
        ),
    ] = None,
    sums: Annotated[
        bool, typer.Option("--sums", help="The three images are light a, light b, and both together.")
    ] = False,
    srgb: Annotated[bool, typer.Option("--srgb", help="Use the sRGB curve.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Find how much light each grey level means; says when the camera is not linear."""
    if [exposures is not None, sums, srgb].count(True) != 1:
        msg = "--exposures, --sums, --srgb: give one of them"
        raise InputError(msg)
    known = existing_station(output, folder)
    findings: tuple[Remark, ...] = ()
    above = ""
    if srgb:
        curve = srgb_response()
    elif folder is None:
        msg = "FOLDER: needed with --exposures and --sums"
        raise InputError(msg)
    else:
        with warnings.catch_warnings():
            # What reading assumes of the response is what is measured here, on the levels as they are.
            warnings.simplefilter("ignore", bgars.CaptureWarning)
            capture = read_unlit(folder)
        full = capture.full_scale if math.isfinite(capture.full_scale) else float(capture.images.max())
        dark = capture.black_level if capture.dark is None else float(np.median(capture.dark))
        above = f" above the black level of {dark:g}" if dark > 0 else ""
        if exposures is not None:
            curve, findings = response_from_bracket(
                list(capture.images), numbers(exposures, "--exposures"), full, dark=dark
            )
        else:
            if len(capture.images) != SUMS:
                msg = f"{folder}: --sums needs three images (a, b, both), got {len(capture.images)}"
                raise InputError(msg)
            curve, findings = response_from_sums(
                capture.images[0], capture.images[1], capture.images[2], full, dark=dark
            )
    findings = (*findings, *_made_before(known, curve))
    findings = keep_part(output, {"response": curve}, findings)
    if as_json:
        values = {"levels": curve.levels.tolist(), "radiances": curve.radiances.tolist(), "gamma": curve.gamma}
        print_json({**values, "nonlinearity": curve.nonlinearity, **said_values(findings), "file": str(output)})
        return
    say(
        f"Response by {curve.source}{above}: gamma about {curve.gamma:.2f}, {100 * curve.nonlinearity:.1f} % off a "
        "straight line."
    )
    tell_findings(findings, output)


def scale(
    folders: Annotated[
        list[Path],
        typer.Argument(metavar="FOLDER", help="Grid where parts lie; or at several heights.", show_default=False),
    ],
    output: OutputOption,
    pitch_mm: Annotated[
        float, typer.Option(metavar="MM", help="Distance of neighbouring dots or crossings.", show_default=False)
    ],
    u_pitch_mm: Annotated[
        float | None,
        typer.Option(metavar="MM", help="Its standard uncertainty; 0.01 % by default.", show_default=False),
    ] = None,
    target: Annotated[Literal["dots", "chessboard"], typer.Option(help="Kind of target.")] = "dots",
    heights_mm: Annotated[
        str | None,
        typer.Option(
            metavar="MM,MM,...",
            help="Height of the grid above the board in each folder: gives the distance of the camera, and the tilt.",
            show_default=False,
        ),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Measure the pixel pitch on a grid that lies where parts lie; says how much the lens distorts.

    With the grid at two known heights or more, also how far the camera is, or that it is telecentric.
    """
    need_different(folders, GRID_AGAIN)
    known = existing_station(output, *folders)
    found, findings = measured_scale(
        known, folders, ("--pitch-mm", pitch_mm), ("--heights-mm", heights_mm), target, u_pitch_mm
    )
    findings = keep_part(output, {"scale": found}, findings)
    if as_json:
        is_telecentric = found.camera_distance_mm is not None and math.isinf(found.camera_distance_mm)
        values = {"pixel_pitch_um": found.pixel_pitch_um, "pixel_pitch_u_um": found.pixel_pitch_u_um}
        print_json(
            {
                **values,
                "distortion": found.distortion,
                "camera_distance_mm": None if is_telecentric else found.camera_distance_mm,
                "telecentric": is_telecentric,
                "tilt_deg": None if math.isnan(found.tilt_deg) else found.tilt_deg,
                "points": found.points,
                **said_values(findings),
                "file": str(output),
            }
        )
        return
    say(f"A pixel is {found.pixel_pitch_um:.4f} um (u {found.pixel_pitch_u_um:.2g} um), by {found.points} points.")
    tell_findings(findings, output)


def _made_before(known: Station, curve: ResponseCurve) -> list[Remark]:
    """What the station holds that was measured by other levels than this response gives."""
    before = known.response
    if before is not None and np.array_equal(before.radiances, curve.radiances):
        return []
    again = "was calibrated without this response, and is wrong with it: calibrate it again"
    found = []
    if known.flat is not None:
        found.append(Remark("doubt", f"the flat field {again}", "flat-before-response"))
    if known.lights is not None and known.lights.sphere == "matt":
        found.append(Remark("doubt", f"what a matt ball showed of the lights {again}", "lights-before-response"))
    return found
