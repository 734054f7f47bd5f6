"""Bilateral integration against plain sparse matrices (SciPy, Jacobi-preconditioned) of the same equations, in one run.

Command: ``BGARS_DATA=... python benches/peers/bilateral.py``. One thread each; the same inner tolerance on both sides.
"""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

import bgars
import numpy as np
from bgars import _bgars
from PIL import Image

sys.path.insert(0, str(Path(__file__).parents[2] / "tests" / "unit"))

from slow_bilateral import integrate as plain

MAPS = ("diligent/bear", "diligent/cat", "diligent/goblet", "diligent/harvest", "diligent/pot1", "Fig5_plant")
SETTINGS = {"compatible": 1e-3, "converged": 1e-6}
MIN_N_Z = 1e-3


def main() -> None:
    """Print a line a map and setting: seconds of both, and how many times faster."""
    data = Path(os.environ["BGARS_DATA"]) / "normal_maps"
    chosen = sys.argv[1:] or MAPS
    print("| map | setting | pixels | SciPy (s) | bgars (s) | times faster | energies |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for name in chosen:
        folder = data / name
        normals = _bgars.read_rgb16(folder / "normal_map.png", 100.0) / 65535 * 2 - 1
        normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
        mask = np.asarray(Image.open(folder / "mask.png").convert("L")) > 0
        matrix = np.loadtxt(folder / "K.txt") if (folder / "K.txt").exists() else None
        if matrix is None:
            mask &= normals[..., 2] > MIN_N_Z
        camera = None if matrix is None else bgars.Pinhole(matrix)
        vectors = normals.astype(np.float32)
        for setting, tolerance in SETTINGS.items():
            start = time.perf_counter()
            _, energies, _ = plain(normals, mask, matrix, inner_tolerance=tolerance)
            slow_s = time.perf_counter() - start
            start = time.perf_counter()
            fit = bgars.integrate_normals(
                vectors, mask=mask, method="bilateral", camera=camera, solver=setting, precision="single", threads=1
            )
            fast_s = time.perf_counter() - start
            both = f"{energies[-1]:.1f}, {fit.bilateral.energies[-1]:.1f}"
            print(
                f"| {name} | {setting} | {mask.sum()} | {slow_s:.2f} | {fast_s:.3f} | {slow_s / fast_s:.1f} | {both} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
