"""Look at the surface of a capture in PyVista, coloured by height; or write a picture of it.

pip install 'bgars' pyvista
python examples/pyvista_surface.py [CAPTURE [PICTURE.png]]
"""

from __future__ import annotations

import sys

import bgars
import pyvista as pv


def surface(folder: str) -> pv.PolyData:
    """The surface with the arrays height, confidence and albedo at its vertices."""
    capture = bgars.read_capture(folder)
    field = bgars.estimate_normals(capture)
    height = bgars.integrate_normals(field)
    mesh = bgars.mesh_from_height(height, field)
    cloth = pv.PolyData.from_regular_faces(mesh.vertices, mesh.faces)
    cloth.point_data.active_normals = mesh.vertex_normals
    cloth[f"height, {height.unit}"] = mesh.vertices[:, 2]
    # A vertex is a valid pixel, in reading order.
    cloth["confidence"] = field.confidence[height.mask]
    cloth["albedo"] = field.albedo[height.mask]
    cloth.set_active_scalars(f"height, {height.unit}")
    return cloth


def show(cloth: pv.PolyData, picture: str | None = None) -> None:
    """Open a window; or, with a name, write a picture."""
    plotter = pv.Plotter(off_screen=picture is not None)
    plotter.add_mesh(cloth, cmap="viridis", smooth_shading=True)
    plotter.add_axes()
    plotter.camera_position = "xy"
    plotter.camera.elevation = -40.0
    plotter.show(screenshot=picture)


if __name__ == "__main__":
    folder, *pictures = sys.argv[1:] or [str(bgars.sample_capture())]
    show(surface(folder), *pictures)
