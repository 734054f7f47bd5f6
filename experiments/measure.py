"""What one method makes of one capture: angular errors, height error, the height itself."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from bgars.normals.methods import METHODS
from bgars.pipelines.evaluate import angular_error_deg
from bgars.pipelines.normals import estimate_normals
from bgars.surface.integrate import integrate_normals

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bgars.normals.methods import Method
    from bgars.records.capture import Capture
    from bgars.records.pixels import FloatArray
    from bgars.simulate import SimulatedTruth
    from numpy.typing import NDArray

    from experiments.setting import Setting

__all__ = ["COLUMNS", "FILTER", "NAIVE", "Measurement", "filled_normals", "measure", "measure_all", "profile_px"]

NAIVE: Method = "lambertian"
FILTER: Method = "specular-filter"
COLUMNS = (
    "method",
    "i_d",
    "i_s",
    "hardness",
    "elevation_deg",
    "mean_deg_nz03",
    "median_deg_nz03",
    "p95_deg_nz03",
    "mean_deg_nz01",
    "height_rmse_px",
    "measured_percent_nz03",
)
"""Of every CSV with errors; nz03: over the pixels whose true n_z is above 0.3, nz01: above 0.1."""


@dataclass(frozen=True, eq=False)
class Measurement:
    """Errors of a method on a capture.

    Attributes
    ----------
    method : str
        Estimator.
    setting : Setting
        Of the capture.
    mean_deg_nz03, median_deg_nz03, p95_deg_nz03 : float
        Angular error over hemisphere pixels with true n_z > 0.3; a pixel without a solution counts as (0, 0, 1).
    mean_deg_nz01 : float
        The same mean over n_z > 0.1.
    height_rmse_px : float
        Root mean square height error over all hemisphere pixels, the mean difference removed.
    measured_percent_nz03 : float
        Share of the hemisphere pixels with true n_z > 0.3 whose own light fixes the normal.
    unsolved : int
        Hemisphere pixels without a solution.
    height_px : (H, W) float32
        Integrated height of the hemisphere, least height 0; NaN elsewhere.
    """

    method: str
    setting: Setting
    mean_deg_nz03: float
    median_deg_nz03: float
    p95_deg_nz03: float
    mean_deg_nz01: float
    height_rmse_px: float
    measured_percent_nz03: float
    unsolved: int
    height_px: FloatArray

    @property
    def row(self) -> dict[str, str | float]:
        """The columns of :data:`COLUMNS`."""
        return {name: getattr(self if hasattr(self, name) else self.setting, name) for name in COLUMNS}

    @property
    def profile_px(self) -> FloatArray:
        """(W,) heights of the row through the centre, least height 0."""
        return profile_px(self.height_px)

    @property
    def rise_px(self) -> float:
        """Height of the highest pixel above the lowest."""
        return float(np.nanmax(self.height_px))


def measure(
    capture: Capture,
    truth: SimulatedTruth,
    setting: Setting,
    *,
    method: Method,
    threshold: float | None = None,
) -> Measurement:
    """Estimate and integrate the normals of a hemisphere, and compare both with the truth.

    The normals are integrated over the whole silhouette of the hemisphere (its label in the truth) by the default
    integrator; a pixel without a solution takes part as (0, 0, 1), as it does in the angular errors, so that every
    method is judged over the same pixels.
    """
    field = estimate_normals(capture, method=method, threshold=threshold)
    error_deg = angular_error_deg(field.normals, truth.normals)
    n_z = truth.normals[..., 2]
    judged = error_deg[truth.mask & (n_z > 0.3)]  # noqa: PLR2004 - the column's name says it
    wider = error_deg[truth.mask & (n_z > 0.1)]  # noqa: PLR2004
    height_px = integrate_normals(filled_normals(field.normals), mask=truth.mask).height_px
    difference_px = (height_px - truth.height_px)[truth.mask].astype(np.float64)
    return Measurement(
        method=method,
        setting=setting,
        mean_deg_nz03=float(judged.mean()),
        median_deg_nz03=float(np.median(judged)),
        p95_deg_nz03=float(np.percentile(judged, 95)),
        mean_deg_nz01=float(wider.mean()),
        height_rmse_px=float(difference_px.std()),
        measured_percent_nz03=100.0 * float(field.is_measured[truth.mask & (n_z > 0.3)].mean()),  # noqa: PLR2004
        unsolved=int((truth.mask & ~field.mask).sum()),
        height_px=height_px - np.nanmin(height_px),
    )


def measure_all(setting: Setting, radius_px: int, methods: Sequence[Method] = METHODS) -> list[Measurement]:
    """Every method on one capture."""
    capture, truth = setting.photograph(radius_px)
    return [measure(capture, truth, setting, method=method) for method in methods]


def profile_px(height_px: FloatArray) -> FloatArray:
    """The row through the image centre, brought to a minimum of 0."""
    row_px = height_px[height_px.shape[0] // 2]
    lowered: FloatArray = row_px - np.nanmin(row_px)
    return lowered


def filled_normals(normals: FloatArray) -> FloatArray:
    """(H, W, 3) normals with (0, 0, 1) where there is no solution."""
    filled: NDArray[np.float32] = np.where(np.isfinite(normals), normals, np.array([0.0, 0.0, 1.0], np.float32))
    return filled
