"""Mesh files: PLY and OBJ by the Rust core, STL and GLB by trimesh."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bgars import _bgars
from bgars.errors import InputError
from bgars.io.atomic import atomic_file
from bgars.io.own_files import sign
from bgars.records.height_map import HeightMap
from bgars.records.scalar_checks import thread_count

if TYPE_CHECKING:
    from os import PathLike

    import trimesh
    from numpy.typing import NDArray

    from bgars.records.normal_field import NormalField

__all__ = ["MESH_SUFFIXES", "NATIVE_SUFFIXES", "write_mesh"]

MESH_SUFFIXES = (".ply", ".obj", ".stl", ".glb")
NATIVE_SUFFIXES = (".ply", ".obj")
"""Written by the Rust core."""


def write_mesh(
    mesh: trimesh.Trimesh | HeightMap,
    path: str | PathLike[str],
    *,
    field: NormalField | None = None,
    threads: int | None = None,
) -> None:
    """Write a mesh, or a height map as one; the suffix chooses the format.

    ``.ply`` (binary) and ``.obj`` carry vertex normals and, where the mesh has them, vertex colours; ``.stl`` carries
    faces only; ``.glb`` is for viewers. Numbers stay in the mesh's unit (``metadata["unit"]``), which PLY and OBJ
    name in a comment. The file appears whole or not at all. A height map goes to PLY and OBJ without a mesh in memory,
    row by row; masked pixels and the faces at them are left out.

    Parameters
    ----------
    mesh : trimesh.Trimesh or HeightMap
        For instance from :func:`bgars.mesh_from_height`.
    path : path
        File to write, ending in .ply, .obj, .stl or .glb.
    field : NormalField, optional
        With a height map: gives each vertex its estimated normal and its albedo as grey. Without it a file carries
        neither; viewers compute normals from the faces.
    threads : int, optional
        Largest number of threads; by default ``RAYON_NUM_THREADS``, else one per core.

    Raises
    ------
    InputError
        An unknown suffix, a mesh without faces, a height map to .stl or .glb, a field with a mesh or of another size
        than the height map.
    FileFormatError
        The file cannot be written.

    Examples
    --------
    >>> import bgars, numpy as np, pathlib, tempfile
    >>> mesh = bgars.mesh_from_height(bgars.HeightMap.from_array(np.zeros((2, 2), np.float32)))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     bgars.write_mesh(mesh, pathlib.Path(folder) / "flat.ply")
    ...     [path.name for path in pathlib.Path(folder).iterdir()]
    ['flat.ply']
    """
    threads = thread_count(threads)
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in MESH_SUFFIXES:
        msg = f"{path}: a mesh file must end in {', '.join(MESH_SUFFIXES)}; got {suffix!r}"
        raise InputError(msg)
    if isinstance(mesh, HeightMap):
        if suffix in NATIVE_SUFFIXES:
            _write_height(mesh, field, path, threads)
            return
        msg = (
            f"{path}: a height map is written as {' or '.join(NATIVE_SUFFIXES)}; for {suffix}, make a mesh of it first"
        )
        raise InputError(msg)
    if field is not None:
        msg = "field: goes with a height map; a mesh brings its own normals and colours"
        raise InputError(msg)
    if not hasattr(mesh, "faces"):
        msg = f"mesh: must be a trimesh.Trimesh or a HeightMap, got {type(mesh).__name__}"
        raise InputError(msg)
    if len(mesh.faces) == 0:
        msg = f"mesh: has no faces to write to {path}"
        raise InputError(msg)
    with atomic_file(path) as temporary:
        if suffix in NATIVE_SUFFIXES:
            vertices = np.ascontiguousarray(mesh.vertices, dtype=np.float64)
            faces = np.ascontiguousarray(mesh.faces, dtype=np.int64)
            _bgars.write_mesh(
                temporary,
                vertices,
                faces,
                normals=_normals(mesh, vertices, faces, threads),
                colors=_colors(mesh),
                comments=_comments(mesh.metadata.get("unit", "unknown")),
                threads=threads,
            )
        else:
            options = {"tree_postprocessor": _signed} if suffix == ".glb" else {}
            mesh.export(temporary, file_type=suffix[1:], **options)
            sign(temporary)


def _write_height(height: HeightMap, field: NormalField | None, path: Path, threads: int | None) -> None:
    """A height map to PLY or OBJ, streamed."""
    height.check_field(field)
    with atomic_file(path) as temporary:
        _bgars.write_height(
            temporary,
            np.ascontiguousarray(height.height_px),
            np.ascontiguousarray(height.mask),
            1.0 if height.pixel_pitch_um is None else height.pixel_pitch_um,
            normals=None if field is None else np.ascontiguousarray(field.normals),
            grey=None if field is None else field.grey_levels(),
            comments=_comments(height.unit),
            threads=threads,
        )


def _signed(tree: dict[str, Any]) -> None:
    """Say in a GLB that bgars wrote it."""
    tree["asset"] = {**tree.get("asset", {}), "generator": "bgars"}


def _comments(unit: str) -> list[str]:
    return [f"bgars mesh, unit {unit}, x right, y up, z toward the camera"]


def _normals(
    mesh: trimesh.Trimesh, vertices: NDArray[np.float64], faces: NDArray[np.int64], threads: int | None
) -> NDArray[np.float64]:
    """(N, 3) vertex normals: those the mesh has, else those of its faces (seconds of work for trimesh)."""
    # trimesh has no public way to ask; its own exporters look here too.
    has_normals = "vertex_normals" in mesh._cache
    normals = mesh.vertex_normals if has_normals else _bgars.vertex_normals(vertices, faces, threads=threads)
    return np.ascontiguousarray(normals, dtype=np.float64)


def _colors(mesh: trimesh.Trimesh) -> np.ndarray[tuple[int, ...], np.dtype[np.uint8]] | None:
    """(N, 3) red, green, blue, or None where the mesh has no vertex colours of its own."""
    from trimesh.visual import ColorVisuals  # noqa: PLC0415 - whoever has a mesh has loaded it

    if not isinstance(mesh.visual, ColorVisuals) or mesh.visual.kind != "vertex":
        return None
    return np.ascontiguousarray(mesh.visual.vertex_colors[:, :3], dtype=np.uint8)
