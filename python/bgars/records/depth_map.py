"""Depths under a pinhole camera."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bgars.records.bilateral_fit import BilateralFit
from bgars.records.component import Component
from bgars.records.pinhole import Pinhole
from bgars.records.plain_arrays import plain_fields
from bgars.records.short import Short

__all__ = ["DepthMap"]


@dataclass(frozen=True, eq=False, repr=False)
class DepthMap(Short):
    """Depths under a pinhole camera, up to one factor per connected component.

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
