"""Normals of 8 lights of 8 bit by the published filter: bgars against numba, numpy and a plain copy.

python benches/peers/normals.py 4 2000 2000
"""

from __future__ import annotations

import inspect
import sys
from typing import TYPE_CHECKING

import bgars
import numpy as np
import subsets
from copies import copier
from light_stack import Stack, make_stack
from process import own_threads
from rows import emit_check, emit_ratio, has
from timing import alternate

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

GROUP = "normals"
THRESHOLD = 50.0
COPY_BYTES = 24
"""8 values read and normal and albedo written; as a copy, 12 read and 12 written (or 24 and 24, for who counts so)."""
ROWS_AT_ONCE = 100
"""Rows of the float64 reference: it needs some hundred bytes a pixel."""


def bgars_call(stack: Stack) -> Callable[[], bgars.NormalField]:
    """What a user calls; it allocates its results (normals, albedo, mask, confidence, number of lights kept)."""
    return lambda: bgars.estimate_normals(stack.images, stack.directions, method="specular-filter", threshold=THRESHOLD)


def bgars_reusing(stack: Stack) -> Callable[[], object] | None:
    """The same into arrays that are there already; None while the call has no `out` argument."""
    if "out" not in inspect.signature(bgars.estimate_normals).parameters:
        return None
    out = bgars_call(stack)()
    return lambda: bgars.estimate_normals(
        stack.images, stack.directions, method="specular-filter", threshold=THRESHOLD, out=out
    )


def angles_deg(a: NDArray[np.floating], b: NDArray[np.floating]) -> NDArray[np.float64]:
    """Angles between vectors, exact for small ones too."""
    a, b = a.astype(np.float64), b.astype(np.float64)
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(axis=-1)))


def check_accuracy(stack: Stack, size: str) -> None:
    """Compare bgars with float64 numpy on the kept lights that it reports."""
    field = bgars.estimate_normals(
        stack.images, stack.directions, method="specular-filter", threshold=THRESHOLD, keep_sets=True
    )
    worst_deg, other_sets, other_masks = 0.0, 0, 0
    for top in range(0, stack.images.shape[1], ROWS_AT_ONCE):
        rows = slice(top, top + ROWS_AT_ONCE)
        codes = np.packbits(field.kept_sets[rows], axis=2, bitorder="little")[..., 0]
        reference = subsets.solve_by_set(stack.images[:, rows], stack.directions, codes)
        solved = np.isfinite(reference[..., 2])
        both = solved & field.mask[rows]
        worst_deg = max(worst_deg, angles_deg(reference[both], field.normals[rows][both]).max(initial=0.0))
        other_sets += int((codes != subsets.kept_codes(stack.images[:, rows], THRESHOLD)).sum())
        other_masks += int((solved != field.mask[rows]).sum())
    threads = own_threads()
    cut = float((field.lights_kept < len(stack.images)).mean())
    emit_check(GROUP, f"pixels that lose a light ({stack.source})", size, threads, 100.0 * cut, "%")
    emit_check(GROUP, "largest angle to float64 numpy on the same lights", size, threads, worst_deg, "deg", limit=1e-3)
    emit_check(GROUP, "pixels whose kept lights differ from numpy's", size, threads, other_sets, "pixels", limit=0)
    emit_check(GROUP, "pixels solved by one and not the other", size, threads, other_masks, "pixels", limit=0)


def against_numba(stack: Stack, size: str) -> None:
    """The one-pass kernel that the limit is set against, and the faster one that LLVM vectorises."""
    if not has(GROUP, f"numba, {size}", "numba"):
        return
    from numba_kernel import NumbaKernel  # noqa: PLC0415 - an optional install
    from numba_split import NumbaSplit  # noqa: PLC0415

    threads, ours, reusing = own_threads(), bgars_call(stack), bgars_reusing(stack)
    field = ours()
    variants = ((NumbaKernel, "numba, one pass, scalar sorting network", 5.0), (NumbaSplit, "numba, split loops", None))
    for variant, peer, limit in variants:
        kernel = variant(stack.images, stack.directions, THRESHOLD)
        emit_ratio(GROUP, "normals", size, threads, peer, alternate(ours, kernel), limit=limit)
        if reusing is not None:
            emit_ratio(GROUP, "normals, results reused", size, threads, peer, alternate(reusing, kernel))
        both = field.mask & (kernel.normals[..., 2] > 0)
        unlike = int((field.mask != (kernel.normals[..., 2] > 0)).sum())
        worst_deg = max(
            angles_deg(field.normals[rows][both[rows]], kernel.normals[rows][both[rows]]).max(initial=0.0)
            for rows in (slice(top, top + ROWS_AT_ONCE) for top in range(0, len(both), ROWS_AT_ONCE))
        )
        emit_check(GROUP, f"largest angle to {peer}", size, threads, worst_deg, "deg", limit=1e-2)
        emit_check(GROUP, f"pixels solved by bgars or {peer}, not both", size, threads, unlike, "pixels")


def main(label_megapixels: str, rows: int, cols: int) -> None:
    """All comparisons at one size, with the threads of this process."""
    stack, threads = make_stack(rows, cols), own_threads()
    size = f"{label_megapixels} MP"
    check_accuracy(stack, size)
    against_numba(stack, size)
    ours, reusing = bgars_call(stack), bgars_reusing(stack)
    copy = copier(rows * cols * COPY_BYTES // 2, threads)
    peer = f"plain copy of {COPY_BYTES} bytes a pixel"
    emit_ratio(GROUP, "normals", size, threads, peer, alternate(ours, copy), limit=0.5)
    if reusing is not None:
        emit_ratio(GROUP, "normals, results reused", size, threads, peer, alternate(reusing, copy))
    twice = f"copy of {COPY_BYTES} bytes read and as many written"
    emit_ratio(GROUP, "normals", size, threads, twice, alternate(ours, copier(rows * cols * COPY_BYTES, threads)))
    numpy_call = lambda: subsets.estimate(stack.images, stack.directions, THRESHOLD)  # noqa: E731
    emit_ratio(GROUP, "normals", size, threads, "numpy, one thread", alternate(ours, numpy_call), limit=70.0)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
