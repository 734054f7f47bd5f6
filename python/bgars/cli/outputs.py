"""The files that commands leave behind, each folder whole or not at all."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any

import imageio.v3 as iio
import numpy as np

import bgars
from bgars.cli.console import warn
from bgars.cli.drawing import OVERVIEW
from bgars.errors import FileFormatError, InputError
from bgars.extras import how_to_install, missing
from bgars.io.areal_files import AREAL_PACKAGES
from bgars.io.atomic import FolderNames, atomic_folder
from bgars.io.described_tiff import write_described
from bgars.io.formats import check_normals_file
from bgars.io.given_paths import need_folder, need_output
from bgars.io.mesh_files import MESH_SUFFIXES, NATIVE_SUFFIXES
from bgars.pipelines.reconstruct import summarise_field
from bgars.report.figures.overview_content import overview_content

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from bgars.pipelines.reconstruct import Reconstruction
    from bgars.records.normal_field import NormalField
    from bgars.records.pixels import FloatArray
    from bgars.report.figures.process import PictureProcess

__all__ = ["need_normals_place", "write_normals", "write_reconstruction"]

MARK = "summary.json"
RECONSTRUCTION = FolderNames(
    frozenset({"overview.png", "normals.png", "height.tif", "height.npy", "albedo_rgb.tif", MARK})
    | {f"mesh{suffix}" for suffix in MESH_SUFFIXES}
    | {f"height{suffix}" for suffix in AREAL_PACKAGES},
    frozenset({MARK}),
    judged=False,
)

COLOUR = {"albedo_rgb.tif": "diffuse reflectance in red, green and blue, float32"}
NORMALS = FolderNames(
    frozenset({"normals.png", "albedo.tif", "albedo_rgb.tif", "confidence.tif", "measured.png", "lights_kept.png"}),
    frozenset(),
    judged=False,
)

FILE_ENDING = re.compile(r"\.(x3p|[a-z]{3,5})")
"""What follows the dot of out.v2 or lot.2026 is part of a folder's name."""


def write_reconstruction(
    run: Callable[[], Reconstruction],
    output: Path,
    *,
    mesh_format: str,
    directx: bool,
    height_format: str | None = None,
    checked: dict[str, Any] | None = None,
    colour: Callable[[NormalField], FloatArray] | None = None,
    painter: PictureProcess | None = None,
) -> tuple[dict[str, Any], dict[str, str]]:
    """Run a reconstruction and write its results; return its summary and what each file is.

    The output folder is tried first, so that no work is lost to an unwritable one. What an earlier reconstruction left
    there goes when the new files come. `height_format`: gsf, sdf or x3p, besides. `checked`: what the check of the
    capture found, by the time that `run` returns. `colour`: makes albedo_rgb.tif of the normals. `painter` draws the
    picture while the other files are written.
    """
    with atomic_folder(output, RECONSTRUCTION) as folder:
        result = run()
        unit = result.height.unit
        files = {
            "overview.png": "the picture to look at first",
            f"mesh.{mesh_format}": f"the surface in 3-D, in {unit} (MeshLab, Blender, CloudCompare)",
            "normals.png": _normals_meaning(directx),
            "height.tif": f"heights, float32, in {unit}",
            "height.npy": "the same for numpy",
            **({f"height.{height_format}": "the same for surface metrology, in m"} if height_format else {}),
            **(COLOUR if colour else {}),
            MARK: "the numbers of this run",
        }
        if missing("matplotlib"):
            del files["overview.png"]
            warn(f"overview.png is left out: it {how_to_install('matplotlib')}")
        if painter is not None:
            painter.start(OVERVIEW, "draw_overview", overview_content(result), folder / "overview.png")
        elif "overview.png" in files:
            bgars.write_overview(result, folder / "overview.png")
        _write_files(result, folder, mesh_format, directx, height_format)
        if colour is not None:
            write_described(folder / "albedo_rgb.tif", colour(result.field), "albedo of red, green, blue")
        if painter is not None:
            painter.finish()
        summary = {
            "format": "bgars-reconstruction",
            "bgars": bgars.__version__,
            **result.summary(),
            **(checked or {}),
            "files": list(files),
        }
        (folder / MARK).write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
    return summary, files


def _write_files(
    result: Reconstruction, folder: Path, mesh_format: str, directx: bool, height_format: str | None
) -> None:
    """Write all but the picture."""
    _write_mesh(result, folder / f"mesh.{mesh_format}")
    bgars.write_normal_map(result.field, folder / "normals.png", directx=directx)
    for ending in ("tif", "npy", *([height_format] if height_format else [])):
        bgars.write_height(result.height, folder / f"height.{ending}")


def _write_mesh(result: Reconstruction, path: Path) -> None:
    """Write the surface; without a mesh in memory where the format can be written by rows."""
    if path.suffix in NATIVE_SUFFIXES:
        bgars.write_mesh(result.height, path, field=result.field)
    else:
        bgars.write_mesh(result.mesh, path)


def _normals_meaning(directx: bool) -> str:
    return "normals, 16 bit, DirectX (green = y down)" if directx else "normals, 16 bit, OpenGL (green = y up)"


def need_normals_place(output: Path, capture: Path, *, directx: bool, colour: bool = False) -> None:
    """Raise where the normals of a capture could not be written as a folder or a file, before the work."""
    need_folder(capture)
    if not _is_named_file(output):
        need_output(output, capture)
        return
    try:
        check_normals_file(output)
    except InputError as error:
        msg = f"{error}; for results in a folder of this name, make it first"
        raise InputError(msg) from None
    if colour:
        msg = f"--colour: goes with a folder for the results; leave it out for {output}"
        raise InputError(msg)
    if directx and output.suffix.lower() != ".png":
        msg = f"--directx: only a .png says which way its green points; leave it out for {output}"
        raise InputError(msg)
    if not output.parent.is_dir():
        msg = f"{output}: cannot be written (no such folder)"
        raise FileFormatError(msg)
    need_output(output.parent, capture)


def write_normals(
    field: NormalField, output: Path, *, directx: bool, albedo_rgb: FloatArray | None = None
) -> tuple[dict[str, Any], dict[str, str]]:
    """Write a normal field as pictures, or as the one file that is named; return its summary and what each file is."""
    if _is_named_file(output):
        is_picture = output.suffix.lower() == ".png"
        files = {output.name: _normals_meaning(directx) if is_picture else "normals, float32, x right, y up"}
        if is_picture:
            bgars.write_normal_map(field, output, directx=directx)
        else:
            bgars.write_normals(field, output)
        return {**summarise_field(field), "files": list(files)}, files
    files = {
        "normals.png": _normals_meaning(directx),
        "albedo.tif": "diffuse reflectance times light, float32, 1 = full scale",
        **(COLOUR if albedo_rgb is not None else {}),
        "confidence.tif": "trust in each normal, float32, 0 to 1",
        "measured.png": "white: the pixel's own light fixes its normal",
        "lights_kept.png": "number of lights in each fit",
    }
    with atomic_folder(output, NORMALS) as folder:
        bgars.write_normal_map(field, folder / "normals.png", directx=directx)
        write_described(folder / "albedo.tif", field.albedo, "albedo")
        if albedo_rgb is not None:
            write_described(folder / "albedo_rgb.tif", albedo_rgb, "albedo of red, green, blue")
        write_described(folder / "confidence.tif", field.confidence, "confidence")
        iio.imwrite(folder / "measured.png", np.where(field.is_measured, 255, 0).astype(np.uint8))
        iio.imwrite(folder / "lights_kept.png", np.minimum(field.lights_kept, 255).astype(np.uint8))
    return {**summarise_field(field), "files": list(files)}, files


def _is_named_file(output: Path) -> bool:
    """Whether a place for results is meant as one file: it ends as files do, and there is no such folder."""
    return FILE_ENDING.fullmatch(output.suffix.lower()) is not None and not output.is_dir()
