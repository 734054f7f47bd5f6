"""Normals and points for other programs, and images of shape."""

from __future__ import annotations

import re
from pathlib import Path

import bgars
import numpy as np
import pytest
import tifffile
import trimesh
from bgars.io.formats import NORMAL_FORMATS, POINT_FORMATS


@pytest.fixture(scope="module")
def field() -> bgars.NormalField:
    return bgars.estimate_normals(bgars.read_capture(bgars.sample_capture()), method="lambertian")


def test_normals_are_read_back_by_others(field: bgars.NormalField, tmp_path: Path) -> None:
    for suffix in NORMAL_FORMATS:
        bgars.write_normals(field, tmp_path / f"n{suffix}")
    for suffix in (".tif", ".tiff"):
        np.testing.assert_array_equal(tifffile.imread(tmp_path / f"n{suffix}"), field.normals)
    np.testing.assert_array_equal(np.load(tmp_path / "n.npy"), field.normals)
    with np.load(tmp_path / "n.npz") as stored:
        np.testing.assert_array_equal(stored["normals"], field.normals)
        np.testing.assert_array_equal(stored["mask"], field.mask)
    png = bgars.read_normal_map(tmp_path / "n.png")
    assert bgars.angular_error_deg(png, field.normals)[field.mask].max() < 0.01
    words = ", ".join(NORMAL_FORMATS)
    with pytest.raises(
        bgars.InputError, match=rf"n\.bmp: a file of normals must end in {re.escape(words)}; got '\.bmp'"
    ):
        bgars.write_normals(field, tmp_path / "n.bmp")
    with pytest.raises(bgars.InputError, match=r"must have shape \(H, W, 3\)"):
        bgars.write_normals(field.albedo, tmp_path / "n.tif")
    assert len(list(tmp_path.iterdir())) == len(NORMAL_FORMATS)


def test_normals_as_exr_have_alpha_where_there_is_one(field: bgars.NormalField, tmp_path: Path) -> None:
    openexr = pytest.importorskip("OpenEXR")
    normals = field.normals.copy()
    normals[:20, :30] = np.nan
    valid = np.isfinite(normals[..., 0])
    bgars.write_normals(normals, tmp_path / "n.exr")
    with openexr.File(str(tmp_path / "n.exr"), separate_channels=True) as file:
        channels = {name: channel.pixels for name, channel in file.channels().items()}
    assert set(channels) == set("RGBA")
    assert channels["R"].dtype == np.float32
    np.testing.assert_array_equal(channels["A"], valid)
    stored = np.stack([channels[name] for name in "RGB"], axis=-1)
    np.testing.assert_array_equal(stored, np.where(valid[..., None], normals, 0.0))
    again = bgars.read_normal_map(tmp_path / "n.exr")
    np.testing.assert_array_equal(np.isfinite(again[..., 0]), valid)
    assert bgars.angular_error_deg(again, normals)[valid].max() < 0.05


@pytest.mark.parametrize("suffix", [".png", ".tif", ".exr", ".npz"])
def test_what_is_no_normal_is_none_in_a_file(suffix: str, tmp_path: Path) -> None:
    normals = np.ma.masked_array(np.tile([0.6, 0.0, 0.8], (4, 4, 1)), mask=False)
    normals[0] = np.ma.masked
    normals[1] = 0.0
    normals[2, :, 1] = np.nan
    bgars.write_normals(normals, tmp_path / f"n{suffix}")
    back = bgars.read_normal_map(tmp_path / f"n{suffix}")
    assert np.isnan(back[:3]).all()
    np.testing.assert_allclose(back[3], normals[3], atol=1e-4)
    for wrong, words in ((3.0 * normals, "row 3, column 0: must have length 1 within 0.1, got 3"), (normals[:0], "0")):
        with pytest.raises(bgars.InputError, match=words):
            bgars.write_normals(wrong, tmp_path / f"wrong{suffix}")
    with pytest.raises(bgars.InputError, match="normals: must be an array of numbers"):
        bgars.write_normals("abc", tmp_path / f"wrong{suffix}")
    assert [path.name for path in tmp_path.iterdir()] == [f"n{suffix}"]


def test_points_lie_where_the_vertices_of_the_mesh_lie(field: bgars.NormalField, tmp_path: Path) -> None:
    height = bgars.integrate_normals(field)
    expected = bgars.mesh_from_height(height, field).vertices
    for suffix in POINT_FORMATS:
        bgars.write_points(height, tmp_path / f"p{suffix}", field=field)
    text = np.loadtxt(tmp_path / "p.xyz")
    np.testing.assert_allclose(text[:, :3], expected, atol=1e-4)
    np.testing.assert_allclose(text[:, 3:], field.normals[height.mask], atol=1e-5)
    cloud = trimesh.load(tmp_path / "p.ply")
    np.testing.assert_allclose(cloud.vertices, expected, rtol=1e-6, atol=1e-4)
    assert len(np.unique(cloud.colors[:, 0])) > 10
    with pytest.raises(bgars.InputError, match=r"must end in \.xyz, \.ply"):
        bgars.write_points(height, tmp_path / "p.las")


@pytest.mark.parametrize("scale_px", [2.0, 6.0])
@pytest.mark.parametrize("is_disc", [False, True])
def test_edges_of_the_surface_are_no_dents(scale_px: float, is_disc: bool) -> None:
    row, col = np.mgrid[-40:40, -50:50]
    inside = np.hypot(row, col) < 35 if is_disc else np.ones(row.shape, bool)
    plane = bgars.HeightMap.from_array(np.where(inside, 3.0 * col - 2.0 * row, np.nan), pixel_pitch_um=10.0)
    shape = bgars.shape_images(plane, scale_px=scale_px)
    seen = np.isfinite(shape.slope_deg)
    assert seen.sum() > 0.9 * inside.sum()
    np.testing.assert_allclose(shape.slope_deg[seen], np.degrees(np.arctan(np.hypot(0.3, 0.2))), atol=1e-3)
    assert np.nanmax(np.abs(shape.flattened)) < 1e-3
    assert np.nanmax(np.abs(shape.mean_curvature)) < 1e-6
    ball = bgars.HeightMap.from_array(np.where(inside, np.sqrt(200.0**2 - row**2 - col**2), np.nan))
    found = bgars.shape_images(ball, scale_px=scale_px).mean_curvature * 200.0
    assert -1.8 < np.nanmin(found) < np.nanmax(found) < -0.2
    assert found[40, 50] == pytest.approx(-1.0, abs=1e-2)


def test_shape_of_a_ball_with_a_scratch() -> None:
    row, col = np.mgrid[-30:31, -30:31]
    heights = np.sqrt(80.0**2 - row**2 - col**2).astype(np.float32) * 5.0
    heights[:, 33] -= 2.0
    heights[0, 0] = np.nan
    shape = bgars.shape_images(bgars.HeightMap.from_array(heights, pixel_pitch_um=5.0), scale_px=3.0)
    assert shape.unit == "um"
    assert shape.mean_curvature[30, 15] == pytest.approx(-1 / 400, rel=0.05)
    assert shape.gaussian_curvature[30, 15] == pytest.approx(1 / 400**2, rel=0.1)
    assert shape.flattened[30, 33] < -1.0
    assert abs(shape.flattened[30, 15]) < 0.7, "what smoothing takes off a ball"
    assert np.isnan(shape.slope_deg[0, 0])
    with pytest.raises(bgars.InputError, match="scale_px: must be finite and above 0, got 0"):
        bgars.shape_images(bgars.HeightMap.from_array(heights), scale_px=0)
