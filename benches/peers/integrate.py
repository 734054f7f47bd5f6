"""Height from normals to a relative residual of 1e-6: bgars against scipy (cosine transform, cg) and pyamg.

python benches/peers/integrate.py dct 1024        also: cg, amg (disc with holes), iterations
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import bgars
import numpy as np
from normal_fields import MASKS, Field, make_field
from process import own_threads
from rows import emit_check, emit_ratio, has
from timing import alternate

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

GROUP = "integrate"
TOLERANCE = 1e-6
ITERATION_LIMITS = {
    "rectangle": 12,
    "disc with holes": 12,
    "winding slits": 20,
    "random slits": 20,
    "dense slits": 20,
}
MAX_ITERS = 200
"""Where the count of iterations gives up: far beyond its limit, and reported as such."""
DCT_WORKERS = 2
"""Workers of the cosine transform that its limit is set against."""


def bgars_call(field: Field, tolerance: float = TOLERANCE) -> Callable[[], bgars.HeightMap]:
    """All of it, from normals: checks, assembly, set-up of the multigrid, iterations, components."""
    return lambda: bgars.integrate_normals(field.normals, mask=field.mask, relative_tolerance=tolerance)


def check_iterations(side: int) -> None:
    """Iterations and true residual of every shape."""
    size, threads = f"{side} x {side}", own_threads()
    for shape in MASKS:
        field, limit = make_field(shape, side), ITERATION_LIMITS[shape]
        done: bgars.HeightMap | bgars.ConvergenceError
        try:
            done = bgars.integrate_normals(
                field.normals, mask=field.mask, relative_tolerance=TOLERANCE, max_iters=MAX_ITERS
            )
        except bgars.ConvergenceError as error:
            done = error
        emit_check(GROUP, f"iterations, {shape}", size, threads, done.iterations, "", limit=limit)
        emit_check(GROUP, f"relative residual, {shape}", size, threads, done.residual, "", limit=TOLERANCE)


def emit_difference(what: str, side: int, ours: NDArray[np.float32], theirs: NDArray[np.floating]) -> None:
    """Root mean square difference of two height maps of zero mean, and the range of heights that it belongs to."""
    a, b = ours.astype(np.float64), np.asarray(theirs, dtype=np.float64)
    rms_px = float(np.sqrt(np.mean(((a - a.mean()) - (b - b.mean())) ** 2)))
    size = f"{side} x {side}"
    emit_check(GROUP, f"RMS difference to {what}", size, own_threads(), rms_px, f"px of {np.ptp(a):.0f} px")


def against_cosines(side: int) -> None:
    """The full image, which is all that a cosine transform can do; with weights of 1, which is all it can have."""
    if not has(GROUP, f"scipy DCT, {side} x {side}", "scipy"):
        return
    from poisson import CosineSolver, divergence  # noqa: PLC0415 - an optional install

    field, threads, size = make_field("rectangle", side), own_threads(), f"{side} x {side}"
    solver, right, ours = CosineSolver(side, threads), divergence(field.normals), bgars_call(field)
    limit = 3.0 if threads == DCT_WORKERS else None
    peer = f"scipy DCT Poisson, {threads} workers"
    timed = alternate(ours, lambda: solver.solve(divergence(field.normals)))
    emit_ratio(GROUP, "rectangle", size, threads, f"{peer}, from normals", timed, "at most", limit)
    timed = alternate(ours, lambda: solver.solve(right))
    emit_ratio(GROUP, "rectangle", size, threads, f"{peer}, solve alone", timed, "at most", None)
    emit_difference("scipy DCT (other weights), rectangle", side, ours().height_px, solver.solve(right))


def against_cg(side: int) -> None:
    """Plain conjugate gradient on the same matrix, given."""
    if not has(GROUP, f"scipy cg, {side} x {side}", "scipy"):
        return
    import scipy.sparse.linalg  # noqa: PLC0415 - an optional install
    from poisson import assemble  # noqa: PLC0415

    field = make_field("disc with holes", side)
    system = assemble(field)
    solve = lambda: scipy.sparse.linalg.cg(system.matrix, system.right, rtol=TOLERANCE, atol=0.0)  # noqa: E731
    emit_peer("scipy cg", side, field, lambda: solve()[0], limit=60.0)


def against_amg(side: int) -> None:
    """Ruge-Stüben multigrid as a preconditioner of cg on the same matrix, given; both sides' set-up is timed."""
    if not has(GROUP, f"pyamg, {side} x {side}", "scipy", "pyamg"):
        return
    import pyamg  # noqa: PLC0415 - an optional install
    from poisson import assemble  # noqa: PLC0415

    field = make_field("disc with holes", side)
    system = assemble(field)

    def solve() -> NDArray[np.float64]:
        return pyamg.ruge_stuben_solver(system.matrix).solve(system.right, tol=TOLERANCE, accel="cg")

    emit_peer("pyamg Ruge-Stüben + cg", side, field, solve, limit=10.0)


def emit_peer(peer: str, side: int, field: Field, solve: Callable[[], NDArray[np.float64]], limit: float) -> None:
    """Time a solver of the sparse matrix and compare its heights."""
    ours, size = bgars_call(field), f"{side} x {side}"
    timed = alternate(ours, solve)
    emit_ratio(GROUP, "disc with holes", size, own_threads(), peer, timed, "at least", limit)
    emit_difference(f"{peer}, disc with holes", side, ours().height_px[field.mask], solve())


COMMANDS = {"dct": against_cosines, "cg": against_cg, "amg": against_amg, "iterations": check_iterations}

if __name__ == "__main__":
    COMMANDS[sys.argv[1]](int(sys.argv[2]))
