"""The commands ``bgars calibrate lights | flat | station``."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

import bgars
from bgars.cli.calibrated_lights import lights_values, said_values, tell_lights
from bgars.cli.camera_option import CameraOption, seen_by
from bgars.cli.console import print_json, say, stage_progress
from bgars.cli.measured_scale import measured_scale
from bgars.cli.station_output import existing_station, keep_part, need_different, tell_findings
from bgars.errors import InputError
from bgars.io.capture import read_unlit
from bgars.report.figures.station_balls import write_balls
from bgars.station.flat import falloff_findings
from bgars.station.lights import BALL_AGAIN
from bgars.station.scale import GRID_AGAIN

if TYPE_CHECKING:
    from collections.abc import Callable

    from bgars.records.capture import Capture
    from bgars.records.light_calibration import LightCalibration
    from bgars.records.remark import Remark
    from bgars.records.station import Station

__all__ = [
    "FolderArgument", "JsonOption", "OutlineOption", "OutputOption", "circles_of", "raw_capture", "register",
    "said_values",
]  # fmt: skip

OutputOption = Annotated[
    Path,
    typer.Option(
        "--output",
        "-o",
        metavar="STATION.toml",
        help="Station file; created, or its section of this calibration replaced. station.html is written beside it.",
        show_default=False,
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON object instead of text.")]
FoldersArgument = Annotated[
    list[Path],
    typer.Argument(
        metavar="FOLDER", help="Capture folders, one per place of the ball; without a description of the lights."
    ),
]
FolderArgument = Annotated[Path, typer.Argument(metavar="FOLDER", help="Capture folder.", show_default=False)]
SphereOption = Annotated[
    Literal["mirror", "matt"],
    typer.Option(help="mirror: a bearing ball, a chrome or glossy black one. matt: a matt, light-coloured one."),
]
InViewOption = Annotated[
    Literal["mirror", "matt", "balls"],
    typer.Option(
        help="mirror: a bearing ball, a chrome or glossy black one. matt: a matt, light-coloured one. "
        "balls: the solder balls of a part, whose capture.toml gives the lights to within some degrees."
    ),
]
RecipeOption = Annotated[
    Path | None,
    typer.Option(
        metavar="PART.toml", help="With --sphere balls: layout of the part, and usual roundness of its balls.",
        show_default=False,
    ),
]  # fmt: skip
OutlineOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="COL,ROW,RADIUS",
        help="Outline of a ball that is not found, in pixels as an image viewer shows them (0,0 = centre of the first "
        "pixel); once per folder, or for several balls of one folder.",
        show_default=False,
    ),
]
NearOption = Annotated[
    bool | None,
    typer.Option(
        "--near/--distant",
        help="Positions in mm (two places of the ball or more), or directions of lamps at 100 sides of the image or "
        "more; by default the data decide.",
        show_default=False,
    ),
]
DiameterOption = Annotated[
    float | None,
    typer.Option(
        metavar="MM",
        help="Diameter of the ball, in mm: gives the scale where neither the station nor capture.toml has one.",
        show_default=False,
    ),
]


def register(group: typer.Typer) -> None:
    """Add the commands to the group ``calibrate``."""
    group.command("lights")(lights)
    group.command("flat")(flat)
    group.command("station")(station)


def lights(
    folders: FoldersArgument,
    output: OutputOption,
    sphere: InViewOption = "mirror",
    outline: OutlineOption = None,
    near: NearOption = None,
    diameter_mm: DiameterOption = None,
    recipe: RecipeOption = None,
    camera: CameraOption = None,
    as_json: JsonOption = False,
) -> None:
    """Find where the lights are, on a ball (docs/station.md shows how to photograph it) or on the balls of a part.

    Exit code 2 where there is no ball, or a light does not show on it; nothing is written then.
    """
    need_different(folders, BALL_AGAIN)
    known = existing_station(output, *folders)
    read = bgars.read_capture if sphere == "balls" else read_unlit
    captures = [seen_by(raw_capture(folder, known, read), camera) for folder in folders]
    found = _calibrate_lights(captures, sphere, outline, near, diameter_mm, recipe)
    said = keep_part(
        output,
        {"lights": found},
        found.findings,
        draw=lambda: write_balls(captures, found, output.with_suffix(".balls.svg")),
    )
    if as_json:
        print_json({"bgars": bgars.__version__, **lights_values(found), **said_values(said), "file": str(output)})
        return
    tell_lights(found)
    tell_findings(said, output)


def flat(folder: FolderArgument, output: OutputOption, as_json: JsonOption = False) -> None:
    """Measure how even each light is, on a flat, matt, white or grey board.

    Inspection and reconstruction with that station then divide by these maps: vignetting, unequal lights and their
    fall-off no longer bend the surface.
    """
    known = existing_station(output, folder)
    found, findings = bgars.calibrate_flat(raw_capture(folder, replace(known, scale=None)))
    if known.lights is not None and known.scale is not None:
        findings = (*findings, *falloff_findings(found, known.lights, known.scale.pixel_pitch_um))
    findings = keep_part(output, {"flat": found}, findings)
    if as_json:
        print_json({"degree": found.degree, "residual": found.residual, **said_values(findings), "file": str(output)})
        return
    say(
        f"Flat field of {len(found.coefficients)} lights, polynomials of degree {found.degree}; "
        f"residual {100 * found.residual:.2f} %."
    )
    tell_findings(findings, output)


def station(
    folders: FoldersArgument,
    output: OutputOption,
    sphere: SphereOption = "mirror",
    outline: OutlineOption = None,
    near: NearOption = None,
    diameter_mm: DiameterOption = None,
    board: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Flat board under each light.", show_default=False)
    ] = None,
    grid: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="FOLDER",
            help="Grid of dots, or a chessboard, where parts lie; given twice or more: at the heights of --heights-mm.",
            show_default=False,
        ),
    ] = None,
    grid_pitch_mm: Annotated[
        float | None, typer.Option(metavar="MM", help="Pitch of the grid.", show_default=False)
    ] = None,
    heights_mm: Annotated[
        str | None,
        typer.Option(
            metavar="MM,MM,...",
            help="Height of the grid above the board in each --grid: gives the distance of the camera.",
            show_default=False,
        ),
    ] = None,
    target: Annotated[Literal["dots", "chessboard"], typer.Option(help="Kind of the grid.")] = "dots",
    camera: CameraOption = None,
    name: Annotated[
        str | None, typer.Option(help="Name of the station; by default the one it has.", show_default=False)
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Calibrate scale from a grid, lights from a ball, evenness from a board, in one run.

    A response that station.toml has is used: calibrate it first.
    """
    grids = grid or []
    if bool(grids) != (grid_pitch_mm is not None):
        msg = "--grid and --grid-pitch-mm: give both or none"
        raise InputError(msg)
    if heights_mm is not None and not grids:
        msg = "--heights-mm: goes with --grid only"
        raise InputError(msg)
    need_different(folders, BALL_AGAIN)
    need_different(grids, GRID_AGAIN)
    known = existing_station(output, *folders, board, *grids)
    parts: dict[str, Any] = {}
    findings: list[Remark] = []
    with stage_progress() as report:
        if grid_pitch_mm is not None:
            parts["scale"], said = measured_scale(
                known, grids, ("--grid-pitch-mm", grid_pitch_mm), ("--heights-mm", heights_mm), target
            )
            findings += said
            known = replace(known, scale=parts["scale"])
        report("scale", 1.0)
        captures = [seen_by(raw_capture(folder, known), camera) for folder in folders]
        found = _calibrate_lights(captures, sphere, outline, near, diameter_mm)
        parts["lights"] = found
        findings += found.findings
        report("lights", 1.0)
        if board is not None:
            parts["flat"], said = bgars.calibrate_flat(raw_capture(board, replace(known, scale=None)))
            findings += said
            if known.scale is not None:
                findings += falloff_findings(parts["flat"], found, known.scale.pixel_pitch_um)
        report("flat", 1.0)
    told = keep_part(
        output,
        parts,
        tuple(findings),
        name=name,
        draw=lambda: write_balls(captures, found, output.with_suffix(".balls.svg")),
    )
    if as_json:
        print_json({"bgars": bgars.__version__, **lights_values(found), **said_values(told), "file": str(output)})
        return
    tell_lights(found)
    if "scale" in parts:
        scale = parts["scale"]
        say(f"A pixel is {scale.pixel_pitch_um:.4f} um (u {scale.pixel_pitch_u_um:.2g} um).")
    tell_findings(told, output)


def _calibrate_lights(
    captures: list[Capture],
    sphere: str,
    outline: list[str] | None,
    near: bool | None,
    diameter_mm: float | None,
    recipe: Path | None = None,
) -> LightCalibration:
    if diameter_mm is not None and not (math.isfinite(diameter_mm) and diameter_mm > 0):
        msg = f"--diameter-mm: must be finite and above 0, got {diameter_mm:g}"
        raise InputError(msg)
    circles = circles_of(outline, captures)
    with stage_progress() as report:
        return bgars.calibrate_lights(
            captures,
            sphere,  # type: ignore[arg-type]
            circles[0] if circles is not None and len(captures) == 1 else circles,
            near=near,
            diameter_um=None if diameter_mm is None else 1000.0 * diameter_mm,
            recipe=recipe,
            progress=lambda fraction: report("lights", fraction),
        )


def circles_of(outline: list[str] | None, captures: list[Capture]) -> list[list[list[float]]] | None:
    """Return circles x, y, radius from the image centre, as a list a capture."""
    if not outline:
        return None
    found = []
    height, width = captures[0].images.shape[1:]
    for text in outline:
        try:
            col, row, radius = (float(value) for value in text.split(","))
        except ValueError:
            msg = f"--outline: must be COL,ROW,RADIUS, got {text!r}"
            raise InputError(msg) from None
        found.append([col + 0.5 - width / 2.0, height / 2.0 - row - 0.5, radius])
    if len(captures) == 1:
        return [found]
    if len(found) != len(captures):
        msg = f"--outline: give one for each of the {len(captures)} folders, got {len(found)}"
        raise InputError(msg)
    return [[circle] for circle in found]


def raw_capture(folder: Path, known: Station, read: Callable[[Path], Capture] = read_unlit) -> Capture:
    """Return a capture with the response, scale and distortion that are known already."""
    capture = read(folder)
    return bgars.with_station(capture, bgars.Station(known.name, response=known.response, scale=known.scale))
