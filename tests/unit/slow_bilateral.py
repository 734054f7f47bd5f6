"""Bilateral integration as plain sparse matrices: the slow twin, from the equations of Cao et al. (ECCV 2022)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import cg

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

MAX_ARGUMENT = 70.0


def slants(normals: Array, matrix_px: Array | None, *, published: bool = False) -> tuple[Array, Array]:
    """``g`` of both axes: n_z, or in perspective -f times the product of normal and ray.

    As published: eq. 8 for one focal length, each axis with its own in place of it.
    """
    if matrix_px is None:
        return normals[..., 2], normals[..., 2]
    (f_x, _, c_x), (_, f_y, c_y), _ = matrix_px
    row, col = np.indices(normals.shape[:2])
    if published:
        across = normals[..., 0] * (col - c_x) + normals[..., 1] * (c_y - row)
        return f_x * normals[..., 2] - across, f_y * normals[..., 2] - across
    rays = np.stack([(col - c_x) / f_x, (c_y - row) / f_y, -np.ones(row.shape)], axis=-1)
    facing = -(normals * rays).sum(-1)
    return f_x * facing, f_y * facing


def one_sided(mask: NDArray[np.bool_], g: Array, shift: tuple[int, int], sign: float) -> sparse.csr_matrix:
    """``g`` times the difference to a neighbour, in the direction in which the axis grows; an empty row without one."""
    number = np.full(np.add(mask.shape, 2), -1)
    number[1:-1, 1:-1][mask] = np.arange(mask.sum())
    rows, cols = np.nonzero(mask)
    other = number[rows + 1 + shift[0], cols + 1 + shift[1]]
    here, there = np.flatnonzero(other >= 0), other[other >= 0]
    values = sign * g[mask][here]
    size = int(mask.sum())
    at = (np.concatenate([here, here]), np.concatenate([there, here]))
    return sparse.csr_matrix((np.concatenate([values, -values]), at), (size, size))


def integrate(
    normals: Array,
    mask: NDArray[np.bool_],
    matrix_px: Array | None = None,
    *,
    k: float = 2.0,
    tol: float = 1e-4,
    inner_tolerance: float = 1e-10,
    rounds: int = 150,
    published: bool = False,
) -> tuple[Array, list[float], int]:
    """Return height (NaN outside the mask), energies, and the iterations of the inner solver."""
    g_x, g_y = slants(normals, matrix_px, published=published)
    steps = [
        one_sided(mask, g, shift, sign)
        for g, shift, sign in ((g_x, (0, 1), 1.0), (g_x, (0, -1), -1.0), (g_y, (-1, 0), 1.0), (g_y, (1, 0), -1.0))
    ]
    n = [normals[..., axis][mask] for axis in (0, 0, 1, 1)]
    shares = [np.full(len(n[0]), 0.5)] * 4
    z = np.zeros(len(n[0]))
    energies: list[float] = []
    inner = 0

    def count(_: Array) -> None:
        nonlocal inner
        inner += 1

    while len(energies) < rounds:
        matrix = sum(step.T @ sparse.diags(share) @ step for step, share in zip(steps, shares, strict=True)).tocsr()
        right = -sum(step.T @ (share * part) for step, share, part in zip(steps, shares, n, strict=True))
        diagonal = matrix.diagonal()
        jacobi = sparse.diags(1.0 / np.where(diagonal > 0, diagonal, 1.0))
        z, _ = cg(matrix, right, x0=z, M=jacobi, rtol=inner_tolerance, maxiter=20_000, callback=count)
        right_, left, up, down = (step @ z for step in steps)
        shares = []
        for ahead, behind in ((right_, left), (up, down)):
            share = 1.0 / (1.0 + np.exp(-np.clip(k * (behind**2 - ahead**2), -MAX_ARGUMENT, MAX_ARGUMENT)))
            shares += [share, 1.0 - share]
        parts = zip(steps, shares, n, strict=True)
        energies.append(float(sum((share * (step @ z + part) ** 2).sum() for step, share, part in parts)))
        if len(energies) > 1 and abs(energies[-1] - energies[-2]) < tol * energies[-2]:
            break
    height = np.full(mask.shape, np.nan)
    height[mask] = z - z.mean()
    return height, energies, inner
