"""Options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from bgars.normals.methods import TABLE, Method, method_names

__all__ = [
    "METHOD_ARGUMENTS",
    "METHOD_METAVAR",
    "ChannelChoice",
    "ColourOption",
    "DirectxOption",
    "FlattenOption",
    "FolderArgument",
    "ForceOption",
    "JsonOption",
    "LotOption",
    "MaterialOption",
    "MethodOption",
    "NormalsOutOption",
    "OperatorOption",
    "OutOption",
    "RecipeOption",
    "RoundOption",
    "SerialFrom",
    "StationNameOption",
    "StationOption",
    "StoreOption",
    "ThresholdOption",
]

ChannelOption = Literal["luminance", "mean", "red", "green", "blue"]


def method_name(text: str) -> Method:
    """A method of bgars, or one that a package added; anything else is refused with the list of names."""
    if text not in TABLE and text not in method_names():
        msg = f"must be one of {', '.join(method_names())}; got {text!r}"
        raise typer.BadParameter(msg)
    return text


def _completed(incomplete: str) -> list[str]:
    return [name for name in method_names() if name.startswith(incomplete)]


def _place(name: Method) -> tuple[bool, int]:
    """The best method first, those that are not compared last."""
    return not TABLE[name].is_compared, -list(TABLE).index(name)


METHOD_HELP = "\n\n".join(f"{name}: {TABLE[name].summary}" for name in sorted(TABLE, key=_place))
METHOD_METAVAR = "METHOD"
METHOD_ARGUMENTS: dict[str, Any] = {"parser": method_name, "metavar": METHOD_METAVAR, "autocompletion": _completed}
MethodOption = Annotated[Method, typer.Option("--method", "-m", help=METHOD_HELP, **METHOD_ARGUMENTS)]
ForceOption = Annotated[
    bool,
    typer.Option(
        "--force",
        help="Continue although images and lights do not fit (order, mirrored, light below the surface, duplicates).",
    ),
]
LotOption = Annotated[str, typer.Option(metavar="LOT", help="Lot that the parts belong to.", show_default=False)]
StationNameOption = Annotated[
    str, typer.Option(metavar="NAME", help="Name of the station that took the images.", show_default=False)
]
OperatorOption = Annotated[str, typer.Option(metavar="NAME", help="Operator of the station.", show_default=False)]
RoundOption = Annotated[
    int | None,
    typer.Option(
        "--round",
        min=1,
        max=999_999,
        help="Number of the inspection of this serial number: 1 before rework, 2 after it; a store counts itself.",
        show_default=False,
    ),
]
StoreOption = Annotated[
    Path,
    typer.Option(
        "--output", "-o", metavar="STORE", help="Folder of the store; created if missing.", show_default=False
    ),
]
RecipeOption = Annotated[
    Path | None,
    typer.Option("--recipe", "-r", metavar="PART.toml", help="Layout and limits of the part.", show_default=False),
]
SerialFrom = Annotated[
    str,
    typer.Option(
        metavar="PATTERN",
        help="Source of serial numbers: a pattern for the folder's name with {serial}, {lot}, {substrate}, "
        "{position}, {station}, {operator}, {round}, such as '{lot}/{serial}'; or 'code', the "
        r"DataMatrix or QR code in the images. A \[part] table in capture.toml takes precedence.",
    ),
]
StationOption = Annotated[
    Path | None,
    typer.Option(
        metavar="STATION.toml",
        help="Calibrated station (docs/station.md), whose lights, response, flat field and scale are used.",
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
    typer.Option(
        "--output", "-o", metavar="OUT", help="Folder for the results; created if missing.", show_default=False
    ),
]
NormalsOutOption = Annotated[
    Path,
    typer.Option(
        "--output",
        "-o",
        metavar="OUT",
        help="Folder for the results, created if missing; or one file of normals: .png, .tif, .exr, .npy, .npz.",
        show_default=False,
    ),
]
ThresholdOption = Annotated[
    float | None,
    typer.Option(
        help="Gap of specular-filter, in grey levels of 255 (scaled with the bit depth); 50 by default.",
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
    typer.Option(
        help="How colour is reduced to one value (linear); by default as in capture.toml, else luminance.",
        show_default=False,
    ),
]
ColourOption = Annotated[
    bool,
    typer.Option("--colour", help="Also write albedo_rgb.tif: albedo of red, green and blue, by the same normals."),
]
DirectxOption = Annotated[bool, typer.Option("--directx", help="Write normals.png with green = y down (DirectX).")]
FlattenOption = Annotated[
    Literal["plane", "quadratic"] | None,
    typer.Option(
        help="Subtract a plane, or a quadratic surface, from the heights: inaccurate or near lights bow a flat part.",
        show_default=False,
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON object instead of text.")]
