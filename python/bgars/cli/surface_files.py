"""One file of a surface, its kind by the ending: a mesh, points, or heights."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import bgars
from bgars.errors import InputError
from bgars.extras import how_to_install, missing
from bgars.io.areal_files import AREAL_PACKAGES, check_areal
from bgars.io.height import HEIGHT_FORMATS
from bgars.io.mesh_files import MESH_SUFFIXES

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

__all__ = ["POINTS", "check_surface_file", "need_pitch", "surface_in_words", "write_surface"]

POINTS = ".xyz"
"""Points as PLY are left to :func:`bgars.write_points`: here .ply is a mesh."""


def check_surface_file(output: Path, simplify_um: float | None) -> None:
    """Raise InputError where the file could not be written, before the work that leads to it."""
    suffix = output.suffix.lower()
    if suffix not in {*MESH_SUFFIXES, POINTS, *HEIGHT_FORMATS}:
        msg = (
            f"{output}: ends in {output.suffix!r}; mesh writes meshes ({', '.join(MESH_SUFFIXES)}), points ({POINTS}) "
            f"and heights ({', '.join(HEIGHT_FORMATS)})"
        )
        raise InputError(msg)
    check_areal(suffix, output, has_pitch=True)
    if simplify_um is None:
        return
    if suffix not in MESH_SUFFIXES:
        msg = f"--simplify: only meshes have triangles ({', '.join(MESH_SUFFIXES)}); {output} does not"
        raise InputError(msg)
    if not (math.isfinite(simplify_um) and simplify_um > 0):
        msg = f"--simplify: must be finite and above 0, got {simplify_um:g}"
        raise InputError(msg)
    if missing("fast_simplification"):
        msg = f"--simplify {how_to_install('fast_simplification')}"
        raise InputError(msg)


def need_pitch(pitch_um: float | None, output: Path, simplify_um: float | None) -> None:
    """Raise InputError where what is written is in metres or micrometres, and nothing says how large a pixel is."""
    suffix = output.suffix.lower()
    if pitch_um is None and (simplify_um is not None or suffix in AREAL_PACKAGES):
        what = suffix if simplify_um is None else "--simplify"
        msg = f"--pixel-pitch-um: must be given, {what} needs heights in um or m, and these are in pixels"
        raise InputError(msg)


def write_surface(
    height: bgars.HeightMap, output: Path, *, simplify_um: float | None, report: Callable[[str, float], object]
) -> dict[str, Any]:
    """Write a surface as the ending says; return what was written, as numbers."""
    suffix = output.suffix.lower()
    need_pitch(height.pixel_pitch_um, output, simplify_um)
    if suffix == POINTS:
        bgars.write_points(height, output)
        return {"points": int(height.mask.sum()), "unit": height.unit}
    if suffix in HEIGHT_FORMATS:
        bgars.write_height(height, output)
        rows, cols = height.mask.shape
        unit = "m" if suffix in AREAL_PACKAGES else height.unit
        return {"valid_pixels": int(height.mask.sum()), "image_size_px": [cols, rows], "unit": unit}
    if simplify_um is None:
        mesh = bgars.mesh_from_height(height)
        bgars.write_mesh(mesh, output)
        return {"vertices": len(mesh.vertices), "faces": len(mesh.faces), "unit": height.unit}
    result = bgars.simplified_mesh(height, max_error_um=simplify_um, progress=lambda done: report("mesh", done))
    bgars.write_mesh(result.mesh, output)
    counts = {"vertices": len(result.mesh.vertices), "faces": len(result.mesh.faces), "full_faces": result.full_faces}
    return {**counts, "max_error_um": result.max_error_um, "unit": height.unit}


def surface_in_words(written: dict[str, Any]) -> str:
    """What was written, in a phrase."""
    if "points" in written:
        return f"{written['points']} points, in {written['unit']}"
    if "valid_pixels" in written:
        cols, rows = written["image_size_px"]
        return f"{written['valid_pixels']} heights of {cols} x {rows} pixels, in {written['unit']}"
    words = f"{written['vertices']} vertices, {written['faces']} faces"
    if "max_error_um" in written:
        words += f" of {written['full_faces']}, heights within {written['max_error_um']:.3g} um at every pixel"
    return f"{words}, in {written['unit']}"
