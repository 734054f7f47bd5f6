"""`bgars mesh`: a normal map or a height map becomes a mesh, points, or heights for another program."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, get_args

import typer

from bgars.cli.console import print_json, say, stage_progress
from bgars.cli.surface_files import POINTS, check_surface_file, need_pitch, surface_in_words, write_surface
from bgars.cli.surface_source import (
    DirectxMapOption,
    MapMaskOption,
    MapPitchOption,
    is_normal_map,
    need_map,
    read_surface,
)
from bgars.errors import InputError
from bgars.io.height import HEIGHT_FORMATS
from bgars.io.mesh_files import MESH_SUFFIXES
from bgars.io.own_files import need_new_or_own
from bgars.surface.integrate import IntegrationMethod, Solver


def register(app: typer.Typer) -> None:
    """Give the command to an app."""
    app.command()(mesh)


def mesh(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            help="A normal map (.png, .jpg, .tif, .exr, .npy, .npz), or a height map (.tif, .npy; NaN = invalid).",
            show_default=False,
        ),
    ],
    output: Annotated[
        Path,
        typer.Option(
            "--output",
            "-o",
            metavar="MESH",
            help=f"File to write, by its ending a mesh ({', '.join(MESH_SUFFIXES)}), points ({POINTS}), or heights "
            f"({', '.join(HEIGHT_FORMATS)}).",
            show_default=False,
        ),
    ],
    pixel_pitch_um: MapPitchOption = None,
    directx: DirectxMapOption = None,
    mask: MapMaskOption = None,
    simplify: Annotated[
        float | None,
        typer.Option(
            metavar="UM",
            help="Largest height error, in um, of a mesh with as few triangles as possible; needs the extra simplify.",
            show_default=False,
        ),
    ] = None,
    method: Annotated[
        IntegrationMethod | None,
        typer.Option(
            "--method",
            "-m",
            help="Integrator of a normal map; bilateral keeps jumps; least-squares by default.",
            show_default=False,
        ),
    ] = None,
    k: Annotated[
        float | None,
        typer.Option("--k", help="bilateral: sharpness of jumps, at least 0; 2 by default.", show_default=False),
    ] = None,
    solver: Annotated[
        Solver | None,
        typer.Option("--solver", help="bilateral: solver of its systems; converged by default.", show_default=False),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of text.")] = False,
) -> None:
    """Turn a normal map or a height map into a mesh, a point cloud, or heights for another program."""
    check_surface_file(output, simplify)
    has_normals = is_normal_map(source)
    options = _integration(source, has_normals, {"--method": method, "--k": k, "--solver": solver})
    need_map("mesh", source, pixel_pitch_um=pixel_pitch_um, directx=directx, mask=mask)
    need_new_or_own(output, source, mask)
    if has_normals:
        need_pitch(pixel_pitch_um, output, simplify)
    with stage_progress() as report:
        height, notes = read_surface(
            source, pixel_pitch_um=pixel_pitch_um, directx=directx, mask=mask, report=report, integration=options
        )
        written = write_surface(height, output, simplify_um=simplify, report=report)
    summary: dict[str, Any] = {**written, "file": str(output), "notes": list(notes)}
    if height.bilateral is not None:
        summary["reweightings"] = len(height.bilateral.energies)
        summary["converged"] = height.bilateral.converged
    if as_json:
        print_json(summary)
        return
    for note in notes:
        say(f"note: {note}")
    say(f"{output}: {surface_in_words(written)}")
    if height.bilateral is not None and not height.bilateral.converged:
        say(f"The energy had not converged after {summary['reweightings']} re-weightings.")


def _integration(source: Path, has_normals: bool, given: dict[str, Any]) -> dict[str, Any]:
    """What was asked of the integrator; refused where nothing would listen."""
    given = {name: value for name, value in given.items() if value is not None}
    for name in given:
        if not has_normals:
            msg = f"{name}: {source} is a height map, which is not integrated; leave {name} out"
            raise InputError(msg)
        if name != "--method" and given.get("--method") != "bilateral":
            method = given.get("--method", get_args(IntegrationMethod)[0])
            msg = f"{name}: only --method bilateral has it, got --method {method}"
            raise InputError(msg)
    return {name.removeprefix("--"): value for name, value in given.items()}
