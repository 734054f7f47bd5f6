"""Bilateral integration against plain sparse matrices (SciPy, Jacobi-preconditioned) of the same equations, in turn.

BGARS_DATA=... python benches/peers/bilateral.py [MAP ...]     one thread each, the same inner tolerance on both sides
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import bgars
import numpy as np
from bgars import _bgars
from light_stack import data_folder
from PIL import Image
from process import own_threads
from rows import Skipped, emit, emit_check, emit_ratio, has
from timing import alternate

sys.path.insert(0, str(Path(__file__).parents[2] / "tests" / "unit"))

if TYPE_CHECKING:
    from numpy.typing import NDArray

GROUP = "bilateral"
MAPS = ("diligent/bear", "diligent/cat", "diligent/goblet", "diligent/harvest", "diligent/pot1", "Fig5_plant")
SETTINGS = (("compatible", "double", 1e-3), ("compatible", "single", 1e-3), ("converged", "double", 1e-6))
MIN_N_Z = 1e-3
PAIRS = 3
"""The peer takes up to a minute a run."""


def read_map(folder: Path) -> tuple[NDArray[np.float64], NDArray[np.bool_], NDArray[np.float64] | None]:
    """Normals, mask, and the camera matrix of a perspective map."""
    normals = _bgars.read_rgb16(folder / "normal_map.png", 100.0) / 65535 * 2 - 1
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    mask = np.asarray(Image.open(folder / "mask.png").convert("L")) > 0
    if (folder / "K.txt").exists():
        return normals, mask, np.loadtxt(folder / "K.txt")
    return normals, mask & (normals[..., 2] > MIN_N_Z), None


def compare(name: str, folder: Path) -> None:
    """Both sides on one map, every setting; and how far the last energies are apart."""
    from slow_bilateral import integrate as plain  # noqa: PLC0415 - needs SciPy

    normals, mask, matrix = read_map(folder)
    vectors, camera = normals.astype(np.float32), None if matrix is None else bgars.Pinhole(matrix)
    size = f"{mask.sum()} pixels"
    for solver, precision, tolerance in SETTINGS:
        options: dict[str, Any] = {"camera": camera, "solver": solver, "precision": precision}
        last: dict[str, float] = {}

        def ours(options: dict[str, Any] = options, last: dict[str, float] = last) -> None:
            found: Any = bgars.integrate_normals(vectors, mask=mask, method="bilateral", **options)
            last["ours"] = float(found.bilateral.energies[-1])

        def theirs(
            tolerance: float = tolerance, last: dict[str, float] = last, published: bool = solver == "compatible"
        ) -> None:
            last["theirs"] = plain(normals, mask, matrix, inner_tolerance=tolerance, published=published)[1][-1]

        what = f"{Path(name).name}, {solver}, {precision}"
        timed = alternate(ours, theirs, PAIRS)
        emit_ratio(GROUP, what, size, own_threads(), f"scipy cg to {tolerance:g}, Jacobi", timed)
        apart = abs(last["ours"] / last["theirs"] - 1.0)
        emit_check(GROUP, f"{what}: last energies apart", size, own_threads(), apart, "relative")


def main() -> None:
    """Rows of the maps named, of all without a name; a line for each that is not there."""
    for name in sys.argv[1:] or MAPS:
        folder = data_folder() / "normal_maps" / name
        if not folder.is_dir():
            emit(Skipped(GROUP, name, "the map is not in $BGARS_DATA/normal_maps"))
        elif has(GROUP, name, "scipy"):
            compare(name, folder)


if __name__ == "__main__":
    main()
