"""Bits do not depend on threads; Python goes on while Rust works."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
import threading

import bgars
import numpy as np

DIGEST = """
import hashlib, bgars
result = bgars.reconstruct(bgars.read_capture(bgars.sample_capture()))
print(hashlib.sha256(result.field.normals.tobytes() + result.height.height_px.tobytes()).hexdigest())
"""


def test_one_and_two_threads_give_the_same_bits() -> None:
    digests = {
        subprocess.run(
            [sys.executable, "-c", DIGEST],
            env={**os.environ, "RAYON_NUM_THREADS": str(threads)},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for threads in (1, 2)
    }
    assert len(digests) == 1
    assert len(digests.pop().strip()) == len(hashlib.sha256().hexdigest())


def test_other_threads_run_while_the_solver_works() -> None:
    normals = np.random.default_rng(0).normal([0, 0, 2], 0.3, (300, 300, 3)).astype(np.float32)
    normals[..., 2] = np.abs(normals[..., 2])
    ticks = 0
    done = threading.Event()

    def count() -> None:
        nonlocal ticks
        while not done.wait(0.001):
            ticks += 1

    thread = threading.Thread(target=count)
    thread.start()
    bgars.integrate_normals(normals)
    done.set()
    thread.join()
    assert ticks >= 3, "the GIL was held"


def test_progress_is_reported_and_its_exception_stops_the_work() -> None:
    normals = np.random.default_rng(0).normal([0, 0, 2], 0.3, (700, 700, 3)).astype(np.float32)
    normals[..., 2] = np.abs(normals[..., 2])
    seen: list[tuple[int, float]] = []

    def stop(iteration: int, residual: float) -> None:
        seen.append((iteration, residual))
        if len(seen) == 2:
            raise StopIteration

    try:
        bgars.integrate_normals(normals, progress=stop)
    except StopIteration:
        pass
    else:
        raise AssertionError("the exception of the callback was lost")
    assert len(seen) == 2
    assert seen[1][0] > seen[0][0]
