"""The examples for other viewers run, each where its viewer is installed; none is needed by bgars or its tests."""

from __future__ import annotations

import runpy
import subprocess
import sys
from pathlib import Path

import bgars
import imageio.v3 as iio
import numpy as np
import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"
pytestmark = pytest.mark.filterwarnings("ignore")


def test_the_napari_reader_gives_layers_in_micrometres(tmp_path: Path) -> None:
    example = runpy.run_path(str(EXAMPLES / "napari_layers.py"))
    assert example["napari_get_reader"](str(tmp_path)) is None
    assert example["napari_get_reader"](str(EXAMPLES / "quickstart.py")) is None
    layers = example["napari_get_reader"](str(bgars.sample_capture()))(str(bgars.sample_capture()))
    assert [(data.shape, kind) for data, _, kind in layers] == [
        ((8, 240, 256), "image"),
        ((240, 256), "image"),
        ((240, 256), "image"),
        ((240, 256, 3), "image"),
    ]
    for data, how, _ in layers:
        assert how["scale"][-2:] == (3.4, 3.4)
        assert how["name"] != "normals" or (0.0 <= np.nanmin(data) < np.nanmax(data) <= 1.0)


def test_napari_takes_the_layers() -> None:
    napari = pytest.importorskip("napari.layers")
    example = runpy.run_path(str(EXAMPLES / "napari_layers.py"))
    for layer in example["read_layers"](str(bgars.sample_capture())):
        assert napari.Layer.create(*layer).name == layer[1]["name"]


def test_pyvista_shows_the_surface(tmp_path: Path) -> None:
    pytest.importorskip("pyvista")
    example = runpy.run_path(str(EXAMPLES / "pyvista_surface.py"))
    cloth = example["surface"](str(bgars.sample_capture()))
    height = bgars.integrate_normals(bgars.estimate_normals(bgars.read_capture(bgars.sample_capture())))
    assert cloth.n_points == height.mask.sum()
    np.testing.assert_allclose(cloth["height, um"], height.height[height.mask], rtol=1e-5, atol=1e-3)
    example["show"](cloth, str(tmp_path / "surface.png"))
    assert iio.imread(tmp_path / "surface.png").std() > 10


def test_rerun_has_photographs_and_mesh(tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    path = tmp_path / "part.rrd"
    # Of its own process: the file is whole when that ends.
    subprocess.run([sys.executable, EXAMPLES / "rerun_log.py", bgars.sample_capture(), path], check=True)
    assert path.stat().st_size > 1_000_000
