"""How the time of an integration grows with pixels and shrinks with threads.

python benches/peers/scaling.py "disc with holes" 1024
"""

from __future__ import annotations

import json
import sys
from functools import partial

from integrate import GROUP, bgars_call
from normal_fields import make_field
from process import Worker
from rows import Point, emit, emit_ratio
from timing import alternate

THREADS = (1, 2)
MIN_SPEEDUP = 1.6
MIN_LIMIT_SIDE = 1024
"""Below a megapixel the limit on the speed-up is not applied: the coarse grids have too few rows to share."""


def serve(shape: str, side: int) -> None:
    """Integrate once for every line on the standard input; say how many iterations it took."""
    call = bgars_call(make_field(shape, side))
    sys.stdout.write("{}\n")
    sys.stdout.flush()
    for _ in sys.stdin:
        iterations = call().iterations
        sys.stdout.write(json.dumps({"iterations": iterations}) + "\n")
        sys.stdout.flush()


def main(shape: str, side: int) -> None:
    """Two processes, one and two threads, in turn."""
    one, two = (Worker("scaling.py", ["--serve", shape, str(side)], threads) for threads in THREADS)
    timed = alternate(two.run, one.run)
    for worker, threads, seconds in ((one, 1, timed.peer_s), (two, 2, timed.bgars_s)):
        emit(Point(GROUP, shape, side * side / 1e6, threads, seconds, worker.answer["iterations"]))
        worker.close()
    limit = MIN_SPEEDUP if side >= MIN_LIMIT_SIDE else None
    emit_ratio(GROUP, f"{shape}, threads", f"{side} x {side}", 2, "bgars, 1 thread", timed, "at least", limit)


if __name__ == "__main__":
    command = partial(serve, sys.argv[2], int(sys.argv[3])) if sys.argv[1] == "--serve" else None
    (command or partial(main, sys.argv[1], int(sys.argv[2])))()
