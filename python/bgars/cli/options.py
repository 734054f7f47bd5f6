"""Options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from bgars.normals.methods import Method

__all__ = [
    "ChannelChoice",
    "DirectxOption",
    "FlattenOption",
    "FolderArgument",
    "ForceOption",
    "JsonOption",
    "LotOption",
    "MaterialOption",
    "MethodOption",
    "OperatorOption",
    "OutOption",
    "StationNameOption",
    "StationOption",
    "ThresholdOption",
]

ChannelOption = Literal["luminance", "mean", "red", "green", "blue"]

METHOD_HELP = (
    "reflectance: on balls, highlights included, by the material that is fitted on them, elsewhere robust-filter; "
    "without balls and a material, under fewer than 6 lights, or where no material explains the balls: blind. "
    "robust-filter: the window of sorted values that a matt facet explains best, shadows and highlights left out. "
    "specular-filter: the published sorted-gap filter. lambertian: all lights. "
    "blind: one material is fitted to the whole capture together with every normal, and taken where it predicts "
    "lights left out about as well as least squares and robust-filter, else the better of these; slow; under fewer "
    "than 5 lights robust-filter."
)
MethodOption = Annotated[Method, typer.Option("--method", "-m", help=METHOD_HELP)]
ForceOption = Annotated[
    bool,
    typer.Option(
        "--force",
        help="Go on though the images do not fit the lights (order, mirrored, below the surface, an image twice).",
    ),
]
LotOption = Annotated[str, typer.Option(metavar="LOT", help="Lot of all parts.", show_default=False)]
StationNameOption = Annotated[
    str, typer.Option(metavar="NAME", help="Name of the station that took the images.", show_default=False)
]
OperatorOption = Annotated[str, typer.Option(metavar="NAME", help="Who runs it.", show_default=False)]
StationOption = Annotated[
    Path | None,
    typer.Option(
        metavar="station.toml",
        help="The calibrated station (docs/station.md): its lights, response, flat field and scale are used.",
        show_default=False,
    ),
]
FolderArgument = Annotated[
    Path,
    typer.Argument(
        metavar="FOLDER",
        help=(
            "Capture folder: images, and capture.toml, or light_directions.txt (DiLiGenT), one .lp file (RTI), "
            "or another file about the lights (docs/captures.md)."
        ),
        show_default=False,
    ),
]
OutOption = Annotated[
    Path,
    typer.Option("--output", "-o", metavar="OUT", help="Folder for the results; made if missing.", show_default=False),
]
ThresholdOption = Annotated[
    float | None,
    typer.Option(
        help="Gap of specular-filter, in grey levels of 255, scaled with the bit depth; 50 by default.",
        show_default=False,
    ),
]
MaterialOption = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="Material for reflectance, from 'bgars calibrate material' under the same lights at the same exposure.",
        show_default=False,
    ),
]
ChannelChoice = Annotated[
    ChannelOption | None,
    typer.Option(help="How colour becomes one value (linear); the recipe's choice by default.", show_default=False),
]
DirectxOption = Annotated[bool, typer.Option("--directx", help="Write normals.png with green = y down.")]
FlattenOption = Annotated[
    Literal["plane", "quadratic"] | None,
    typer.Option(
        help="Take one plane, or one quadratic surface, off the heights: so wrong or near lights bend flat parts.",
        show_default=False,
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON object for machines instead of text.")]
