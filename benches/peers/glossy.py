"""Normals of glossy balls: bgars by reflectance against estimators that take highlights as sparse errors.

python benches/peers/glossy.py 10
"""

from __future__ import annotations

import sys
from functools import partial
from typing import TYPE_CHECKING

import bgars
import numpy as np
from process import own_threads
from rows import emit_check, emit_ratio
from sparse_regression import least_absolute, sparse_bayesian
from timing import Timed, alternate

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

GROUP = "glossy"
MATERIAL = bgars.Material(i_d=0.25, i_s=1.0, hardness=40)
CAMERA = bgars.Camera(pixel_pitch_um=5.0, supersample=2, read_noise_levels=0.5)
FULL_SCALE = 255.0
MIN_N_Z = 0.3
PAIRS = 3
MEGAPIXEL = 1e6
Estimator = tuple[str, "Callable[[Floats, Floats], Floats]", int]
PEERS: tuple[Estimator, ...] = (
    ("L1, a linear program a pixel (scipy, HiGHS)", least_absolute, 300),
    ("sparse Bayesian learning (numpy, batches)", sparse_bayesian, 5000),
)
"""Name, function, and on how many pixels it is timed: more would say nothing else and take minutes."""


def mean_error_deg(normals: NDArray[np.floating], truth: NDArray[np.floating]) -> float:
    """Mean angle of (N, 3) vectors to (N, 3) unit normals; `normals` of any length."""
    lengths = np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return float(bgars.angular_error_deg(normals / lengths, truth).mean())


def main() -> None:
    """Simulate a grid of balls, estimate it, and time the peers on some of its ball pixels."""
    side = int(sys.argv[1])
    capture, truth = bgars.simulate(bgars.Scene.ball_array(side, side), bgars.LightRig.ring(8), MATERIAL, CAMERA)
    size, threads = f"{side} x {side} balls", own_threads()
    judged = truth.mask & (truth.normals[..., 2] > MIN_N_Z)
    every = np.argwhere(judged)
    ours = partial(bgars.estimate_normals, capture)
    ours_deg = mean_error_deg(ours().normals[judged], truth.normals[judged])
    emit_check(GROUP, "mean error, bgars reflectance", size, threads, ours_deg, "deg")
    for name, peer, count in PEERS:
        row, col = every[:: max(1, len(every) // count)].T
        values = capture.images[:, row, col].T / FULL_SCALE
        solved = peer(values, capture.rig.directions)
        emit_check(GROUP, f"mean error, {name}", size, threads, mean_error_deg(solved, truth.normals[row, col]), "deg")
        timed = alternate(ours, partial(peer, values, capture.rig.directions), pairs=PAIRS)
        per_ours, per_peer = MEGAPIXEL / len(every), MEGAPIXEL / len(values)
        a_megapixel = Timed(timed.bgars_s * per_ours, timed.peer_s * per_peer, timed.speedup * per_peer / per_ours)
        emit_ratio(GROUP, "a million ball pixels, finder and board too", size, threads, name, a_megapixel)


if __name__ == "__main__":
    main()
