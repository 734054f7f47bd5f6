"""Two sides measured in turn: what one machine does at one time, so that only their quotient is kept."""

from __future__ import annotations

import gc
import statistics
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

PAIRS = 5
"""Pairs of runs, at least; odd, so that the median of the quotients is one of them either way round."""
MOST_PAIRS = 51
ENOUGH_S = 2.0
"""Pairs are added until their runs together took so long: a disturbance of the host can outlast five short ones."""


class Timed(NamedTuple):
    """Medians over the pairs.

    Attributes
    ----------
    bgars_s, peer_s : float
        Median seconds of each side.
    speedup : float
        Median over the pairs of peer seconds / bgars seconds: load that comes and goes hits both runs of a pair.
    """

    bgars_s: float
    peer_s: float
    speedup: float


@contextmanager
def only_new_garbage() -> Iterator[None]:
    """Have collections look at new objects alone: through all of them they take long, and leave the caches cold."""
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()


def seconds(run: Callable[[], object]) -> float:
    """Wall time of one run; garbage, its own result too, is collected outside of it."""
    gc.collect()
    start = time.perf_counter()
    result = run()
    elapsed = time.perf_counter() - start
    del result
    return elapsed


def alternate(
    bgars: Callable[[], object],
    peer: Callable[[], object],
    pairs: int | None = None,
    peer_seconds: Callable[[Callable[[], object]], float] = seconds,
) -> Timed:
    """Warm up both sides, then run them in turn, `pairs` times or as often as says enough; who goes first changes."""
    runs: list[tuple[float, float]] = []
    with only_new_garbage():
        seconds(bgars)
        peer_seconds(peer)
        while not are_enough(runs, pairs):
            if len(runs) % 2 == 0:
                bgars_s = seconds(bgars)
                runs.append((bgars_s, peer_seconds(peer)))
            else:
                peer_s = peer_seconds(peer)
                runs.append((seconds(bgars), peer_s))
    bgars_times, peer_times = zip(*runs, strict=True)
    return Timed(
        statistics.median(bgars_times),
        statistics.median(peer_times),
        statistics.median(peer_s / bgars_s for bgars_s, peer_s in runs),
    )


def are_enough(runs: list[tuple[float, float]], pairs: int | None) -> bool:
    """Whether so many were asked for, or these say enough."""
    count = len(runs)
    if pairs is not None:
        return count >= pairs
    say_enough = count >= MOST_PAIRS or sum(map(sum, runs)) >= ENOUGH_S
    return count >= PAIRS and count % 2 == 1 and say_enough


def median_seconds(run: Callable[[], object], repeats: int = PAIRS) -> float:
    """Median of one side alone, after a warm-up: for rates of the machine, never for a comparison."""
    with only_new_garbage():
        seconds(run)
        return statistics.median(seconds(run) for _ in range(repeats))
