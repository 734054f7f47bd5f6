"""Whether balls are spheres of a material or something else: the method that predicts lights it was not shown."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from bgars import _bgars
from bgars.records.circle_pixels import inside_circles
from bgars.records.kernel_capture import kernel_capture

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from bgars.records.capture import Capture

__all__ = ["Contest", "contest"]

ABSORBED = 0.45
"""A fit with a lobe, blind to circles, must predict at this share of the anchored cost to be believed.

Not 1: light that no model holds (the board and the neighbours, mirrored) is a smooth function of the light's direction,
some six independent values per pixel. A fit of three unknowns per pixel absorbs half of it, into wrong normals, and
then predicts it. Less than that by a tenth, for balls of unlike material come close to it.
"""
MATTE = 0.75
"""The same for a model without highlights: half way to 1, for it has no lobe to absorb with, only normals and albedos.

Dirt and texture of good balls look like albedo, and then it comes close to 1.
"""
CORE = 0.87
"""Part of a circle's radius that is compared; nearer the rim (n_z below 0.5) a mirror shows the board."""
SCALE = 0.02
BLACK_WEIGHT = 0.1
BLACK_NOISE = 2.0
"""Of the cost of a left-out light, as the blind fit has them (`rust/bgars-core/src/blind/observation.rs`)."""


class Contest(NamedTuple):
    """Mean cost of a left-out light: ``log(1 + (r / 2 %)^2)``, r relative to the pixel's mean value.

    Attributes
    ----------
    anchored : float
        Of the material that was fitted on circles.
    matte : float
        Of the better of least squares and the robust filter, which know no highlights.
    blind : float
        Of a material that was fitted without circles.
    """

    anchored: float
    matte: float
    blind: float

    @property
    def lost(self) -> bool:
        """Whether the circles are to be dropped: without them, light is predicted far better."""
        return self.matte < MATTE * self.anchored or self.blind < ABSORBED * self.anchored

    def __str__(self) -> str:
        """The costs in words."""
        return (
            f"mean cost of a light left out on the balls {self.anchored:.2f}, without circles {self.matte:.2f} "
            f"(no highlights, believed below {MATTE:g} times), "
            f"{self.blind:.2f} (fitted blind, believed below {ABSORBED:g} times)"
        )


def contest(
    capture: Capture,
    left_out: ArrayLike,
    circles_px: NDArray[np.float64],
    *,
    mask: NDArray[np.bool_] | None,
    threads: int | None,
) -> Contest | None:
    """Compare the anchored material with the methods that need no circles; None where there is nothing to compare.

    Parameters
    ----------
    left_out : (N, 3) array_like
        Of each light left out, in grey levels of 255: predicted less seen, seen, mean of the pixel.
    circles_px : (B, 4) float64
        Circles as of :func:`bgars.normals.reflectance.add_reflectance`.
    """
    rows = np.asarray(left_out, np.float64).reshape(-1, 3)
    core = inside_circles(((x, y, CORE * radius) for x, y, radius in circles_px[:, :3]), capture.mask.shape)
    if mask is not None:
        core &= mask
    if not len(rows) or not core.any():
        return None
    found = _bgars.predict_left_out(kernel_capture(capture), mask=np.ascontiguousarray(core), threads=threads)
    if found is None:
        return None
    lambertian, robust_filter, blind, noise_levels = found
    difference, value, mean = rows.T
    ratio = difference / (SCALE * np.hypot(mean, noise_levels / SCALE))
    share = np.where(value <= BLACK_NOISE * noise_levels, BLACK_WEIGHT, 1.0)
    return Contest(float((share * np.log1p(ratio**2)).mean()), min(lambertian, robust_filter), blind)
