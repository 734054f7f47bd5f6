"""Bytes and operations a pixel, counted by hand from the code, beside the rate at which this machine copies.

python benches/peers/roofline.py normals 2000 2000        also: iteration 2048 (side of a full image)
"""

from __future__ import annotations

import sys

import normals
from copies import copy_bytes_per_s
from integrate import GROUP as INTEGRATE
from integrate import bgars_call
from light_stack import make_stack
from normal_fields import make_field
from process import own_threads
from rows import Roofline, emit
from timing import alternate, median_seconds

NORMAL_WRITTEN_BYTES = {
    "normal written": 12,
    "albedo written": 4,
    "mask, confidence, number of lights written": 1 + 4 + 2,
}
NORMAL_BYTES = {"8 values read": 8, **NORMAL_WRITTEN_BYTES}
NORMAL_OPERATIONS = {
    "sorting network, 19 exchanges of a least and a greatest": 38,
    "cut-off, 5 gaps of a difference, a comparison, a choice": 15,
    "kept lights, 8 comparisons, choices and bits": 24,
    "inverse of the Gram matrix, 8 numbers looked up": 8,
    "four sums over 8 lights": 64,
    "solution, its conditioning compared twice, squared residual": 15 + 2 + 5 + 3,
    "its square, a trace, a quadratic form, what turns the normal": 5 + 2 + 16 + 2,
    "range, length, normal, albedo": 3 + 1 + 4 + 1,
    "confidence": 8,
}
"""Of a pixel that loses a light; where a vector keeps all of them, the inverse falls away."""
ITERATION_BYTES = {
    "way up: weights, rounded r, coarse solution and last p read, p and q written": 8 + 2 + 1 + 2 + 2 + 4,
    "step of r, two floats read and written, q read": 8 + 4,
    "every second time two steps of x, read and written on the way up, the p before the last read": (8 + 2) // 2,
    "restriction: weights and rounded r read, coarse right side written": 8 + 2 + 1,
    "coarser grids: 32 bytes for each of their pixels, a third as many": 11,
}
"""Half the pixels are unknowns (float64: 4 bytes a pixel; float32: 2; the four float32 weights of an unknown: 8)."""
ITERATION_OPERATIONS = {
    "direction": 1,
    "product": 14,
    "step": 3,
    "restriction, and what smoothing adds to <r, z>": 18 + 2,
    "prolongation": 18,
    "coarser grids": 18,
}
LOOSE, TIGHT = 1e-3, 1e-9


def of_normals(rows: int, cols: int) -> None:
    """The normal kernel on 8 lights of 8 bit."""
    call, threads = normals.bgars_call(make_stack(rows, cols)), own_threads()
    size = f"{rows * cols / 1e6:.3g} MP"
    bytes_per_pixel, operations = sum(NORMAL_BYTES.values()), sum(NORMAL_OPERATIONS.values())
    rate, seconds = copy_bytes_per_s(threads), median_seconds(call)
    what = "normals, 8 lights u8"
    emit(Roofline(normals.GROUP, what, size, threads, bytes_per_pixel, operations, seconds, rows * cols, rate))


def of_iteration(side: int) -> None:
    """One iteration of the solver: what a tighter tolerance costs, divided by the iterations it adds."""
    field, threads = make_field("rectangle", side), own_threads()
    loose, tight = bgars_call(field, LOOSE), bgars_call(field, TIGHT)
    added = tight().iterations - loose().iterations
    timed = alternate(loose, tight)
    seconds = (timed.peer_s - timed.bgars_s) / added
    bytes_per_pixel, operations = sum(ITERATION_BYTES.values()), sum(ITERATION_OPERATIONS.values())
    rate, size = copy_bytes_per_s(threads), f"{side} x {side}"
    what = "one solver iteration"
    emit(Roofline(INTEGRATE, what, size, threads, bytes_per_pixel, operations, seconds, side * side, rate))


if __name__ == "__main__":
    if sys.argv[1] == "normals":
        of_normals(int(sys.argv[2]), int(sys.argv[3]))
    else:
        of_iteration(int(sys.argv[2]))
