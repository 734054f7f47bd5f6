"""What a capture should give, where that is known."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bgars.records.plain_arrays import plain_fields
from bgars.records.short import Short

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Truth"]


@dataclass(frozen=True, eq=False, repr=False)
class Truth(Short):
    """What a capture should give.

    Attributes
    ----------
    normals : (H, W, 3) float32
        True unit normals; NaN where unknown.
    ball_ids : (H, W) int16 or None
        0 board, 1.. balls, -1 bridge; None for a photograph of something else.
    mask : (H, W) bool
        Pixels to judge: the balls of a scene, the object of a photograph.
    height_um : (H, W) float32 or None
        True height.
    """

    normals: NDArray[np.float32]
    ball_ids: NDArray[np.int16] | None
    mask: NDArray[np.bool_]
    height_um: NDArray[np.float32] | None

    def __post_init__(self) -> None:
        """Bring the arrays into C order; numpy masked ones are refused."""
        plain_fields(self, {"normals": None, "ball_ids": None, "mask": np.bool_, "height_um": None})
