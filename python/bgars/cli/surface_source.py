"""A surface that a command is given: a normal map, which is integrated, or a height map."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

import bgars
from bgars.errors import FileFormatError, InputError
from bgars.io.height import HEIGHT_SUFFIXES, read_stored_height
from bgars.io.normal_map import holds_normals, read_stored_normals
from bgars.io.normal_map_pixels import NORMAL_MAP_SUFFIXES
from bgars.pipelines.reconstruct import solver_fraction
from bgars.records.scalar_checks import check_pitch

if TYPE_CHECKING:
    from collections.abc import Callable

    from bgars.records.pixels import FloatArray

__all__ = ["DirectxMapOption", "MapMaskOption", "MapPitchOption", "is_normal_map", "need_map", "read_surface"]

MapPitchOption = Annotated[
    float | None,
    typer.Option(
        "--pixel-pitch-um",
        help="Pixel pitch in um; a .tif of bgars contains it, other height maps (in um) need it.",
        show_default=False,
    ),
]
DirectxMapOption = Annotated[
    bool | None,
    typer.Option(
        "--directx/--opengl",
        help="Green of the normal map is y down (up). By default the curl of its field decides.",
        show_default=False,
    ),
]
MapMaskOption = Annotated[
    Path | None,
    typer.Option(
        "--mask",
        help="Image, white = use, for a normal map; by default opaque pixels, without a background of one colour.",
        show_default=False,
    ),
]


def is_normal_map(source: Path) -> bool:
    """Whether a file holds normals; one that cannot be read counts by its name."""
    has_content = source.is_file() and source.stat().st_size > 0
    return holds_normals(source) if has_content else source.suffix.lower() not in HEIGHT_SUFFIXES


def need_map(
    command: str, source: Path, *, pixel_pitch_um: float | None, directx: bool | None, mask: Path | None
) -> None:
    """Raise unless there is a file that could be a map, with options that go with it."""
    if source.is_dir():
        what = "is a folder"
    elif not source.is_file():
        what = "no such file"
    elif source.suffix.lower() not in {*NORMAL_MAP_SUFFIXES, *HEIGHT_SUFFIXES}:
        what = f"ends in {source.suffix!r}"
    elif not source.stat().st_size:
        what = "is empty (0 bytes)"
    else:
        check_pitch(pixel_pitch_um, "--pixel-pitch-um")
        if (mask is not None or directx is not None) and not is_normal_map(source):
            msg = f"--mask, --directx, --opengl: {source} is a height map; leave them out"
            raise InputError(msg)
        return
    msg = (
        f"{source}: {what}; {command} takes a normal map ({', '.join(NORMAL_MAP_SUFFIXES)}) "
        f"or a height map ({', '.join(HEIGHT_SUFFIXES)})"
    )
    raise FileFormatError(msg)


def read_surface(
    source: Path,
    *,
    pixel_pitch_um: float | None,
    directx: bool | None,
    mask: Path | None,
    report: Callable[[str, float], None],
    integration: dict[str, Any] | None = None,
) -> tuple[bgars.HeightMap, tuple[str, ...]]:
    """Return the heights of a map, and what was assumed about it. `integration`: as integrate_normals takes it."""
    if is_normal_map(source):
        normals = read_stored_normals(source, directx=directx, mask=mask)
        _need_some(source, normals.vectors, "normal")
        return _integrated(normals.vectors, pixel_pitch_um, integration or {}, report), normals.notes
    return _stored_height(source, pixel_pitch_um)


def _need_some(source: Path, values: FloatArray, what: str) -> None:
    if not np.isfinite(values).any():
        rows, columns = values.shape[:2]
        msg = f"{source}: holds no {what}: all of its {columns} x {rows} pixels are invalid"
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


def _stored_height(source: Path, pixel_pitch_um: float | None) -> tuple[bgars.HeightMap, tuple[str, ...]]:
    """A height map in the unit that its file names, or in um where only the command names a pitch; and its notes."""
    values, unit, stored_um, notes = read_stored_height(source)
    _need_some(source, values, "height")
    if stored_um is not None and pixel_pitch_um not in {None, stored_um}:
        msg = f"--pixel-pitch-um: {source} says {stored_um}, got {pixel_pitch_um}; leave it out"
        raise InputError(msg)
    if unit is None and pixel_pitch_um is None:
        msg = f"--pixel-pitch-um: must be given, {source} names no unit: its heights are then taken as um"
        raise InputError(msg)
    if unit == "px" and pixel_pitch_um is not None:
        values = values * pixel_pitch_um
    return bgars.HeightMap.from_array(values, pixel_pitch_um=pixel_pitch_um or stored_um), notes
