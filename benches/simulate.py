"""Time the simulator: one hemisphere, the 10 x 10 array on 2048 x 2048 pixels with one and with all threads."""

from __future__ import annotations

import time
from collections.abc import Callable

import bgars


def best_of(runs: int, work: Callable[[], object]) -> float:
    """Shortest of some runs, in seconds."""
    times = []
    for _ in range(runs):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


def main() -> None:
    """Print a line a case."""
    for name, runs in (("hemisphere", 5), ("array-10x10", 2)):
        setup = bgars.read_scene(name)
        for threads in (1, None):
            seconds = best_of(
                runs,
                lambda setup=setup, threads=threads: bgars.simulate(  # type: ignore[misc]
                    setup.scene, setup.rig, setup.material, setup.camera, seed=setup.seed, threads=threads
                ),
            )
            print(f"{name}, {'all' if threads is None else threads} thread(s): {seconds:.2f} s")


if __name__ == "__main__":
    main()
