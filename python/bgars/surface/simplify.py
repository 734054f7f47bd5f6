"""Meshes of fewer triangles whose heights stay within a stated distance of the measured ones.

Edges are collapsed by the quadric error of Garland and Heckbert, "Surface simplification using quadric error metrics"
(SIGGRAPH 1997), which bounds no distance. So each result is compared with the heights at every pixel, and the coarsest
that keeps the bound is searched by bisection.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from bgars import _bgars
from bgars.errors import InputError
from bgars.extras import how_to_install, missing
from bgars.records.height_map import need_height
from bgars.records.scalar_checks import check_progress, number, thread_count
from bgars.surface.mesh import check_faces

if TYPE_CHECKING:
    from collections.abc import Callable

    import trimesh
    from numpy.typing import NDArray

    from bgars.records.height_map import HeightMap

__all__ = ["SimplifiedMesh", "height_errors_px", "simplified_mesh"]

PACKAGE = "fast_simplification"
LEAST_KEPT_LOG2 = -12.0
TRIES = 6
ON_LINE_PX = 1e-6
"""Pixels this near to an edge lie on it."""
PIXELS_AT_ONCE = 1 << 21


class SimplifiedMesh(NamedTuple):
    """A mesh of fewer triangles, and how far it is from the heights.

    Attributes
    ----------
    mesh : trimesh.Trimesh
        In micrometres, as of :func:`bgars.mesh_from_height`.
    max_error_um : float
        Largest vertical distance of the mesh from the heights, over all pixels of the mesh; reached, not asked for.
    full_faces : int
        Triangles of the mesh that has a vertex per pixel.
    """

    mesh: trimesh.Trimesh
    max_error_um: float
    full_faces: int


def simplified_mesh(
    height: HeightMap,
    *,
    max_error_um: float,
    threads: int | None = None,
    progress: Callable[[float], object] | None = None,
) -> SimplifiedMesh:
    """Triangulate a height map with as few triangles as a bound on the error of the heights allows.

    The outline, of holes too, stays as it is: a vertex per pixel. Needs ``pip install 'bgars[simplify]'``.

    Parameters
    ----------
    height : HeightMap
        With a pixel pitch.
    max_error_um : float
        Largest vertical distance from the heights at any pixel.
    threads : int, optional
        Largest number of threads; by default ``RAYON_NUM_THREADS``, else one per core.
    progress : callable, optional
        Called with the fraction done.

    Raises
    ------
    InputError
        A bound that is not finite and above 0; no pixel pitch; no face; the package is not installed.

    References
    ----------
    Garland and Heckbert, "Surface simplification using quadric error metrics", SIGGRAPH 1997.

    Examples
    --------
    >>> import bgars, numpy as np
    >>> flat = bgars.HeightMap.from_array(np.zeros((20, 20), np.float32), pixel_pitch_um=5.0)
    >>> result = bgars.simplified_mesh(flat, max_error_um=0.1)
    >>> len(result.mesh.faces) < result.full_faces / 4, result.max_error_um
    (True, 0.0)
    """
    _check(height, max_error_um)
    import fast_simplification  # noqa: PLC0415 - optional
    import trimesh  # noqa: PLC0415 - half a second

    check_progress(progress)
    threads = thread_count(threads)
    pitch_um = height.pixel_pitch_um or 1.0
    vertices, faces, pixels = _bgars.triangulate(height.height_px, height.mask, 1.0, threads=threads)
    check_faces(len(vertices), len(faces))
    vertices, used = vertices.astype(np.float64), np.zeros(height.mask.size, np.bool_)
    used[pixels[faces.ravel()]] = True
    expected = np.where(used.reshape(height.mask.shape), height.height_px.astype(np.float64), np.nan)
    best, best_error_px = (vertices, faces.astype(np.int64)), 0.0
    good_log2, bad_log2 = 0.0, LEAST_KEPT_LOG2
    for tried_before in range(TRIES):
        kept_log2 = (good_log2 + bad_log2) / 2.0
        target = max(1, int(len(faces) * 2.0**kept_log2))
        tried = fast_simplification.simplify(vertices, faces, target_count=target, preserve_border=True)
        error_px = float(height_errors_px(tried[0], tried[1], expected).max())
        if error_px * pitch_um <= max_error_um:
            good_log2 = kept_log2
            if len(tried[1]) < len(best[1]):
                best, best_error_px = tried, error_px
        else:
            bad_log2 = kept_log2
        if progress is not None:
            progress((tried_before + 1) / TRIES)
    wide_vertices, wide_faces = (
        np.ascontiguousarray(best[0], np.float64) * pitch_um,
        np.ascontiguousarray(best[1], np.int64),
    )
    normals = _bgars.vertex_normals(wide_vertices, wide_faces, threads=threads)
    mesh = trimesh.Trimesh(
        wide_vertices, wide_faces, vertex_normals=normals, process=False, metadata={"unit": height.unit}
    )
    return SimplifiedMesh(mesh, best_error_px * pitch_um, len(faces))


def height_errors_px(
    vertices: NDArray[np.floating], faces: NDArray[np.integer], expected_px: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Largest vertical distance of a mesh from heights, pixel by pixel.

    Parameters
    ----------
    vertices : (N, 3) floating
        In pixels, origin at the image centre, y up.
    faces : (M, 3) integer
    expected_px : (H, W) float64
        NaN where there is no surface.

    Returns
    -------
    (H, W) float64
        Of all triangles over a pixel the largest; infinite where the mesh misses a pixel, or covers one of no height;
        0 where neither has one.

    Examples
    --------
    >>> corners = np.array([[-0.5, 0.5, 0.0], [-0.5, -0.5, 0.0], [0.5, -0.5, 3.0], [0.5, 0.5, 0.0]])
    >>> height_errors_px(corners, np.array([[0, 1, 2], [0, 2, 3]]), np.zeros((2, 2))).tolist()
    [[0.0, 0.0], [0.0, 3.0]]
    """
    rows, cols = expected_px.shape
    row, col = rows / 2 - 0.5 - vertices[:, 1], vertices[:, 0] + cols / 2 - 0.5
    corners = np.stack([row, col, vertices[:, 2]], axis=-1).astype(np.float64)[faces]
    errors = np.where(np.isfinite(expected_px), -1.0, 0.0).ravel()
    heights = np.where(np.isfinite(expected_px), expected_px, math.inf).ravel()
    first = np.ceil(corners[..., 0].min(axis=1) - ON_LINE_PX)
    last = np.floor(corners[..., 0].max(axis=1) + ON_LINE_PX)
    for part in _parts(last - first + 1.0):
        triangle, line = _counted(first[part], last[part])
        for some in _parts(_width(corners[part], triangle, line)):
            _compare(corners[part][triangle[some]], line[some], cols, heights, errors)
    errors[errors < 0.0] = math.inf
    return errors.reshape(rows, cols)


def _compare(
    corners: NDArray[np.float64],
    line: NDArray[np.float64],
    cols: int,
    heights: NDArray[np.float64],
    errors: NDArray[np.float64],
) -> None:
    """Raise the errors of the pixels where lines of the image cut triangles."""
    left, left_z, right, right_z = _cuts(corners, line)
    which, col = _counted(np.ceil(left - ON_LINE_PX), np.floor(right + ON_LINE_PX))
    width = np.maximum((right - left)[which], ON_LINE_PX)
    share = np.clip((col - left[which]) / width, 0.0, 1.0)
    z = left_z[which] + share * (right_z - left_z)[which]
    pixel = (line[which] * cols + col).astype(np.int64)
    np.maximum.at(errors, pixel, np.abs(z - heights[pixel]))


def _width(corners: NDArray[np.float64], triangle: NDArray[np.int64], line: NDArray[np.float64]) -> NDArray[np.float64]:
    left, _, right, _ = _cuts(corners[triangle], line)
    return np.maximum(right - left, 0.0) + 1.0


def _cuts(corners: NDArray[np.float64], line: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
    """Where a line of the image enters and leaves each triangle: column and height of both."""
    left, right = np.full(len(line), math.inf), np.full(len(line), -math.inf)
    left_z, right_z = np.zeros(len(line)), np.zeros(len(line))
    for start, end in ((0, 1), (1, 2), (2, 0)):
        low, high = corners[:, start], corners[:, end]
        rise = high[:, 0] - low[:, 0]
        # Of an edge along the line, the other two edges hold the ends.
        meets = np.abs(rise) > ON_LINE_PX
        share = (line - low[:, 0]) / np.where(meets, rise, 1.0)
        meets &= (share >= -ON_LINE_PX) & (share <= 1.0 + ON_LINE_PX)
        share = np.clip(share, 0.0, 1.0)
        col, z = low[:, 1] + share * (high[:, 1] - low[:, 1]), low[:, 2] + share * (high[:, 2] - low[:, 2])
        further = meets & (col < left)
        left[further], left_z[further] = col[further], z[further]
        further = meets & (col > right)
        right[further], right_z[further] = col[further], z[further]
    return left, left_z, right, right_z


def _counted(first: NDArray[np.float64], last: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """All whole numbers from first to last, and of which pair each is."""
    counts = np.maximum(np.where(np.isfinite(last - first), last - first + 1.0, 0.0), 0.0).astype(np.int64)
    which = np.repeat(np.arange(len(counts)), counts)
    starts = np.cumsum(counts) - counts
    return which, first[which] + (np.arange(len(which)) - starts[which])


def _parts(sizes: NDArray[np.float64]) -> list[slice]:
    """Pieces of a list that hold about as much as memory should."""
    if not len(sizes):
        return []
    number = np.cumsum(np.where(np.isfinite(sizes), sizes, 0.0)) // PIXELS_AT_ONCE
    ends = [*(np.flatnonzero(np.diff(number)) + 1).tolist(), len(sizes)]
    return [slice(start, end) for start, end in zip([0, *ends[:-1]], ends, strict=True)]


def _check(height: HeightMap, max_error_um: float) -> None:
    need_height(height)
    max_error_um = number("max_error_um", max_error_um)
    if not (math.isfinite(max_error_um) and max_error_um > 0):
        msg = f"max_error_um: must be finite and above 0, got {max_error_um:g}"
        raise InputError(msg)
    if height.pixel_pitch_um is None:
        msg = "max_error_um: needs a pixel pitch (pixel_pitch_um); these heights are in pixels"
        raise InputError(msg)
    if missing(PACKAGE):
        msg = f"a simplified mesh {how_to_install(PACKAGE)}"
        raise InputError(msg)
