"""A mesh of fewer triangles is as near to the heights as it says, measured here the slow plain way."""

from __future__ import annotations

import bgars
import numpy as np
import pytest
from bgars import _bgars
from bgars.surface import simplify
from bgars.surface.simplify import height_errors_px

PITCH_UM = 5.0


def ball_on_a_board(rng: np.random.Generator) -> bgars.HeightMap:
    """A ball that stands out of a board with noise, a hole in the mask and a stray pixel."""
    row, col = np.mgrid[:90, :120]
    heights = np.sqrt(np.maximum(35.0**2 - (row - 45) ** 2 - (col - 60) ** 2, 0.0)) + rng.normal(0, 0.02, row.shape)
    heights[(row - 20) ** 2 + (col - 15) ** 2 < 60] = np.nan
    heights[80:83, 100:103] = np.nan
    heights[81, 101] = 1.0
    return bgars.HeightMap.from_array(heights * PITCH_UM, pixel_pitch_um=PITCH_UM)


def by_triangles(mesh: object, height: bgars.HeightMap) -> np.ndarray:
    """Heights of the mesh at every pixel, by barycentric coordinates, a triangle at a time."""
    rows, cols = height.mask.shape
    found = np.full((rows, cols), np.nan)
    vertices = mesh.vertices / PITCH_UM  # type: ignore[attr-defined]
    for face in mesh.faces:  # type: ignore[attr-defined]
        corner = vertices[face]
        row, col = rows / 2 - 0.5 - corner[:, 1], corner[:, 0] + cols / 2 - 0.5
        system = np.stack([row, col, np.ones(3)])
        if abs(np.linalg.det(system)) < 1e-9:
            continue
        grid = np.mgrid[
            int(np.ceil(row.min() - 1e-9)) : int(row.max() + 1e-9) + 1,
            int(np.ceil(col.min() - 1e-9)) : int(col.max() + 1e-9) + 1,
        ]
        points = np.stack([*(axis.ravel() for axis in grid), np.ones(grid[0].size)])
        weights = np.linalg.solve(system, points)
        inside = (weights > -1e-7).all(axis=0)
        at = points[:2, inside].astype(int)
        found[at[0], at[1]] = corner[:, 2] @ weights[:, inside]
    return found * PITCH_UM


@pytest.mark.parametrize("bound_um", [0.6, 3.0, 20.0])
def test_the_bound_holds_at_every_pixel(bound_um: float) -> None:
    pytest.importorskip("fast_simplification")
    height = ball_on_a_board(np.random.default_rng(1))
    full = bgars.mesh_from_height(height)
    result = bgars.simplified_mesh(height, max_error_um=bound_um)
    assert result.full_faces == len(full.faces)
    assert result.max_error_um <= bound_um
    assert len(result.mesh.faces) < len(full.faces)
    heights = by_triangles(result.mesh, height)
    expected = np.where(height.mask, height.height, np.nan)
    expected[81, 101] = np.nan  # of no face
    np.testing.assert_array_equal(np.isfinite(heights), np.isfinite(expected))
    assert np.nanmax(np.abs(heights - expected)) == pytest.approx(result.max_error_um, rel=0.01, abs=1e-3)


def test_a_looser_bound_takes_fewer_triangles_and_a_plane_hardly_any() -> None:
    pytest.importorskip("fast_simplification")
    height = ball_on_a_board(np.random.default_rng(2))
    faces = [len(bgars.simplified_mesh(height, max_error_um=bound).mesh.faces) for bound in (1.0, 5.0, 25.0)]
    assert faces == sorted(faces, reverse=True)
    assert faces[2] < faces[0] / 1.5
    fractions: list[float] = []
    slope = np.add.outer(np.arange(50.0), np.arange(60.0)) + np.random.default_rng(2).normal(0, 1e-3, (50, 60))
    plane = bgars.HeightMap.from_array(slope, pixel_pitch_um=1.0)
    result = bgars.simplified_mesh(plane, max_error_um=0.1, progress=fractions.append)
    assert len(result.mesh.faces) < 4 * (50 + 60)  # little more than the outline
    assert fractions[-1] == 1.0


def test_a_mesh_that_misses_or_leaves_the_surface_has_no_bound() -> None:
    height = ball_on_a_board(np.random.default_rng(3))
    vertices, faces, pixels = _bgars.triangulate(height.height_px, height.mask, 1.0, threads=1)
    expected = np.full(height.mask.size, np.nan)
    expected[pixels[faces.ravel()]] = height.height_px.ravel()[pixels[faces.ravel()]]
    expected = expected.reshape(height.mask.shape)
    assert height_errors_px(vertices, faces, expected).max() < 1e-6
    assert np.isinf(height_errors_px(vertices, faces[:-400], expected)).any()
    hole = expected.copy()
    hole[50, 60] = np.nan
    assert np.isinf(height_errors_px(vertices, faces, hole)[50, 60])
    moved = vertices.copy()
    index = np.flatnonzero(pixels == 50 * height.mask.shape[1] + 60)[0]
    moved[index, 2] += 3.0
    errors = height_errors_px(moved, faces, expected)
    assert errors[50, 60] == pytest.approx(3.0, abs=1e-5)
    assert np.count_nonzero(errors > 1e-5) == 1


def test_pieces_do_not_change_the_result(monkeypatch: pytest.MonkeyPatch) -> None:
    height = ball_on_a_board(np.random.default_rng(4))
    vertices, faces, _ = _bgars.triangulate(height.height_px, height.mask, 1.0, threads=1)
    expected = np.zeros(height.mask.shape)
    whole = height_errors_px(vertices, faces, expected)
    monkeypatch.setattr(simplify, "PIXELS_AT_ONCE", 500)
    np.testing.assert_array_equal(height_errors_px(vertices, faces, expected), whole)


def test_what_cannot_be_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    height = bgars.HeightMap.from_array(np.zeros((3, 3), np.float32), pixel_pitch_um=1.0)
    for bound in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(bgars.InputError, match="max_error_um: must be finite and above 0"):
            bgars.simplified_mesh(height, max_error_um=bound)
    with pytest.raises(bgars.InputError, match="needs a pixel pitch"):
        bgars.simplified_mesh(bgars.HeightMap.from_array(np.zeros((3, 3), np.float32)), max_error_um=1.0)
    monkeypatch.setattr(simplify, "missing", lambda *names: names)
    with pytest.raises(bgars.InputError, match=r"needs fast_simplification: pip install 'bgars\[simplify\]'"):
        bgars.simplified_mesh(height, max_error_um=1.0)
