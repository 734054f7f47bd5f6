"""The machine's copy rate: the least time in which so many bytes can move."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from timing import median_seconds

if TYPE_CHECKING:
    from collections.abc import Callable

RATE_BYTES = 1 << 28
"""Size of the buffers that measure the rate: far beyond every cache."""


def copier(nbytes: int, threads: int) -> Callable[[], object]:
    """A plain copy of `nbytes` (read) to as many (written) by `threads` threads, between warm buffers."""
    source = np.full(nbytes, 1, dtype=np.uint8)
    target = np.zeros(nbytes, dtype=np.uint8)
    target[:] = source
    bounds = np.linspace(0, nbytes, threads + 1).astype(int)
    parts = [(target[a:b], source[a:b]) for a, b in pairwise(bounds)]
    if threads == 1:
        return lambda: np.copyto(target, source)
    pool = ThreadPoolExecutor(threads)  # numpy releases the interpreter lock while it copies
    return lambda: list(pool.map(lambda part: np.copyto(*part), parts))


def copy_bytes_per_s(threads: int) -> float:
    """Bytes read plus bytes written a second by a plain copy."""
    return 2 * RATE_BYTES / median_seconds(copier(RATE_BYTES, threads))
