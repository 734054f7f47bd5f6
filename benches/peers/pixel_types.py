"""Normals of other pixel types and numbers of lights, byte for byte against 8 lights of 8 bit.

python benches/peers/pixel_types.py 1500
"""

from __future__ import annotations

import itertools
import sys
from typing import TYPE_CHECKING

import bgars
import numpy as np
from light_stack import LIGHTS, sphere_stack
from normals import GROUP, THRESHOLD
from process import own_threads
from roofline import NORMAL_WRITTEN_BYTES
from rows import emit_check
from timing import alternate

if TYPE_CHECKING:
    from collections.abc import Callable

DTYPES = tuple(np.dtype(name) for name in ("uint8", "uint16", "float32"))
COUNTS = (LIGHTS, 16, 24, 96)
WRITTEN_BYTES = sum(NORMAL_WRITTEN_BYTES.values())
LEAST_SHARE = 0.5


def call(method: str, dtype: np.dtype, lights: int, side: int) -> Callable[[], bgars.NormalField]:
    """An estimate of spheres seen under so many lights."""
    directions = bgars.LightRig.ring(lights).directions
    images = sphere_stack(directions, dtype, side, side)
    threshold = THRESHOLD if method == "specular-filter" else None
    return lambda: bgars.estimate_normals(images, directions, method=method, threshold=threshold)


def main(side: int) -> None:
    """Every pixel type with every number of lights, on the threads of this process."""
    threads = own_threads()
    reference_bytes = LIGHTS * DTYPES[0].itemsize + WRITTEN_BYTES
    for method in ("specular-filter", "lambertian"):
        reference = call(method, DTYPES[0], LIGHTS, side)
        for dtype, lights in itertools.product(DTYPES, COUNTS):
            if (dtype, lights) == (DTYPES[0], LIGHTS):
                continue
            timed = alternate(call(method, dtype, lights, side), reference)
            share = timed.speedup * (lights * dtype.itemsize + WRITTEN_BYTES) / reference_bytes
            what = f"rate per byte, {method}, {lights} lights {dtype}"
            unit = f"of {LIGHTS} lights {DTYPES[0]}"
            emit_check(GROUP, what, f"{side} x {side}", threads, share, unit, bound="at least", limit=LEAST_SHARE)


if __name__ == "__main__":
    main(int(sys.argv[1]))
