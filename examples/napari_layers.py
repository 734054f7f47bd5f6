"""Look at a capture in napari: photographs, normals, confidence and heights as layers in micrometres.

pip install 'bgars' 'napari[all]'
python examples/napari_layers.py [CAPTURE]

`napari_get_reader` is what a napari plugin names as its reader: then a capture folder can be dropped into the window.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bgars
import numpy as np

Layer = tuple[np.ndarray, dict[str, Any], str]


def napari_get_reader(path: str | list[str]) -> Callable[[str], list[Layer]] | None:
    """The reader of a path, or None where it is no capture of ours to read."""
    if not isinstance(path, str) or not Path(path).is_dir():
        return None
    try:
        bgars.read_capture(path)
    except bgars.BgarsError:
        return None
    return read_layers


def read_layers(path: str) -> list[Layer]:
    """Layers as napari takes them: data, how to show them, kind; the axes are row and column."""
    capture = bgars.read_capture(path)
    field = bgars.estimate_normals(capture)
    height = bgars.integrate_normals(field)
    pitch = height.pixel_pitch_um or 1.0
    flat = {"scale": (pitch, pitch)}
    colors = np.where(field.mask[..., np.newaxis], (field.normals + 1.0) / 2.0, 0.0)
    return [
        (capture.images, {"name": "photographs", "scale": (1.0, pitch, pitch)}, "image"),
        (field.confidence, {"name": "confidence", "contrast_limits": (0.0, 1.0), "visible": False, **flat}, "image"),
        (height.height, {"name": f"height, {height.unit}", "colormap": "viridis", **flat}, "image"),
        (colors, {"name": "normals", "rgb": True, **flat}, "image"),
    ]


if __name__ == "__main__":
    import napari

    viewer = napari.Viewer()
    for layer in read_layers(sys.argv[1] if len(sys.argv) > 1 else str(bgars.sample_capture())):
        viewer.add_layer(napari.layers.Layer.create(*layer))
    napari.run()
