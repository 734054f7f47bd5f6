"""The commands ``bgars calibrate ...``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import bgars
from bgars.cli.calibrate_camera import register as register_camera
from bgars.cli.calibrate_station import register as register_station
from bgars.cli.console import print_json, say, stage_progress
from bgars.cli.drift import register as register_drift
from bgars.files.counted import counted
from bgars.io.masks import read_mask
from bgars.io.material_file import material_path
from bgars.io.own_files import need_new_or_own
from bgars.pipelines.reconstruct import summarise_fit
from bgars.records.reflectance_fit import loss_in_words

if TYPE_CHECKING:
    from collections.abc import Iterator

    from bgars.records.reflectance_fit import ReflectanceFit
    from bgars.records.surface_material import SurfaceMaterial

__all__ = ["register"]

TAIL_LIMITS = (0.0, 1.0)


def register(app: typer.Typer) -> None:
    """Add the group of commands."""
    group = typer.Typer(
        name="calibrate",
        help="Calibrate what all captures of a station share, and keep it in a file.",
        no_args_is_help=True,
    )
    group.callback()(lambda: None)
    group.command("material")(material)
    register_station(group)
    register_camera(group)
    register_drift(group)
    app.add_typer(group)


def material(
    folder: Annotated[
        Path,
        typer.Argument(
            metavar="FOLDER",
            help="Capture folder with balls, or with a reference sphere of the same solder.",
            show_default=False,
        ),
    ],
    output: Annotated[
        Path,
        typer.Option(
            "--output", "-o", metavar="FILE", help="Material file, .toml; replaced if it exists.", show_default=False
        ),
    ],
    sphere_mask: Annotated[
        Path | None,
        typer.Option(
            metavar="IMAGE",
            help="Mask of one reference sphere (white); by default balls are searched for.",
            show_default=False,
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of text.")] = False,
) -> None:
    """Fit how a surface shines, on the balls of a capture, for 'bgars normals --material FILE' and the other commands.

    The file is valid for captures under the same lights at the same exposure. Exit code 2 where there is no ball or no
    material that explains them; nothing is written then.
    """
    output = material_path(output)
    need_new_or_own(output, sphere_mask)
    capture = bgars.read_capture(folder)
    anchors = None if sphere_mask is None else read_mask(sphere_mask, (capture.mask.shape[0], capture.mask.shape[1]))
    with stage_progress() as report:
        fit = bgars.calibrate_material(capture, anchors=anchors, progress=lambda fraction: report("material", fraction))
    balls = len(fit.circles_px)
    words = loss_in_words(fit.loss, accepted=fit.accepted)
    bgars.write_material(fit.material, output, capture=capture.name, balls=balls, loss=fit.loss)
    if as_json:
        summary = {"bgars": bgars.__version__, "capture": capture.name, **summarise_fit(fit)}
        print_json({**summary, "explains": words, "file": str(output)})
        return
    say(f"{capture.name}: material fitted on {counted(balls, 'ball')} under {len(capture.rig)} lights.")
    for line in _table(fit.material):
        say(f"  {line}")
    say(f"It explains the balls {words} (loss {fit.loss:.3f}).")
    for line in _remarks(fit):
        say(line)
    say(f"Written: {output}")


def _table(surface: SurfaceMaterial) -> Iterator[str]:
    """Each parameter with its standard error, where it has one."""
    values: list[tuple[str, str, float, str]] = [
        ("diffuse", "diffuse light", surface.diffuse_level, "grey levels of 255"),
        ("grazing", "loss at grazing angles", surface.grazing, "of the diffuse light"),
        ("ambient", "ambient light", surface.ambient_level, "grey levels of 255"),
    ]
    for index, lobe in enumerate(surface.lobes, start=1):
        which = f"lobe {index}" if len(surface.lobes) > 1 else "lobe"
        values += [
            (f"strength_{index}", f"{which}: strength", lobe.strength_level, "grey levels of 255"),
            (f"roughness_{index}", f"{which}: roughness", lobe.roughness, "root mean square slope"),
            (f"tail_{index}", f"{which}: tail", lobe.tail, "0 Beckmann, 1 GGX"),
        ]
    for key, words, value, unit in values:
        error = surface.standard_errors.get(key)
        spread = "(held)" if error is None else f"+- {error:.2g}"
        if key.startswith("tail") and value in TAIL_LIMITS:
            spread = "(at limit)"  # where the standard error of a free parameter says nothing
        yield f"{words:<24} {value:>10.4g} {spread:<11} {unit}"
    errors = [error for key, error in surface.standard_errors.items() if key.startswith("gain")]
    spread = f" +- {max(errors):.2g}" if errors else " (held)"
    yield f"{'gains of the lights':<24} {'  '.join(f'{gain:.3f}' for gain in surface.gains)}{spread}"
    yield f"{'masking':<24} {surface.masking:>10}"


def _remarks(fit: ReflectanceFit) -> Iterator[str]:
    """What is not in the file."""
    own = sum(fit.own_material)
    if own:
        yield f"{own} of the balls differ clearly in material: one file for all of them is a compromise."
    if fit.residuals_learnt:
        yield "The balls share a residual that no material explains (interreflection); the file does not contain it."
    if any(flat is not None for flat in fit.flat_radius):
        yield "Some balls have a flat top."
