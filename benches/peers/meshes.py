"""A height map to PLY and OBJ files: bgars against a plain write of the same bytes and trimesh's exporter.

python benches/peers/meshes.py 1000
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import bgars
import numpy as np
from light_stack import make_stack
from process import own_threads
from rows import emit_check, emit_ratio, has
from timing import alternate

if TYPE_CHECKING:
    from collections.abc import Callable

GROUP = "write"
PLY_LIMIT, OBJ_LIMIT = 1.3, 15.0


def make_height(side: int) -> tuple[bgars.HeightMap, bgars.NormalField]:
    """Heights without a pattern that a writer could profit from, and a field with normals and albedo of every pixel."""
    stack = make_stack(side, side)
    field = bgars.estimate_normals(stack.images, stack.directions, method="robust-filter")
    rows, cols = np.mgrid[0:side, 0:side].astype(np.float32)
    heights = 20.0 * np.sin(cols / 37.0) * np.cos(rows / 53.0) + np.random.default_rng(5).normal(0.0, 0.1, rows.shape)
    return bgars.HeightMap.from_array(heights.astype(np.float32)), field


def plain_write(target: Path, data: bytes) -> Callable[[], object]:
    """The same bytes in one call."""
    return lambda: target.write_bytes(data)


def main(side: int) -> None:
    """Write a prepared mesh, and a height map without one."""
    height, field = make_height(side)
    mesh = bgars.mesh_from_height(height, field)
    size, threads = f"{side * side / 1e6:.3g} MP, {len(mesh.faces) / 1e6:.2g} M faces", own_threads()
    trimesh_there = has(GROUP, "trimesh OBJ", "trimesh")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for suffix in (".ply", ".obj"):
            ours = folder / f"bgars{suffix}"

            def write_mesh(path: Path = ours) -> None:
                bgars.write_mesh(mesh, path)

            def write_height(path: Path = ours) -> None:
                bgars.write_mesh(height, path, field=field)

            write_mesh()
            data = ours.read_bytes()
            emit_check(GROUP, f"file size, {suffix[1:].upper()}", size, threads, len(data) / 1e6, "MB")
            kind = suffix[1:].upper()
            plain, peer = plain_write(folder / f"plain{suffix}", data), f"plain write of the same {kind} bytes"
            limit = PLY_LIMIT if suffix == ".ply" else None
            emit_ratio(GROUP, f"mesh -> {kind}", size, threads, peer, alternate(write_mesh, plain), "at most", limit)
            timed = alternate(write_height, plain)
            emit_ratio(GROUP, f"height map -> {kind}", size, threads, peer, timed, "at most", limit)
            if suffix == ".obj" and trimesh_there:
                theirs = folder / "trimesh.obj"
                peer = "trimesh export of the mesh"
                export = lambda: mesh.export(theirs, file_type="obj", include_normals=True)  # noqa: B023, E731
                timed = alternate(write_mesh, export)
                emit_ratio(GROUP, f"mesh -> {kind}", size, threads, peer, timed, limit=OBJ_LIMIT)
                timed = alternate(write_height, export)
                emit_ratio(GROUP, f"height map -> {kind}", size, threads, peer, timed, limit=OBJ_LIMIT)


if __name__ == "__main__":
    main(int(sys.argv[1]))
