"""Two sides measured in turn: what one machine does at one time, so that only their quotient is kept."""

from __future__ import annotations

import gc
import statistics
import time
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable

PAIRS = 5
"""Pairs of runs; odd, so that the median of the quotients is one of them either way round."""


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
    pairs: int = PAIRS,
    peer_seconds: Callable[[Callable[[], object]], float] = seconds,
) -> Timed:
    """Warm up both sides, then run them in turn; who goes first changes from pair to pair."""
    seconds(bgars)
    peer_seconds(peer)
    runs = []
    for pair in range(pairs):
        if pair % 2 == 0:
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


def median_seconds(run: Callable[[], object], repeats: int = PAIRS) -> float:
    """Median of one side alone, after a warm-up: for rates of the machine, never for a comparison."""
    seconds(run)
    return statistics.median(seconds(run) for _ in range(repeats))
