"""The same least squares for the peers: the matrix that bgars never stores, and Poisson's equation by cosines."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy.fft
import scipy.sparse

if TYPE_CHECKING:
    from normal_fields import Field
    from numpy.typing import NDArray

MIN_N_Z = 1e-3


class System(NamedTuple):
    """`matrix @ heights = right` over the pixels of the mask, row by row."""

    matrix: scipy.sparse.csr_matrix
    right: NDArray[np.float64]


def assemble(field: Field) -> System:
    """Normal equations of the steps between neighbours.

    Every edge asks ``n_z dz = -n_x`` (along x) or ``n_z dz = n_y`` (down a column, y grows upward) of the mean normal
    of its two pixels: weight n_z^2, as in rust/bgars-core/src/integrate/operator.rs.
    """
    normals, mask = field.normals.astype(np.float64), field.mask
    number = np.full(mask.shape, -1, dtype=np.int32)
    count = int(mask.sum())
    number[mask] = np.arange(count, dtype=np.int32)
    firsts, seconds, weights, pushes = [], [], [], []
    for axis, component, sign in ((1, 0, -1.0), (0, 1, 1.0)):
        first = (slice(None), slice(None, -1)) if axis else (slice(None, -1), slice(None))
        second = (slice(None), slice(1, None)) if axis else (slice(1, None), slice(None))
        edge = mask[first] & mask[second]
        mean = 0.5 * (normals[first] + normals[second])[edge]
        n_z = np.maximum(mean[:, 2], MIN_N_Z)
        firsts.append(number[first][edge])
        seconds.append(number[second][edge])
        weights.append(n_z * n_z)
        pushes.append(sign * n_z * mean[:, component])
    a, b, weight, push = (np.concatenate(parts) for parts in (firsts, seconds, weights, pushes))
    ends, others = np.concatenate([a, b]), np.concatenate([b, a])
    both = np.concatenate([weight, weight])
    neighbours = scipy.sparse.coo_matrix((-both, (ends, others)), shape=(count, count)).tocsr()
    diagonal = np.bincount(ends, weights=both, minlength=count)
    right = np.bincount(b, weights=push, minlength=count) - np.bincount(a, weights=push, minlength=count)
    return System((neighbours + scipy.sparse.diags(diagonal)).tocsr(), right)


def divergence(normals: NDArray[np.float32]) -> NDArray[np.float64]:
    """Right side of Poisson's equation on the full image, all edges of weight 1, in float64."""
    n_x, n_y, n_z = (np.ascontiguousarray(normals[..., axis], dtype=np.float64) for axis in range(3))
    across = -(n_x[:, :-1] + n_x[:, 1:]) / (n_z[:, :-1] + n_z[:, 1:])
    down = (n_y[:-1] + n_y[1:]) / (n_z[:-1] + n_z[1:])
    right = np.zeros(n_z.shape)
    right[:, 1:] += across
    right[:, :-1] -= across
    right[1:] += down
    right[:-1] -= down
    return right


class CosineSolver:
    """Poisson's equation with free borders by the discrete cosine transform; eigenvalues are computed beforehand."""

    def __init__(self, side: int, workers: int) -> None:
        along = 2.0 - 2.0 * np.cos(np.pi * np.arange(side) / side)
        eigenvalues = along[:, None] + along
        eigenvalues[0, 0] = 1.0
        self._inverse = 1.0 / eigenvalues
        self._inverse[0, 0] = 0.0
        self._workers = workers

    def solve(self, right: NDArray[np.float64]) -> NDArray[np.float64]:
        """Heights of zero mean."""
        spectrum = scipy.fft.dctn(right, type=2, workers=self._workers)
        spectrum *= self._inverse
        return scipy.fft.idctn(spectrum, type=2, workers=self._workers, overwrite_x=True)
