"""The commands and their options: those that stand here load what they need when they run."""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

import bgars
from bgars.cli.console import EXIT_BAD_INPUT, activation, print_json, say, shown_path, stage_progress
from bgars.cli.drawing import OVERVIEW, picture_process
from bgars.cli.evaluation import choice_in_words, evaluation_table
from bgars.cli.lazy import LazyGroup
from bgars.cli.options import (
    METHOD_ARGUMENTS,
    ChannelChoice,
    ColourOption,
    DirectxOption,
    FlattenOption,
    FolderArgument,
    ForceOption,
    JsonOption,
    MaterialOption,
    MethodOption,
    NormalsOutOption,
    OutOption,
    StationOption,
    ThresholdOption,
)
from bgars.cli.run import run
from bgars.files.counted import counted
from bgars.normals.methods import DEFAULT_METHOD, METHODS, Method

__all__ = ["main"]

app = typer.Typer(
    name="bgars",
    cls=LazyGroup,
    help=(
        "Photometric stereo for shiny parts: one camera, several lights, one image per light. "
        "Start with 'bgars demo'; then 'bgars reconstruct FOLDER -o OUT' on your own photographs."
    ),
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)


@app.callback(invoke_without_command=True)
def top(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version and stop.")] = False,
    threads: Annotated[
        int | None,
        typer.Option(min=1, max=1024, help="Largest number of threads; one per core by default.", show_default=False),
    ] = None,
) -> None:
    """Options of the command itself."""
    if threads is not None:
        # The compiled module starts its threads at its first work, so this comes in time for all of it.
        from bgars.records.scalar_checks import thread_count  # noqa: PLC0415 - loaded when it is asked

        os.environ["RAYON_NUM_THREADS"] = str(thread_count(threads, "--threads"))
    if version:
        say(f"bgars {bgars.__version__}")
        raise typer.Exit
    if context.invoked_subcommand is None:
        say(context.get_help())
        raise typer.Exit(EXIT_BAD_INPUT)


@app.command()
def demo(
    what: Annotated[
        Literal["ball", "line"],
        typer.Argument(help="ball: one solder ball. line: a simulated station that delivers 50 parts."),
    ] = "ball",
    output: Annotated[Path, typer.Option("--output", "-o", metavar="OUT", help="Folder for the results.")] = Path(
        "bgars-demo"
    ),
    parts: Annotated[
        int | None, typer.Option(min=4, help="line: number of parts; 50 by default.", show_default=False)
    ] = None,
    no_open: Annotated[bool, typer.Option("--no-open", help="line: do not open the page of the lot.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Reconstruct the sample solder ball that comes with bgars, or simulate a station on a line.

    'bgars demo line' simulates 50 parts, three of them with a defect, puts them into an inbox, inspects them as they
    arrive (minutes), writes the page of their lot and, on a desktop, opens it.
    """
    if what == "line":
        from bgars.cli.demo_line import demo_line  # noqa: PLC0415 - loaded when it runs

        demo_line(output, parts=parts, opens=not no_open, as_json=as_json)
        return
    if parts is not None or no_open:
        msg = f"{'--no-open' if parts is None else '--parts'}: goes with 'bgars demo line' only"
        raise bgars.InputError(msg)
    folder = bgars.sample_capture()
    _need_places(folder, output)
    with picture_process(OVERVIEW) as painter:
        summary, files = _reconstruct_to(
            bgars.read_capture(folder), output, bgars.reconstruct, mesh_format="ply", directx=False, painter=painter
        )
    scores = {
        name: bgars.evaluate(bgars.read_capture(folder), method=name).to_dict()["normals"]
        for name in ("lambertian", DEFAULT_METHOD)
    }
    summary["evaluation"] = scores
    if as_json:
        print_json(summary)
        return
    say("A solder ball of 600 um diameter on its board, photographed (rendered) under 8 lights, one at a time.")
    say(
        f"Mean error of its normals: {scores[DEFAULT_METHOD]['mean_deg']:.2f} deg with {DEFAULT_METHOD}, "
        f"{scores['lambertian']['mean_deg']:.2f} deg with plain least squares: highlights are not diffuse light."
    )
    say("The height of the ball above its board is not in the normals: the surface between them is hidden.")
    say()
    say("Open these:")
    _list_files(output, files)
    say()
    own = "bgars reconstruct FOLDER -o OUT"
    say(f"Next: {activation()}bgars evaluate {shown_path(folder)}    or, on your own images: {own}")


@app.command()
def reconstruct(
    folder: FolderArgument,
    output: OutOption,
    method: MethodOption = DEFAULT_METHOD,
    threshold: ThresholdOption = None,
    material: MaterialOption = None,
    channel: ChannelChoice = None,
    station: StationOption = None,
    mesh_format: Annotated[Literal["ply", "obj", "stl", "glb"], typer.Option(help="Format of the mesh file.")] = "ply",
    height_format: Annotated[
        Literal["gsf", "sdf", "x3p"] | None,
        typer.Option(
            help="Also write the heights for metrology programs, in metres; needs the extra areal.", show_default=False
        ),
    ] = None,
    flatten: FlattenOption = None,
    colour: ColourOption = False,
    directx: DirectxOption = False,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Turn a folder of photographs into normals, a height map, a mesh and an overview picture.

    Writes overview.png, normals.png (16 bit), height.tif and height.npy (float32, um if the pixel pitch is known),
    mesh.ply and summary.json; files of an earlier run in OUT are replaced. Hidden steps, such as the height of a ball
    above its board, are not measured. The capture is checked first ('bgars check'): if lights and
    images do not fit, nothing is written (exit code 2) unless --force is given.
    """
    _need_places(folder, output)
    with picture_process(OVERVIEW) as painter:
        from bgars.cli.first_check import tell_first  # noqa: PLC0415 - loaded when it runs, while the process starts
        from bgars.pipelines.reconstruct import reconstructed  # noqa: PLC0415

        capture = bgars.read_capture(folder, channel=channel, station=station)
        if height_format is not None:
            from bgars.io.height import check_height_file  # noqa: PLC0415 - loaded when it runs

            check_height_file(output / f"height.{height_format}", has_pitch=capture.pixel_pitch_um is not None)
        checked: dict[str, Any] = {}

        def tell(findings: bgars.Findings) -> tuple[str, ...]:
            checked.update(tell_first(capture, findings, force=force).to_dict())
            return ()

        run = partial(
            reconstructed,
            tell=tell,
            method=method,
            threshold=threshold,
            material=_material_from(material, capture),
            flatten=flatten,
        )
        albedos = partial(bgars.colour_albedo, folder, channel=channel, station=station) if colour else None
        options = {"mesh_format": mesh_format, "height_format": height_format, "directx": directx, "colour": albedos}
        summary, files = _reconstruct_to(capture, output, run, **options, checked=checked, painter=painter)
    if as_json:
        print_json(summary)
        return
    height = summary["height"]
    low, high = (round(value, 1) + 0.0 for value in height[f"height_range_{height['unit']}"])  # no -0.0
    trust, _, method_line = choice_in_words(summary["normals"]).partition("\n")
    say(f"{summary['capture']}: {trust}")
    parts = height["components"]
    say(
        f"{summary['normals']['valid_pixels']} normals, height {low:.1f} to {high:.1f} {height['unit']} in "
        f"{counted(parts, 'connected part')}, {height['iterations']} solver iterations."
    )
    say(method_line)
    if height["bow"] is not None:
        say(f"warning: {height['bow']}")
    _list_files(output, files)


@app.command()
def normals(
    folder: FolderArgument,
    output: NormalsOutOption,
    method: MethodOption = DEFAULT_METHOD,
    threshold: ThresholdOption = None,
    material: MaterialOption = None,
    channel: ChannelChoice = None,
    station: StationOption = None,
    colour: ColourOption = False,
    directx: DirectxOption = False,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Estimate the normals only: normals.png (16 bit), albedo.tif, confidence.tif, measured.png, lights_kept.png.

    With '-o FILE', such as normals.exr: only the normals, in the format of the ending.

    The capture is checked first ('bgars check'): if lights and images do not fit, nothing is written (exit code 2)
    unless --force is given. Black background is left out.
    """
    from bgars.cli.first_check import check_first  # noqa: PLC0415 - loaded when it runs
    from bgars.cli.outputs import need_normals_place, write_normals  # noqa: PLC0415
    from bgars.normals.noise_floor import without_background  # noqa: PLC0415

    need_normals_place(output, folder, directx=directx, colour=colour)
    capture = bgars.read_capture(folder, channel=channel, station=station)
    findings = check_first(capture, force=force)
    surface = _material_from(material, capture)
    with stage_progress() as report:
        field = bgars.estimate_normals(
            capture,
            method=method,
            threshold=threshold,
            material=surface,
            progress=lambda fraction: report("normals", fraction),
        )
    field = without_background(field, capture)
    albedos = bgars.colour_albedo(folder, field, channel=channel, station=station) if colour else None
    summary, files = write_normals(field, output, directx=directx, albedo_rgb=albedos)
    if as_json:
        print_json({"capture": capture.name, **summary, **findings.to_dict()})
        return
    trust, _, method_line = choice_in_words(summary).partition("\n")
    say(f"{capture.name}: {trust}")
    say(
        f"{summary['valid_pixels']} normals, {summary['mean_lights_kept']:.1f} of {len(capture.rig)} lights kept on "
        f"average, mean confidence {summary['mean_confidence']:.2f}."
    )
    say(method_line)
    _list_files(output if output.is_dir() else output.parent, files)


@app.command()
def evaluate(
    folder: FolderArgument,
    method: Annotated[
        Method | None,
        typer.Option(
            "--method",
            "-m",
            **METHOD_ARGUMENTS,
            help=f"Estimator; by default each of {', '.join(METHODS)}. reflectance uses blind without balls.",
            show_default=False,
        ),
    ] = None,
    images: Annotated[
        Path | None,
        typer.Option(
            help="Text file with one image name per line: use only these images (such as ring8.txt).",
            show_default=False,
        ),
    ] = None,
    material: MaterialOption = None,
    channel: ChannelChoice = None,
    as_json: JsonOption = False,
) -> None:
    """Compare estimated normals with known ones (gt.npz of a scene; Normal_gt.npy, .mat or normal.txt of a photograph).

    Scenes are evaluated over ball pixels with true n_z > 0.3, photographs over their mask. A pixel without a solution
    counts as (0, 0, 1). Measured pixels are those whose own values determine the normal; on balls, the errors of about
    68 % of them should be within the stated standard error (docs/accuracy.md).
    """
    from bgars.files.light_files import read_filenames  # noqa: PLC0415 - loaded when it runs

    names = None if images is None else read_filenames(images)
    capture = bgars.read_capture(folder, channel=channel, images=names)
    surface = _material_from(material, capture)
    truth = bgars.read_truth(folder)
    with stage_progress() as report:
        results = []
        for name in METHODS if method is None else (method,):
            given = surface if method is not None or name == "reflectance" else None
            results.append(
                bgars.evaluate(capture, method=name, material=given, truth=truth, progress=partial(report, name))
            )
    if as_json:
        print_json({"capture": capture.name, "lights": len(capture.rig), "results": [r.to_dict() for r in results]})
        return
    for line in evaluation_table(results, len(capture.rig)):
        say(line)


def main() -> None:
    """Run the command."""
    run(app)


def _need_places(folder: Path, output: Path) -> None:
    """Raise unless there is a folder to read, and one for results that holds no inputs."""
    from bgars.io.given_paths import need_folder, need_output  # noqa: PLC0415 - loaded when it runs

    need_folder(folder)
    need_output(output, folder)


def _reconstruct_to(
    capture: bgars.Capture,
    output: Path,
    run: Callable[..., bgars.Reconstruction],
    **options: Any,  # noqa: ANN401 - those of write_reconstruction
) -> tuple[dict[str, Any], dict[str, str]]:
    from bgars.cli.outputs import write_reconstruction  # noqa: PLC0415 - loaded when it runs

    with stage_progress() as report:
        return write_reconstruction(lambda: run(capture, progress=report), output, **options)


def _material_from(path: Path | None, capture: bgars.Capture) -> bgars.SurfaceMaterial | None:
    return None if path is None else bgars.read_material(path, lights=len(capture.rig))


def _list_files(folder: Path, files: dict[str, str]) -> None:
    width = max(len(shown_path(folder / name)) for name in files)
    for name, meaning in files.items():
        say(f"  {shown_path(folder / name):<{width}}  {meaning}")
