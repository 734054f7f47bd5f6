"""Known heights for parts of a surface that float freely."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bgars.errors import InputError
from bgars.records.short import Short

__all__ = ["Anchors"]

MAX_REGION = 2**31 - 1


@dataclass(frozen=True, eq=False, repr=False)
class Anchors(Short):
    """Heights that are known from elsewhere, for parts of a surface whose absolute height normals do not give.

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
