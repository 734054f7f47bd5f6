"""Checks of single numbers that a caller gives, and of what is to be called."""

from __future__ import annotations

import math
import operator
import os

import numpy as np

from bgars.errors import InputError

__all__ = ["check_pitch", "check_progress", "number", "thread_count"]

MAX_THREADS = 1024
MOST_A_CORE = 4
"""More threads than this only wait for each other; results do not depend on their number."""


def number(name: str, value: object) -> float:
    """Return the value, or raise InputError unless it is a number."""
    if isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool):
        return float(value)
    msg = f"{name}: must be a number, got {value!r}"
    raise InputError(msg)


def check_pitch(pixel_pitch_um: object, name: str = "pixel_pitch_um") -> None:
    """Raise InputError unless the pixel pitch is finite and above 0, or None."""
    if pixel_pitch_um is None:
        return
    pitch = number(name, pixel_pitch_um)
    if not (math.isfinite(pitch) and pitch > 0):
        msg = f"{name}: must be finite and above 0, got {pitch:g}"
        raise InputError(msg)


def check_progress(progress: object) -> None:
    """Raise InputError unless progress can be called, or is None."""
    if progress is not None and not callable(progress):
        msg = f"progress: must be callable, got {progress!r}"
        raise InputError(msg)


def thread_count(threads: object, name: str = "threads") -> int | None:
    """Return how many threads to work on: at most a few a core; None for as many as the environment says.

    Raises
    ------
    InputError
        No whole number from 1 to 1024.
    """
    if threads is None:
        return None
    try:
        count = operator.index(threads)  # type: ignore[arg-type]  # what has no index raises
    except TypeError:
        msg = f"{name}: must be a whole number from 1 to {MAX_THREADS}, got {threads!r}"
        raise InputError(msg) from None
    if isinstance(threads, bool) or not 1 <= count <= MAX_THREADS:
        told = str(threads) if abs(count) < 10**20 else "a number of many digits"
        msg = f"{name}: must be 1 to {MAX_THREADS}, got {told}"
        raise InputError(msg)
    return min(count, MOST_A_CORE * max(os.cpu_count() or 1, MOST_A_CORE))
