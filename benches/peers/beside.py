"""Short calls on several threads, alone and beside processes that never rest: a table of their times.

python benches/peers/beside.py                 one busy process beside it; also: beside.py 2
"""

from __future__ import annotations

import gc
import subprocess
import sys
import time
from typing import TYPE_CHECKING

import bgars
import numpy as np
from light_stack import LIGHTS, sphere_stack
from normal_fields import make_field
from process import own_threads

if TYPE_CHECKING:
    from collections.abc import Callable

CALLS = 150
PAUSE_S = 0.005
"""Between calls, as on a line: threads lie down, and are woken up."""
SIDES = (128, 256, 512, 1024)
QUANTILES = (0.25, 0.5, 0.75, 1.0)


def calls(threads: int) -> dict[str, Callable[[], object]]:
    """What is timed, by its name: on the common threads, and on threads asked for."""
    directions = bgars.LightRig.ring(LIGHTS).directions
    found: dict[str, Callable[[], object]] = {}
    for side in SIDES:
        normals = make_field("rectangle", side).normals
        images = sphere_stack(directions, np.dtype(np.uint8), side, side)
        found |= {
            f"normals {side}": lambda images=images: bgars.estimate_normals(images, directions, method="lambertian"),
            f"integrate {side}": lambda normals=normals: bgars.integrate_normals(normals),
            f"integrate {side}, threads={threads}": lambda normals=normals: bgars.integrate_normals(
                normals, threads=threads
            ),
        }
    return found


def times_ms(call: Callable[[], object]) -> list[float]:
    """Times of calls with pauses between."""
    call()
    gc.collect()
    times = []
    for _ in range(CALLS):
        time.sleep(PAUSE_S)
        start = time.perf_counter()
        call()
        times.append(1e3 * (time.perf_counter() - start))
    return times


def main(busy: int) -> None:
    """Print a line for each call, first alone, then beside `busy` processes."""
    work = calls(own_threads())
    heads = [f"{quantile:.0%}" for quantile in QUANTILES] + ["mean"]
    print(f"{f'{CALLS} calls each, in ms':<37}" + "".join(f"{head:>9}" for head in heads))
    for count in (0, busy):
        others = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(count)]
        try:
            for name, call in work.items():
                times = times_ms(call)
                figures = [*np.quantile(times, QUANTILES), np.mean(times)]
                print(f"{name:<28} beside {count}" + "".join(f"{figure:9.2f}" for figure in figures), flush=True)
        finally:
            for other in others:
                other.kill()
                other.wait()


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1)
