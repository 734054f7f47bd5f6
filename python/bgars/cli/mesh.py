"""`bgars mesh`: a normal map or a height map becomes a mesh, points, or heights for another program."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_args

import typer

import bgars
from bgars.cli.console import print_json, say, stage_progress
from bgars.cli.surface_files import POINTS, check_surface_file, need_pitch, surface_in_words, write_surface
from bgars.errors import FileFormatError, InputError
from bgars.io.height import HEIGHT_FORMATS, HEIGHT_SUFFIXES, read_stored_height
from bgars.io.mesh_files import MESH_SUFFIXES
from bgars.io.normal_map import holds_normals, read_stored_normals
from bgars.io.normal_map_pixels import NORMAL_MAP_SUFFIXES
from bgars.io.own_files import need_new_or_own
from bgars.pipelines.reconstruct import solver_fraction
from bgars.records.scalar_checks import check_pitch
from bgars.surface.integrate import IntegrationMethod, Solver

if TYPE_CHECKING:
    from collections.abc import Callable

    from bgars.records.pixels import FloatArray

TAKEN = f"mesh takes a normal map ({', '.join(NORMAL_MAP_SUFFIXES)}) or a height map ({', '.join(HEIGHT_SUFFIXES)})"


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
    pixel_pitch_um: Annotated[
        float | None,
        typer.Option(
            help="Pixel pitch in um; a .tif of bgars contains it, other height maps (in um) need it.",
            show_default=False,
        ),
    ] = None,
    directx: Annotated[
        bool | None,
        typer.Option(
            "--directx/--opengl",
            help="Green of the normal map is y down (up). By default the curl of its field decides.",
            show_default=False,
        ),
    ] = None,
    mask: Annotated[
        Path | None,
        typer.Option(
            help="Image, white = use, for a normal map; by default opaque pixels, without a background of one colour.",
            show_default=False,
        ),
    ] = None,
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
    has_content = source.is_file() and source.stat().st_size > 0
    is_normal_map = holds_normals(source) if has_content else source.suffix.lower() not in HEIGHT_SUFFIXES
    options = _integration(source, is_normal_map, {"--method": method, "--k": k, "--solver": solver})
    _check_source(source)
    need_new_or_own(output, source, mask)
    check_pitch(pixel_pitch_um, "--pixel-pitch-um")
    if not is_normal_map and (mask is not None or directx is not None):
        msg = f"--mask, --directx, --opengl: {source} is a height map; leave them out"
        raise InputError(msg)
    notes: tuple[str, ...] = ()
    with stage_progress() as report:
        if is_normal_map:
            need_pitch(pixel_pitch_um, output, simplify)
            normals = read_stored_normals(source, directx=directx, mask=mask)
            notes = normals.notes
            height = _integrated(normals.vectors, pixel_pitch_um, options, report)
        else:
            height = _stored_height(source, pixel_pitch_um)
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


def _integration(source: Path, is_normal_map: bool, given: dict[str, Any]) -> dict[str, Any]:
    """What was asked of the integrator; refused where nothing would listen."""
    given = {name: value for name, value in given.items() if value is not None}
    for name in given:
        if not is_normal_map:
            msg = f"{name}: {source} is a height map, which is not integrated; leave {name} out"
            raise InputError(msg)
        if name != "--method" and given.get("--method") != "bilateral":
            method = given.get("--method", get_args(IntegrationMethod)[0])
            msg = f"{name}: only --method bilateral has it, got --method {method}"
            raise InputError(msg)
    return {name.removeprefix("--"): value for name, value in given.items()}


def _check_source(source: Path) -> None:
    """Raise unless there is a file that could be a map."""
    if source.is_dir():
        what = "is a folder"
    elif not source.is_file():
        what = "no such file"
    elif source.suffix.lower() not in {*NORMAL_MAP_SUFFIXES, *HEIGHT_SUFFIXES}:
        what = f"ends in {source.suffix!r}"
    elif not source.stat().st_size:
        what = "is empty (0 bytes)"
    else:
        return
    msg = f"{source}: {what}; {TAKEN}"
    raise FileFormatError(msg)


def _integrated(
    normals: FloatArray, pixel_pitch_um: float | None, options: dict[str, Any], report: Callable[[str, float], None]
) -> bgars.HeightMap:
    tolerance = 1e-4 if options.get("method") == "bilateral" else 1e-8
    height: bgars.HeightMap = bgars.integrate_normals(
        normals,
        pixel_pitch_um=pixel_pitch_um,
        progress=lambda _, residual: report("height", solver_fraction(residual, tolerance)),
        **options,
    )
    return height


def _stored_height(source: Path, pixel_pitch_um: float | None) -> bgars.HeightMap:
    """A height map in the unit that its file names, or in um where only the command names a pitch."""
    values, unit, stored_um = read_stored_height(source)
    if stored_um is not None and pixel_pitch_um not in {None, stored_um}:
        msg = f"--pixel-pitch-um: {source} says {stored_um}, got {pixel_pitch_um}; leave it out"
        raise InputError(msg)
    if unit is None and pixel_pitch_um is None:
        msg = f"--pixel-pitch-um: must be given, {source} names no unit: its heights are then taken as um"
        raise InputError(msg)
    if unit == "px" and pixel_pitch_um is not None:
        values = values * pixel_pitch_um
    return bgars.HeightMap.from_array(values, pixel_pitch_um=pixel_pitch_um or stored_um)
