"""Bilateral integration against plain sparse matrices (SciPy, Jacobi-preconditioned) of the same equations, in turn.

BGARS_DATA=... python benches/peers/bilateral.py [MAP ...]     the same inner tolerance on both sides

The published code is run too, where $BILATERAL_PUBLIC holds the command of its CPU version (python and script): it is
another process, measured by the seconds that it prints, which leave its start and its files out.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
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
SETTINGS = (("compatible", 1e-3), ("converged", 1e-6))
MIN_N_Z = 1e-3
PAIRS = 3
"""The peer takes up to a minute a run."""
MAX_ROUNDS = 150
"""Most re-weightings, as published."""
FIRST_ROUNDS = {"harvest": 10, "Fig5_plant": 3}
"""Re-weightings compared with plain matrices where all would take many minutes; once each after the warm-up."""
PUBLIC_ROUNDS = {"Fig5_plant": 3}
"""The same of the published code."""
SPARSE_LIMITS = {"Fig5_plant": 5.0}
"""How many times as fast as plain sparse matrices a map has to be."""
PUBLIC_LIMITS = {1: 8.0, 2: 12.0}
"""How many times as fast as the published code the compatible setting has to be, on DiLiGenT, by threads."""


def read_map(folder: Path) -> tuple[NDArray[np.float64], NDArray[np.bool_], NDArray[np.float64] | None]:
    """Normals, mask, and the camera matrix of a perspective map."""
    codes, bits = _bgars.read_color(folder / "normal_map.png", 100.0)
    normals = codes[..., :3].astype(np.float64) / (2**bits - 1) * 2 - 1
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    mask = np.asarray(Image.open(folder / "mask.png").convert("L")) > 0
    if (folder / "K.txt").exists():
        return normals, mask, np.loadtxt(folder / "K.txt")
    return normals, mask & (normals[..., 2] > MIN_N_Z), None


def shown_name(map_name: str, first_rounds: dict[str, int]) -> str:
    """The name of a map, and how many re-weightings are compared if not all of them."""
    return f"{map_name}, first {first_rounds[map_name]} re-weightings" if map_name in first_rounds else map_name


def compare(name: str, folder: Path) -> None:
    """Both sides on one map, every setting; and how far the last energies are apart."""
    from slow_bilateral import integrate as plain  # noqa: PLC0415 - needs SciPy

    normals, mask, matrix = read_map(folder)
    vectors, camera = normals.astype(np.float32), None if matrix is None else bgars.Pinhole(matrix)
    size = f"{mask.sum()} pixels"
    map_name = Path(name).name
    rounds = FIRST_ROUNDS.get(map_name, MAX_ROUNDS)
    for solver, tolerance in SETTINGS:
        options: dict[str, Any] = {"camera": camera, "solver": solver, "max_iters": rounds}
        last: dict[str, float] = {}

        def ours(options: dict[str, Any] = options, last: dict[str, float] = last) -> None:
            found: Any = bgars.integrate_normals(vectors, mask=mask, method="bilateral", **options)
            last["ours"] = float(found.bilateral.energies[-1])

        def theirs(
            tolerance: float = tolerance, last: dict[str, float] = last, published: bool = solver == "compatible"
        ) -> None:
            run = plain(normals, mask, matrix, inner_tolerance=tolerance, rounds=rounds, published=published)
            last["theirs"] = run[1][-1]

        what = f"{shown_name(map_name, FIRST_ROUNDS)}, {solver}"
        timed = alternate(ours, theirs, 1 if map_name in FIRST_ROUNDS else PAIRS)
        limit = SPARSE_LIMITS.get(map_name)
        emit_ratio(GROUP, what, size, own_threads(), f"scipy cg to {tolerance:g}, Jacobi", timed, limit=limit)
        apart = abs(last["ours"] / last["theirs"] - 1.0)
        emit_check(GROUP, f"{what}: last energies apart", size, own_threads(), apart, "relative")


def against_public(name: str, folder: Path) -> None:
    """The compatible setting and the published code on one map, in turn."""
    command = os.environ.get("BILATERAL_PUBLIC")
    if not command:
        emit(Skipped(GROUP, f"published code, {name}", "its command is not in $BILATERAL_PUBLIC"))
        return
    normals, mask, matrix = read_map(folder)
    vectors, camera = normals.astype(np.float32), None if matrix is None else bgars.Pinhole(matrix)
    with tempfile.TemporaryDirectory() as copy:
        for file in ("normal_map.png", "mask.png", "K.txt"):
            if (folder / file).exists():
                shutil.copy(folder / file, copy)
        map_name = Path(name).name
        rounds = PUBLIC_ROUNDS.get(map_name, MAX_ROUNDS)
        line = [*shlex.split(command), "-p", copy, "-k", "2", "--iter", str(rounds), "--tol", "1e-4"]

        def published() -> str:
            return subprocess.run(line, check=True, capture_output=True, text=True).stdout

        def ours() -> None:
            bgars.integrate_normals(
                vectors, mask=mask, method="bilateral", camera=camera, solver="compatible", max_iters=rounds
            )

        pairs = 1 if map_name in PUBLIC_ROUNDS else PAIRS
        timed = alternate(ours, published, pairs, peer_seconds=lambda run: printed_seconds(str(run())))
        what = f"{shown_name(map_name, PUBLIC_ROUNDS)}, compatible"
        limit = PUBLIC_LIMITS.get(own_threads()) if name.startswith("diligent/") else None
        emit_ratio(
            GROUP, what, f"{mask.sum()} pixels", own_threads(), "published code (one thread)", timed, limit=limit
        )


def printed_seconds(output: str) -> float:
    """The time that the published code prints."""
    found = re.search(r"Total time: ([0-9.]+) sec", output)
    if found is None:
        msg = f"no 'Total time: ... sec' among {output[-200:]!r}"
        raise ValueError(msg)
    return float(found[1])


def main() -> None:
    """Rows of the maps named, of all without a name; a line for each that is not there."""
    for name in sys.argv[1:] or MAPS:
        folder = data_folder() / "normal_maps" / name
        if not folder.is_dir():
            emit(Skipped(GROUP, name, "the map is not in $BGARS_DATA/normal_maps"))
            continue
        against_public(name, folder)
        # Plain matrices take minutes a map, on one thread whatever they are given.
        if own_threads() == 1 and has(GROUP, name, "scipy"):
            compare(name, folder)


if __name__ == "__main__":
    main()
