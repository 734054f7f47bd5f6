"""The compiled core. Arrays must be C-contiguous and of the dtypes given here; the public functions see to that."""

from collections.abc import Callable, Sequence
from os import PathLike
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from bgars.balls.rim_pixels import RimPixels
from bgars.inspection.shadow_edges import Lines
from bgars.inspection.shadow_map import Casters
from bgars.normals.kernel_outputs import KernelOutputs
from bgars.records.kernel_capture import KernelCapture
from bgars.records.surface_material import SurfaceMaterial

__all__ = [
    "BLIND_MIN_LIGHTS",
    "DEBUG_BUILD",
    "REFLECTANCE_MAX_LOSS",
    "REFLECTANCE_MIN_LIGHTS",
    "assignment",
    "decode_stack",
    "draw_shadows",
    "edge_products",
    "edge_rows",
    "eliminate_rims",
    "estimate_normals",
    "estimate_reflectance",
    "float_full_scale",
    "integrate_bilateral",
    "integrate_normals",
    "measure_edges",
    "normal_distribution",
    "predict_left_out",
    "read_color",
    "rim_bands",
    "rim_profiles",
    "ring_edges",
    "triangulate",
    "unit_directions",
    "usable_normals",
    "vertex_normals",
    "write_height",
    "write_mesh",
    "write_png16",
]

BLIND_MIN_LIGHTS: Final[int]
DEBUG_BUILD: Final[bool]
REFLECTANCE_MAX_LOSS: Final[float]
REFLECTANCE_MIN_LIGHTS: Final[int]

def assignment(costs: NDArray[np.float64]) -> NDArray[np.uintp]: ...
def decode_stack(
    paths: Sequence[str | PathLike[str]],
    *,
    channel: str,
    response: NDArray[np.float32] | None,
    gains: NDArray[np.float32] | None,
    max_megapixels: float,
    threads: int | None,
    allocate: Callable[[tuple[int, ...], str], NDArray[Any]],
) -> tuple[Any, bool, int]: ...
def draw_shadows(
    casters: Casters,
    *,
    shape: tuple[int, int],
    step: int,
    silhouette_margin_px: float,
    shadow_margin_px: float,
    threads: int | None,
) -> tuple[NDArray[np.bool_], NDArray[np.uint8]]: ...
def edge_products(rows: NDArray[np.float64], weights: NDArray[np.float64]) -> NDArray[np.float64]: ...
def edge_rows(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    casters: Casters,
    *,
    turns: NDArray[np.float64],
    shifts_px: NDArray[np.float64],
    waves_px: list[float],
) -> NDArray[np.float64]: ...
def eliminate_rims(
    pixels: RimPixels,
    circles: NDArray[np.float64],
    table: NDArray[np.float32],
    *,
    blur_px: float,
    threads: int | None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...
def estimate_normals(
    capture: KernelCapture,
    *,
    mask: NDArray[np.bool_] | None,
    method: str,
    threshold: float,
    threads: int | None,
    progress: Callable[[float], object] | None,
    out: KernelOutputs,
) -> str | None: ...
def predict_left_out(
    capture: KernelCapture, *, mask: NDArray[np.bool_] | None, threads: int | None
) -> tuple[float, float, float, float] | None: ...
def estimate_reflectance(
    capture: KernelCapture,
    *,
    mask: NDArray[np.bool_] | None,
    circles: NDArray[np.float64],
    free: NDArray[np.bool_] | None,
    wanted: NDArray[np.bool_] | None,
    material: SurfaceMaterial | None,
    threads: int | None,
    progress: Callable[[float], object] | None,
    out: KernelOutputs,
) -> dict[str, Any]: ...
def usable_normals(normals: NDArray[np.float32], *, threads: int | None) -> NDArray[np.bool_]: ...
def unit_directions(directions: NDArray[np.float64]) -> NDArray[np.float64]: ...
def float_full_scale(pixels: NDArray[np.float32], *, threads: int | None) -> float: ...
def integrate_bilateral(
    normals: NDArray[np.float32],
    mask: NDArray[np.bool_],
    weights: NDArray[np.float32] | None,
    regions: NDArray[np.int32] | None,
    *,
    camera: tuple[float, float, float, float] | None,
    k: float,
    max_iters: int,
    tolerance: float,
    setting: str,
    threads: int | None,
    progress: Callable[[int, float], object] | None,
) -> dict[str, Any]: ...
def integrate_normals(
    normals: NDArray[np.float32],
    mask: NDArray[np.bool_],
    weights: NDArray[np.float32] | None,
    regions: NDArray[np.int32] | None,
    *,
    height_px: NDArray[np.float32],
    labels: NDArray[np.int32],
    difference: str,
    relative_tolerance: float,
    absolute_tolerance: float,
    max_iters: int,
    threads: int | None,
    progress: Callable[[int, float], object] | None,
) -> tuple[list[tuple[int, int, int]], int, float]: ...
def measure_edges(
    capture: KernelCapture,
    casters: Casters,
    settings: Lines,
    *,
    angles_rad: list[float],
    sectors: int,
    gains: NDArray[np.float32],
    step: int,
    hidden: NDArray[np.bool_],
    count: NDArray[np.uint8],
    mask: NDArray[np.bool_] | None,
    threads: int | None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...
def normal_distribution(values: NDArray[np.float64], *, threads: int | None) -> NDArray[np.float64]: ...
def read_color(path: str | PathLike[str], max_megapixels: float) -> tuple[NDArray[np.float32], int]: ...
def rim_bands(
    circles: NDArray[np.float64],
    depths: NDArray[np.float64],
    *,
    every: int,
    sectors: int,
    threads: int | None,
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]: ...
def rim_profiles(blur_px: float, reach_px: float, *, threads: int | None) -> NDArray[np.float32]: ...
def ring_edges(
    images: NDArray[np.float32],
    centres: NDArray[np.float64],
    radii_px: NDArray[np.float64],
    *,
    directions: int,
    rank: int,
    threads: int | None,
) -> NDArray[np.float32]: ...
def triangulate(
    height_px: NDArray[np.float32], mask: NDArray[np.bool_], pitch: float, *, threads: int | None
) -> tuple[NDArray[np.float32], NDArray[np.uint32], NDArray[np.uint32]]: ...
def vertex_normals(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], *, threads: int | None
) -> NDArray[np.float32]: ...
def write_height(
    path: str | PathLike[str],
    height_px: NDArray[np.float32],
    mask: NDArray[np.bool_],
    pitch: float,
    *,
    normals: NDArray[np.float32] | None,
    grey: NDArray[np.uint8] | None,
    comments: Sequence[str],
    threads: int | None,
) -> None: ...
def write_mesh(
    path: str | PathLike[str],
    vertices: NDArray[np.float64],
    faces: NDArray[np.int64],
    *,
    normals: NDArray[np.float64] | None,
    colors: NDArray[np.uint8] | None,
    comments: Sequence[str],
    threads: int | None,
) -> None: ...
def write_png16(path: str | PathLike[str], rgb: NDArray[np.uint16]) -> None: ...
