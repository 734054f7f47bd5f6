"""Mesh files: PLY and OBJ by the Rust core, STL and GLB by trimesh."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from trimesh.visual import ColorVisuals

from bgars import _bgars
from bgars.errors import InputError
from bgars.io.atomic import atomic_file

if TYPE_CHECKING:
    from os import PathLike

    import trimesh
    from numpy.typing import NDArray

__all__ = ["MESH_SUFFIXES", "write_mesh"]

MESH_SUFFIXES = (".ply", ".obj", ".stl", ".glb")


def write_mesh(mesh: trimesh.Trimesh, path: str | PathLike[str]) -> None:
    """Write a mesh; the suffix chooses the format.

    ``.ply`` (binary) and ``.obj`` carry vertex normals and, where the mesh has them, vertex colours; ``.stl`` carries
    faces only; ``.glb`` is for viewers. Numbers stay in the mesh's unit (``metadata["unit"]``), which PLY and OBJ
    name in a comment. The file appears whole or not at all.

    Parameters
    ----------
    mesh : trimesh.Trimesh
        For instance from :func:`bgars.mesh_from_height`.
    path : path
        File to write, ending in .ply, .obj, .stl or .glb.

    Raises
    ------
    InputError
        An unknown suffix or a mesh without faces.
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
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in MESH_SUFFIXES:
        msg = f"{path}: a mesh file must end in {', '.join(MESH_SUFFIXES)}; got {suffix!r}"
        raise InputError(msg)
    if len(mesh.faces) == 0:
        msg = f"mesh: has no faces to write to {path}"
        raise InputError(msg)
    with atomic_file(path) as temporary:
        if suffix in {".ply", ".obj"}:
            write = _bgars.write_ply if suffix == ".ply" else _bgars.write_obj
            vertices = np.ascontiguousarray(mesh.vertices, dtype=np.float64)
            faces = np.ascontiguousarray(mesh.faces, dtype=np.int64)
            write(
                temporary,
                vertices,
                faces,
                normals=_normals(mesh, vertices, faces),
                colors=_colors(mesh),
                comments=[
                    f"bgars mesh, unit {mesh.metadata.get('unit', 'unknown')}, x right, y up, z toward the camera"
                ],
            )
        else:
            mesh.export(temporary, file_type=suffix[1:])


def _normals(mesh: trimesh.Trimesh, vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.float64]:
    """(N, 3) vertex normals: those the mesh has, else those of its faces (seconds of work for trimesh)."""
    # trimesh has no public way to ask; its own exporters look here too.
    has_normals = "vertex_normals" in mesh._cache
    normals = mesh.vertex_normals if has_normals else _bgars.vertex_normals(vertices, faces)
    return np.ascontiguousarray(normals, dtype=np.float64)


def _colors(mesh: trimesh.Trimesh) -> np.ndarray[tuple[int, ...], np.dtype[np.uint8]] | None:
    """(N, 3) red, green, blue, or None where the mesh has no vertex colours of its own."""
    if not isinstance(mesh.visual, ColorVisuals) or mesh.visual.kind != "vertex":
        return None
    return np.ascontiguousarray(mesh.visual.vertex_colors[:, :3], dtype=np.uint8)
