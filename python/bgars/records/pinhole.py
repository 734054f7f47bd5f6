"""A pinhole camera."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bgars.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["Pinhole"]

MATRIX_SHAPE = (3, 3)


@dataclass(frozen=True, eq=False, init=False)
class Pinhole:
    """A pinhole camera without distortion or skew.

    Parameters
    ----------
    matrix_px : (3, 3) array_like
        ``[[f_x, 0, c_x], [0, f_y, c_y], [0, 0, 1]]`` in pixels; the centre of the first pixel is at column 0, row 0,
        and rows count downward, as in OpenCV.

    Raises
    ------
    InputError
        Another shape, numbers that are not finite, focal lengths not above 0, skew, or another last row.

    Examples
    --------
    >>> Pinhole([[3772.0, 0, 305.9], [0, 3759.0, 255.1], [0, 0, 1]]).numbers_px
    (3772.0, 3759.0, 305.9, 255.1)
    """

    matrix_px: NDArray[np.float64]

    def __init__(self, matrix_px: ArrayLike) -> None:
        try:
            matrix = np.array(matrix_px, dtype=np.float64)
        except (TypeError, ValueError) as error:
            msg = f"camera: must be a (3, 3) matrix of numbers ({error})"
            raise InputError(msg) from error
        if matrix.shape != MATRIX_SHAPE or not np.isfinite(matrix).all():
            msg = f"camera: must be a finite (3, 3) matrix, got shape {matrix.shape}"
            raise InputError(msg)
        if matrix[0, 0] <= 0 or matrix[1, 1] <= 0:
            msg = f"camera: focal lengths must be above 0, got {matrix[0, 0]:g} and {matrix[1, 1]:g}"
            raise InputError(msg)
        if matrix[0, 1] != 0 or matrix[1, 0] != 0 or matrix[2].tolist() != [0, 0, 1]:
            msg = f"camera: must be [[f_x, 0, c_x], [0, f_y, c_y], [0, 0, 1]] (no skew), got {matrix.tolist()}"
            raise InputError(msg)
        matrix.setflags(write=False)
        object.__setattr__(self, "matrix_px", matrix)

    @property
    def numbers_px(self) -> tuple[float, float, float, float]:
        """``f_x, f_y, c_x, c_y``."""
        (f_x, _, c_x), (_, f_y, c_y), _ = self.matrix_px.tolist()
        return f_x, f_y, c_x, c_y
