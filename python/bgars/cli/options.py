"""Options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bgars.normals.methods import Method

__all__ = ["ForceOption", "LotOption", "MethodOption", "OperatorOption", "StationNameOption", "StationOption"]

METHOD_HELP = (
    "reflectance: on balls, highlights included, by the material that is fitted on them, elsewhere robust-filter; "
    "without balls and a material, under fewer than 4 lights, or where no material explains the balls: blind. "
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
