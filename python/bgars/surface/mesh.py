"""Height maps as triangle meshes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bgars import _bgars
from bgars.errors import InputError
from bgars.records.height_map import need_height
from bgars.records.scalar_checks import thread_count

if TYPE_CHECKING:
    import trimesh

    from bgars.records.height_map import HeightMap
    from bgars.records.normal_field import NormalField

__all__ = ["check_faces", "mesh_from_height", "mesh_size"]


def mesh_from_height(
    height: HeightMap, field: NormalField | None = None, *, threads: int | None = None
) -> trimesh.Trimesh:
    """Triangulate a height map: a vertex per pixel, faces between neighbours; masked pixels are left out.

    Parameters
    ----------
    height : HeightMap
        Heights; vertices are in micrometres when its pixel pitch is known, else in pixels.
    field : NormalField, optional
        Gives each vertex its estimated normal and its albedo as grey; without it, normals follow from the faces
        (weighted by their angles at the vertex, as trimesh does).
    threads : int, optional
        Largest number of threads; by default ``RAYON_NUM_THREADS``, else one per core.

    Returns
    -------
    trimesh.Trimesh
        x right, y up, z toward the camera, origin at the image centre; ``metadata["unit"]`` is "um" or "px".

    Raises
    ------
    InputError
        The field has another size than the height map, or no two neighbouring pixels are valid.

    Examples
    --------
    >>> import bgars, numpy as np
    >>> flat = bgars.integrate_normals(np.tile(np.float32([0, 0, 1]), (2, 2, 1)), pixel_pitch_um=10.0)
    >>> mesh = bgars.mesh_from_height(flat)
    >>> mesh.vertices[0].tolist(), len(mesh.faces), mesh.metadata["unit"]
    ([-5.0, 5.0, 0.0], 2, 'um')
    """
    import trimesh  # noqa: PLC0415 - half a second, only for those who want its record

    threads = thread_count(threads)
    need_height(height, field)
    pitch = 1.0 if height.pixel_pitch_um is None else height.pixel_pitch_um
    vertices, faces, pixels = _bgars.triangulate(height.height_px, height.mask, pitch, threads=threads)
    check_faces(len(vertices), len(faces))
    metadata = {"unit": height.unit, "components": len(height.components)}
    if field is None:
        # In the types that trimesh keeps, so that it does not convert them once more.
        wide_vertices, wide_faces = vertices.astype(np.float64), faces.astype(np.int64)
        normals = _bgars.vertex_normals(wide_vertices, wide_faces, threads=threads)
        return trimesh.Trimesh(wide_vertices, wide_faces, vertex_normals=normals, process=False, metadata=metadata)
    normals = field.normals.reshape(-1, 3)[pixels]
    colors = np.full((len(pixels), 4), 255, np.uint8)
    colors[:, :3] = field.grey_levels().ravel()[pixels, np.newaxis]
    return trimesh.Trimesh(
        vertices, faces, vertex_normals=normals, vertex_colors=colors, process=False, metadata=metadata
    )


def mesh_size(height: HeightMap) -> tuple[int, int]:
    """How many vertices and faces the mesh of a height map has, without making it.

    Examples
    --------
    >>> import bgars, numpy as np
    >>> mesh_size(bgars.HeightMap.from_array(np.zeros((2, 3), np.float32)))
    (6, 4)
    """
    mask = height.mask.view(np.uint8)
    corners = mask[:-1, :-1] + mask[:-1, 1:] + mask[1:, :-1] + mask[1:, 1:]
    of_corners = np.bincount(corners.ravel(), minlength=5)
    return int(np.count_nonzero(mask)), int(of_corners[3] + 2 * of_corners[4])


def check_faces(vertices: int, faces: int) -> None:
    """Raise InputError where a mesh has no face."""
    if faces == 0:
        msg = f"height: no three neighbouring pixels are valid ({vertices} in all), so there is no face to make"
        raise InputError(msg)
