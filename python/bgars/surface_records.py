"""What bilateral integration and anchoring take and tell: a camera, known heights, weights of jumps."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bgars.errors import InputError
from bgars.plain_arrays import plain_fields

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["Anchors", "BilateralFit", "Component", "DepthMap", "Pinhole"]

MATRIX_SHAPE = (3, 3)
MAX_REGION = 2**31 - 1


@dataclass(frozen=True)
class Component:
    """One connected part of a height map; without an anchor its mean is 0, its height against other parts unknown.

    Attributes
    ----------
    pixels : int
        Number of pixels.
    first_row, first_col : int
        Its first pixel in reading order.
    anchor_pixels : int
        Known heights that hold it; 0: it floats freely.
    anchor_rms_px : float
        How far it passes from them, root mean square; NaN without any.
    """

    pixels: int
    first_row: int
    first_col: int
    anchor_pixels: int = 0
    anchor_rms_px: float = math.nan


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


@dataclass(frozen=True, eq=False)
class BilateralFit:
    """Where a bilateral integration saw jumps, and how it came to rest.

    Attributes
    ----------
    rightward, upward : (H, W) float32
        Share in [0, 1] that the difference to the right (upward) has in a pixel's equation; the opposite difference has
        the rest. 1/2 = smooth; near 0 the surface jumps on the right (upper) side, near 1 on the other. NaN outside the
        mask.
    energies : (N,) float64
        Energy after each re-weighting.
    converged : bool
        False where `max_iters` ended it while the energy still moved; the surface is the last one.
    k : float
        Sharpness of the sigmoid.
    solver : {"converged", "compatible"}
    """

    rightward: NDArray[np.float32]
    upward: NDArray[np.float32]
    energies: NDArray[np.float64]
    converged: bool
    k: float
    solver: str

    def jumps(self, least: float = 0.9) -> NDArray[np.bool_]:
        """(H, W) True where one side of a pixel has at least this share: the pixels along a jump."""
        with np.errstate(invalid="ignore"):
            lopsided: NDArray[np.bool_] = np.maximum(abs(self.rightward - 0.5), abs(self.upward - 0.5)) >= least - 0.5
        return lopsided


@dataclass(frozen=True, eq=False)
class DepthMap:
    """Depths under a pinhole camera, up to one factor a connected component.

    Attributes
    ----------
    depth : (H, W) float32
        Distance from the camera's plane, above 0, of geometric mean 1 in each component; NaN outside the mask.
    mask : (H, W) bool
        True where there is a depth.
    camera : Pinhole
        The camera.
    iterations, residual, components, labels
        As in :class:`HeightMap`.
    bilateral : BilateralFit
        Jumps and energies.
    """

    depth: NDArray[np.float32]
    mask: NDArray[np.bool_]
    camera: Pinhole
    iterations: int
    residual: float
    components: tuple[Component, ...]
    labels: NDArray[np.int32]
    bilateral: BilateralFit = field(repr=False)

    def __post_init__(self) -> None:
        """Bring the arrays into the layout of the kernels."""
        plain_fields(self, {"depth": np.float32, "mask": np.bool_, "labels": np.int32})


@dataclass(frozen=True, eq=False)
class Anchors:
    """Heights that are known from elsewhere, for parts of a surface that float freely.

    Anchors move a whole component up or down; only in regions with a reach do they bend it.

    Attributes
    ----------
    height_um : (H, W) floating
        Known height, NaN where none is known.
    weights : (H, W) floating or None
        Trust in each, at least 0; None: all alike.
    regions : (H, W) integer or None
        Pixels of different numbers are not joined, so that each region floats until its anchors hold it: for instance 0
        for the board and one number per ball, whose silhouettes are jumps.
    reach_px : mapping of int to float
        Regions (0 where there are no regions) in which anchors bend the surface, and over which distance, the standard
        deviation of a Gaussian: what is longer follows the anchors, what is shorter the normals.
    """

    height_um: NDArray[np.floating]
    weights: NDArray[np.floating] | None = None
    regions: NDArray[np.integer] | None = None
    reach_px: Mapping[int, float] = field(default_factory=dict)

    def check(self, shape: tuple[int, ...]) -> None:
        """Raise InputError unless all are arrays of this shape, something is known, and weights are at least 0."""
        given: dict[str, object] = {"height_um": self.height_um, "weights": self.weights, "regions": self.regions}
        for name, values in given.items():
            if values is not None and not isinstance(values, np.ndarray):
                msg = f"anchors.{name}: must be an array, got {type(values).__name__}"
                raise InputError(msg)
            if isinstance(values, np.ma.MaskedArray):
                msg = f"anchors.{name}: is a numpy masked array; fill it (heights that are not known are NaN)"
                raise InputError(msg)
            if isinstance(values, np.ndarray) and values.shape != shape:
                msg = f"anchors.{name}: must have the shape of the normals {shape}, got {values.shape}"
                raise InputError(msg)
        if self.regions is not None and not np.issubdtype(self.regions.dtype, np.integer):
            msg = f"anchors.regions: must be integers, got {self.regions.dtype}"
            raise InputError(msg)
        if self.regions is not None and abs(self.regions.astype(np.float64)).max(initial=0) > MAX_REGION:
            msg = f"anchors.regions: must be from -{MAX_REGION} to {MAX_REGION}"
            raise InputError(msg)
        if np.isinf(self.height_um).any():
            msg = "anchors.height_um: must be finite, or NaN where no height is known; got infinity"
            raise InputError(msg)
        if not np.isfinite(self.height_um).any():
            msg = "anchors.height_um: no height is known (all NaN)"
            raise InputError(msg)
        if self.weights is not None and not (np.isfinite(self.weights).all() and (self.weights >= 0).all()):
            msg = "anchors.weights: must be finite and at least 0"
            raise InputError(msg)
        reach: object = self.reach_px
        if not isinstance(reach, Mapping):
            msg = f"anchors.reach_px: must be a mapping of region to distance, got {type(reach).__name__}"
            raise InputError(msg)
        for region, reach_px in self.reach_px.items():
            if not (np.isfinite(reach_px) and reach_px > 0):
                msg = f"anchors.reach_px: must be finite and above 0, got {reach_px:g} for region {region}"
                raise InputError(msg)
