"""Meshes as binary PLY files."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray


class Mesh(NamedTuple):
    """Points (n, 3), normals (n, 3), texture coordinates (n, 2), faces (m, 3)."""

    points_mm: NDArray[np.float64]
    normals: NDArray[np.float64]
    places: NDArray[np.float64]
    faces: NDArray[np.int64]


def write_ply(mesh: Mesh, path: Path) -> None:
    """Write a mesh, little-endian, in single precision."""
    vertices = np.hstack([mesh.points_mm, mesh.normals, mesh.places]).astype("<f4")
    faces = np.zeros(len(mesh.faces), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, mesh.faces
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"element vertex {len(vertices)}",
        *(f"property float {name}" for name in ("x", "y", "z", "nx", "ny", "nz", "u", "v")),
        f"element face {len(faces)}",
        "property list uchar int vertex_indices",
        "end_header\n",
    ]
    path.write_bytes("\n".join(header).encode() + vertices.tobytes() + faces.tobytes())
