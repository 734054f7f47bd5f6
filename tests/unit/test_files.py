"""Normal maps, height maps and meshes survive a round trip."""

from __future__ import annotations

from pathlib import Path

import bgars
import numpy as np
import pytest
import tifffile
import trimesh


@pytest.fixture
def field() -> bgars.NormalField:
    rig = bgars.LightRig.ring(6)
    row, col = np.mgrid[:8, :9]
    normals = np.stack([(col - 4) / 12, (4 - row) / 12, np.ones_like(row)], axis=2).astype(np.float64)
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    images = np.rint(60_000 * np.einsum("ld,hwd->lhw", rig.directions, normals)).astype(np.uint16)
    mask = np.ones((8, 9), bool)
    mask[2, 3] = False
    return bgars.estimate_normals(images, rig.directions, mask=mask)


@pytest.mark.parametrize("directx", [False, True])
def test_normal_map(field: bgars.NormalField, tmp_path: Path, directx: bool) -> None:
    path = tmp_path / "normals.png"
    bgars.write_normal_map(field, path, directx=directx)
    back = bgars.read_normal_map(path, directx=directx)
    np.testing.assert_array_equal(np.isfinite(back).all(axis=2), field.mask)
    assert bgars.angular_error_deg(back[field.mask], field.normals[field.mask]).max() < 0.003
    other = bgars.read_normal_map(path, directx=not directx)
    np.testing.assert_allclose(other[..., 1], -back[..., 1])


@pytest.mark.parametrize("suffix", [".tif", ".npy"])
def test_height_map(field: bgars.NormalField, tmp_path: Path, suffix: str) -> None:
    height = bgars.integrate_normals(field, pixel_pitch_um=5.0)
    path = tmp_path / f"height{suffix}"
    bgars.write_height(height, path)
    values, pitch_um = bgars.read_height(path)
    np.testing.assert_array_equal(values, height.height_um)
    assert pitch_um == (5.0 if suffix == ".tif" else None)
    again = bgars.HeightMap.from_array(values, pixel_pitch_um=5.0)
    np.testing.assert_allclose(again.height_px, height.height_px, rtol=1e-6)


def test_a_height_file_that_is_none(tmp_path: Path) -> None:
    for name in ("a.tif", "a.npy"):
        path = tmp_path / name
        with pytest.raises(bgars.FileFormatError, match=name):
            bgars.read_height(path)
        path.write_bytes(b"nonsense")
        with pytest.raises(bgars.FileFormatError, match=name):
            bgars.read_height(path)
    tifffile.imwrite(tmp_path / "rgb.tif", np.zeros((4, 4, 3), np.uint8))
    with pytest.raises(bgars.FileFormatError, match=r"rgb\.tif.*\(4, 4, 3\)"):
        bgars.read_height(tmp_path / "rgb.tif")


@pytest.mark.parametrize("suffix", [".ply", ".obj", ".stl", ".glb"])
@pytest.mark.parametrize("with_field", [True, False])
def test_mesh(field: bgars.NormalField, tmp_path: Path, suffix: str, with_field: bool) -> None:
    height = bgars.integrate_normals(field, pixel_pitch_um=10.0)
    mesh = bgars.mesh_from_height(height, field if with_field else None)
    assert mesh.metadata["unit"] == "um"
    path = tmp_path / f"part{suffix}"
    bgars.write_mesh(mesh, path)
    back = trimesh.load_mesh(path, process=False)
    assert len(back.faces) == len(mesh.faces) == 2 * 7 * 8 - 8 + 4
    np.testing.assert_allclose(back.bounds, mesh.bounds, rtol=1e-5, atol=1e-4)
    assert np.ptp(back.vertices[:, 0]) == pytest.approx(80.0), "x in um"
    assert (back.face_normals[:, 2] > 0).all(), "faces look at the camera"
    if suffix in {".ply", ".obj"}:
        np.testing.assert_allclose(back.vertices, mesh.vertices, rtol=1e-6, atol=1e-5)
        np.testing.assert_allclose(stored_normals(path), mesh.vertex_normals, atol=1e-5)
        assert b"unit um" in path.read_bytes()[:200]
        if with_field:
            np.testing.assert_allclose(back.visual.vertex_colors[:, :3], mesh.visual.vertex_colors[:, :3], atol=1)


def test_normals_of_a_height_map_are_those_of_its_faces(tmp_path: Path) -> None:
    row, col = np.mgrid[:40, :50].astype(np.float32)
    values = 3 * np.sin(row / 5) * np.cos(col / 7)
    values[10:14, 20:30] = np.nan
    values[0:2, 1:3] = np.nan  # leaves a corner pixel without a face
    mesh = bgars.mesh_from_height(bgars.HeightMap.from_array(values))
    plain = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    np.testing.assert_allclose(mesh.vertex_normals, plain.vertex_normals, atol=1e-6)
    # A mesh from elsewhere, whose normals nobody has asked for.
    other = trimesh.creation.icosphere(subdivisions=3)
    bgars.write_mesh(other, tmp_path / "sphere.ply")
    np.testing.assert_allclose(stored_normals(tmp_path / "sphere.ply"), other.vertex_normals, atol=1e-5)


@pytest.mark.parametrize("suffix", [".ply", ".obj"])
def test_a_mesh_of_many_blocks(tmp_path: Path, suffix: str) -> None:
    values = np.random.default_rng(3).normal(size=(181, 183)).astype(np.float32) * 1e-3
    values[50:60, 70:90] = np.nan
    mesh = bgars.mesh_from_height(bgars.HeightMap.from_array(values, pixel_pitch_um=3.4))
    path = tmp_path / f"part{suffix}"
    bgars.write_mesh(mesh, path)
    back = trimesh.load_mesh(path, process=False)
    np.testing.assert_array_equal(back.faces, mesh.faces)
    np.testing.assert_allclose(back.vertices, mesh.vertices, rtol=1e-6)


@pytest.mark.parametrize("suffix", [".ply", ".obj"])
def test_a_height_map_is_written_as_its_mesh_would_be(tmp_path: Path, suffix: str) -> None:
    rng = np.random.default_rng(4)
    values = rng.normal(size=(191, 163)).astype(np.float32)
    values[rng.random(values.shape) < 0.2] = np.nan
    height = bgars.HeightMap.from_array(values, pixel_pitch_um=3.4)
    images = rng.integers(20, 200, (4, *values.shape)).astype(np.uint8)
    field = bgars.estimate_normals(images, bgars.LightRig.ring(4).directions, method="lambertian")
    bgars.write_mesh(bgars.mesh_from_height(height, field), tmp_path / f"mesh{suffix}")
    bgars.write_mesh(height, tmp_path / f"height{suffix}", field=field, threads=1)
    assert (tmp_path / f"mesh{suffix}").read_bytes() == (tmp_path / f"height{suffix}").read_bytes()


def test_a_height_map_without_a_field_is_written_without_normals(tmp_path: Path) -> None:
    values = np.random.default_rng(4).normal(size=(30, 40)).astype(np.float32)
    values[5:9, 7:30] = np.nan
    height = bgars.HeightMap.from_array(values)
    bgars.write_mesh(height, tmp_path / "bare.ply")
    bare, mesh = trimesh.load_mesh(tmp_path / "bare.ply", process=False), bgars.mesh_from_height(height)
    np.testing.assert_array_equal(bare.faces, mesh.faces)
    np.testing.assert_allclose(bare.vertices, mesh.vertices, rtol=1e-6)
    assert b"nx" not in (tmp_path / "bare.ply").read_bytes()[:300]


def test_a_height_map_that_cannot_be_written_says_why(tmp_path: Path) -> None:
    height = bgars.HeightMap.from_array(np.zeros((3, 3), np.float32))
    field = bgars.estimate_normals(np.full((3, 2, 2), 9, np.uint8), bgars.LightRig.ring(3).directions)
    lone = bgars.HeightMap.from_array(np.float32([[0.0, np.nan], [np.nan, 0.0]]))
    for call, message in [
        (lambda: bgars.write_mesh(height, tmp_path / "a.stl"), r"a\.stl: a height map is written as \.ply or \.obj"),
        (lambda: bgars.write_mesh(height, tmp_path / "a.ply", field=field), r"field: must have the shape .*\(3, 3\)"),
        (lambda: bgars.write_mesh(lone, tmp_path / "a.ply"), "no three neighbouring pixels"),
        (lambda: bgars.write_mesh(bgars.mesh_from_height(height), tmp_path / "a.ply", field=field), "field: goes with"),
        (lambda: bgars.write_mesh(height, tmp_path / "a.ply", threads=0), "threads: must be 1 to"),
    ]:
        with pytest.raises(bgars.InputError, match=message):
            call()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("faces", [[[0, 1, 3]], [[0, 1, -1]]])
def test_a_face_of_no_vertex_is_refused(tmp_path: Path, faces: list[list[int]]) -> None:
    mesh = trimesh.Trimesh(np.eye(3), faces, process=False)
    with pytest.raises(bgars.InputError, match="faces"):
        bgars.write_mesh(mesh, tmp_path / "part.ply")
    assert list(tmp_path.iterdir()) == []


def stored_normals(path: Path) -> np.ndarray:
    """Vertex normals as the file holds them: trimesh computes its own when it loads."""
    if path.suffix == ".obj":
        lines = path.read_text(encoding="utf-8").splitlines()
        return np.array([line.split()[1:] for line in lines if line.startswith("vn ")], dtype=np.float64)
    vertices = trimesh.load_mesh(path, process=False).metadata["_ply_raw"]["vertex"]["data"]
    return np.column_stack([vertices[name] for name in ("nx", "ny", "nz")])


TIFF_KINDS: list[dict[str, object]] = [
    {},
    {"rowsperstrip": 7},
    {"byteorder": ">"},
    {"compression": "zlib", "predictor": 2},
    {"tile": (16, 32)},
    {"photometric": "miniswhite"},
]


@pytest.mark.parametrize("kind", TIFF_KINDS, ids=str)
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_grey_tiff_of_every_kind(tmp_path: Path, kind: dict[str, object], dtype: type[np.unsignedinteger]) -> None:
    top = np.iinfo(dtype).max
    images = np.random.default_rng(1).integers(0, top, (4, 50, 61), dtype=dtype, endpoint=True)
    for index, image in enumerate(images):
        stored = top - image if "photometric" in kind else image
        tifffile.imwrite(tmp_path / f"light_{index}.tif", stored, **kind)
    np.savetxt(tmp_path / "light_directions.txt", bgars.LightRig.ring(4).directions)
    capture = bgars.read_capture(tmp_path)
    assert capture.images.dtype == dtype
    np.testing.assert_array_equal(capture.images, images)
    cut = tmp_path / "light_2.tif"
    cut.write_bytes(cut.read_bytes()[: cut.stat().st_size // 2])
    with pytest.raises(bgars.FileFormatError, match=r"light_2\.tif"):
        bgars.read_capture(tmp_path)


def test_mesh_vertices_sit_where_the_conventions_say() -> None:
    height = bgars.HeightMap.from_array(np.zeros((2, 4), np.float32))
    vertices = bgars.mesh_from_height(height).vertices
    np.testing.assert_array_equal(vertices[0], [-1.5, 0.5, 0.0])
    np.testing.assert_array_equal(vertices[-1], [1.5, -0.5, 0.0])


def test_a_height_map_without_a_face_is_refused() -> None:
    values = np.full((3, 3), np.nan, np.float32)
    values[0, 0] = values[2, 2] = 1.0
    with pytest.raises(bgars.InputError, match="no three neighbouring pixels"):
        bgars.mesh_from_height(bgars.HeightMap.from_array(values))
