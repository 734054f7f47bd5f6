"""`bgars shape`: slope, curvatures and fine relief of a surface, as images."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

import bgars
from bgars.cli.console import print_json, say, say_files, stage_progress, warn
from bgars.cli.surface_source import DirectxMapOption, MapMaskOption, MapPitchOption, need_map, read_surface
from bgars.extras import how_to_install
from bgars.io.atomic import FolderNames, atomic_folder
from bgars.io.given_paths import need_output
from bgars.report.figures.shape import SHAPE_FILES, SHAPE_PICTURE
from bgars.surface.shape_images import need_scale

__all__ = ["register"]

NAMES = FolderNames(frozenset(SHAPE_FILES), frozenset(), judged=False)


def register(app: typer.Typer) -> None:
    """Give the command to an app."""
    app.command()(shape)


def shape(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            help="A height map (.tif, .npy), such as height.tif of bgars reconstruct, or a normal map.",
            show_default=False,
        ),
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="OUT", help="Folder for the images.", show_default=False)
    ],
    scale_px: Annotated[
        float,
        typer.Option(
            help="Standard deviation of the Gaussian that smooths the surface, in pixels: finer details go to "
            "flattened.tif, coarser ones to slope and curvatures."
        ),
    ] = 2.0,
    pixel_pitch_um: MapPitchOption = None,
    directx: DirectxMapOption = None,
    mask: MapMaskOption = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of text.")] = False,
) -> None:
    """Write images of a surface's shape: slope, curvatures, dents and scratches.

    Slope, mean and Gaussian curvature of the smoothed surface, and the heights without it: dents, scratches and
    embossed marks that hardly show in a photograph stand out.
    """
    need_scale(scale_px, "--scale-px")
    need_map("shape", source, pixel_pitch_um=pixel_pitch_um, directx=directx, mask=mask)
    need_output(output, *([source.parent] if source.name in SHAPE_FILES else []))
    with stage_progress() as report, atomic_folder(output, NAMES) as place:
        height, notes = read_surface(source, pixel_pitch_um=pixel_pitch_um, directx=directx, mask=mask, report=report)
        report("shape", 0.0)
        images = bgars.shape_images(height, scale_px=scale_px)
        files = bgars.write_shape_images(images, place)
        report("shape", 1.0)
    slope, fine = (values[np.isfinite(values)] for values in (images.slope_deg, images.flattened))
    summary = {
        "unit": images.unit,
        "scale_px": images.scale_px,
        "median_slope_deg": float(np.median(slope)) if slope.size else None,
        "flattened_std": float(fine.std()) if fine.size else None,
        "notes": list(notes),
        "output": str(output),
        "files": list(files),
    }
    if as_json:
        print_json(summary)
        return
    for note in notes:
        say(f"note: {note}")
    if slope.size:
        say(
            f"Median slope {np.median(slope):.3g} degrees; finer than {scale_px:g} px: "
            f"standard deviation {fine.std():.3g} {images.unit}."
        )
    if SHAPE_PICTURE not in files:
        warn(f"{SHAPE_PICTURE} is left out: it {how_to_install('matplotlib')}")
    say()
    say_files(output, files)
