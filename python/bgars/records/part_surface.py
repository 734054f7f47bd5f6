"""The surface of an inspected part as a small height map: what a page draws in three dimensions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from bgars.records.short import Short

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["PartSurface"]


@dataclass(frozen=True, eq=False, repr=False)
class PartSurface(Short):
    """Heights above the board at the centre of the image, from integrated normals held by known heights.

    Sample [i, j] of either map is pixel [step i, step j] of the images: x = (step j + 0.5 - W/2) p, y = (H/2 - step i
    - 0.5) p. NaN = nothing is known there: a ball without a measured height, the shadowed foot of a ball, and
    everything below an equator.

    Attributes
    ----------
    shape_px : (int, int)
        H and W of the images.
    pixel_pitch_um : float
        p.
    ball_step_px, board_step_px : int
        Distance of samples.
    ball_height_um : (h, w) float32
        Balls, each inside its own outline.
    ball_measured : (h, w) bool
        False where the normal is drawn from a prior (its ball's circle), and where nothing is known.
    board_height_um : (h', w') float32
        The board between the balls.
    """

    shape_px: tuple[int, int]
    pixel_pitch_um: float
    ball_step_px: int
    board_step_px: int
    ball_height_um: NDArray[np.float32]
    ball_measured: NDArray[np.bool_]
    board_height_um: NDArray[np.float32]
