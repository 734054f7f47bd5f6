"""Log a capture and its surface to Rerun: photographs on a timeline of lights, normals, heights, mesh.

pip install 'bgars' rerun-sdk
python examples/rerun_log.py [CAPTURE [FILE.rrd]]        then: rerun FILE.rrd; without a file the viewer opens
"""

from __future__ import annotations

import sys

import bgars
import numpy as np
import rerun as rr


def log(folder: str) -> None:
    """Log to the recording that is open."""
    capture = bgars.read_capture(folder)
    field = bgars.estimate_normals(capture)
    height = bgars.integrate_normals(field)
    mesh = bgars.mesh_from_height(height, field)
    top = np.float32(capture.full_scale)
    for light, image in enumerate(capture.images):
        rr.set_time("light", sequence=light)
        rr.log("photograph", rr.Image(np.uint8(np.clip(image / top, 0.0, 1.0) * 255.0)))
    colors = np.where(field.mask[..., np.newaxis], (field.normals + 1.0) / 2.0, 0.0)
    rr.log("normals", rr.Image(np.uint8(colors * 255.0)), static=True)
    rr.log("height", rr.Tensor(height.height, dim_names=("row", "column")), static=True)
    rr.log("surface", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    rr.log(
        "surface",
        rr.Mesh3D(
            vertex_positions=mesh.vertices,
            triangle_indices=mesh.faces,
            vertex_normals=mesh.vertex_normals,
            vertex_colors=mesh.visual.vertex_colors,
        ),
        static=True,
    )


if __name__ == "__main__":
    folder, *files = sys.argv[1:] or [str(bgars.sample_capture())]
    rr.init("bgars", spawn=not files)
    if files:
        rr.save(files[0])
    log(folder)
