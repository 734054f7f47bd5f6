"""Compare a method with known truth."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from bgars.errors import ConvergenceError, InputError
from bgars.io.truth import read_truth
from bgars.normals.given import GIVEN, given_field
from bgars.normals.methods import DEFAULT_METHOD, Method
from bgars.pipelines.normals import estimate_normals
from bgars.records.normal_field import NormalField
from bgars.records.plain_arrays import plain, without_mask
from bgars.records.renamed import renamed
from bgars.records.scalar_checks import check_progress
from bgars.records.short import Short
from bgars.records.whole_capture import need_whole
from bgars.surface.integrate import integrate_normals

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray

    from bgars.records.capture import Capture
    from bgars.records.pixels import BoolArray, FloatArray
    from bgars.records.surface_material import SurfaceMaterial
    from bgars.records.truth import Truth

__all__ = ["AngularErrors", "Evaluation", "angular_error_deg", "evaluate"]

MIN_N_Z = 0.3
"""Balls are judged where the true n_z is above this: nearer the rim a pixel mixes ball and board."""


@dataclass(frozen=True)
class AngularErrors:
    """Angular errors over some pixels, in degrees; pixels without a solution count as (0, 0, 1).

    Attributes
    ----------
    mean_deg, median_deg, p95_deg : float
        Mean, median, 95th percentile.
    pixels : int
        Number of pixels judged.
    invalid : int
        Those among them without a solution.
    """

    mean_deg: float
    median_deg: float
    p95_deg: float
    pixels: int
    invalid: int


@renamed(choice="method_reason")
@dataclass(frozen=True, repr=False)
class Evaluation(Short):
    """Result of :func:`evaluate`.

    Attributes
    ----------
    name, method : str
        Capture and estimator.
    region : str
        What was judged: "balls, n_z > 0.3" of a scene, "mask" of a photograph.
    method_reason : str
        What the estimator used, and why.
    normals : AngularErrors
        Over that region.
    measured : AngularErrors or None
        Over the measured pixels of that region: those whose own light fixes the normal; None where there are none.
    coverage : float or None
        Share of the measured pixels whose error is within the stated standard error; 0.68 where that is right.
    board : AngularErrors or None
        Over the board of a scene.
    ball_height_rmse_um : float or None
        Root mean square height error over the judged ball pixels, each ball integrated alone with its mean height
        removed: no integrator knows the height across the jump between ball and board.
    """

    name: str
    method: str
    region: str
    method_reason: str
    normals: AngularErrors
    measured: AngularErrors | None
    coverage: float | None
    board: AngularErrors | None
    ball_height_rmse_um: float | None

    def _facts(self) -> dict[str, object]:
        facts: dict[str, object] = {"name": repr(self.name), "method": repr(self.method), "region": repr(self.region)}
        errors = {"normals": self.normals, "measured": self.measured, "board": self.board}
        facts |= {name: f"{each.mean_deg:.4g} deg mean" for name, each in errors.items() if each is not None}
        height = self.ball_height_rmse_um
        return facts if height is None else facts | {"ball_height_rmse_um": f"{height:.4g}"}

    def to_dict(self) -> dict[str, Any]:
        """Return plain Python values, for JSON."""
        return asdict(self) | {"choice": self.method_reason}  # its old name too, for one release


def evaluate(
    capture: Capture,
    *,
    method: Method | Callable[[Capture], NormalField | ArrayLike] | NormalField | ArrayLike = DEFAULT_METHOD,
    material: SurfaceMaterial | None = None,
    truth: Truth | None = None,
    progress: Callable[[float], object] | None = None,
) -> Evaluation:
    """Run a method on a capture that has truth and report its errors.

    Parameters
    ----------
    capture : Capture
        From :func:`bgars.read_capture`.
    method : str, callable, NormalField or (H, W, 3) floating
        A name, see :func:`bgars.estimate_normals`; or a function that is given the capture and returns normals; or
        the normals themselves, as those of another program (:func:`bgars.read_normal_map`). Arrays are made unit
        length; NaN and zero vectors have no solution, and nothing is said of what in them is measured.
    material : SurfaceMaterial, optional
        Fitted before, for the method ``reflectance``.
    truth : Truth, optional
        By default read from the capture's folder.
    progress : callable, optional
        Called with the fraction done.

    Raises
    ------
    FileFormatError
        The folder has no truth.
    InputError
        Truth, images and given normals differ in size.

    Examples
    --------
    >>> import bgars
    >>> capture = bgars.read_capture(bgars.sample_capture())
    >>> own = bgars.evaluate(capture, method=lambda capture: bgars.read_truth(capture.folder).normals)
    >>> own.normals.mean_deg < 1e-3, own.measured is None
    (True, True)
    >>> errors = bgars.evaluate(bgars.read_capture(bgars.sample_capture()), method="lambertian").normals
    >>> round(errors.mean_deg, 1), errors.invalid
    (9.3, 0)
    """
    check_progress(progress)
    need_whole(capture)
    if truth is None:
        if capture.folder is None:
            msg = "truth: needed for a capture that was not read from a folder"
            raise InputError(msg)
        truth = read_truth(capture.folder)
    if truth.mask.shape != capture.mask.shape:
        msg = f"truth: has shape {truth.mask.shape}, but the images have {capture.mask.shape}"
        raise InputError(msg)
    if isinstance(method, str):
        field = estimate_normals(capture, method=method, material=material, progress=progress)
    else:
        name = getattr(method, "__name__", "given") if callable(method) else "given"
        field = given_field(method(capture) if callable(method) else method, capture, name)
    is_own = field.method_reason != GIVEN
    judged = truth.mask & capture.mask
    board = None
    if truth.ball_ids is not None:
        judged = judged & (truth.normals[..., 2] > MIN_N_Z)
        board = _errors(field, truth.normals, (truth.ball_ids == 0) & capture.mask)
    errors = _errors(field, truth.normals, judged)
    if errors is None:
        msg = f"{capture.name}: no pixel to judge: truth and mask do not overlap"
        raise InputError(msg)
    return Evaluation(
        name=capture.name,
        method=field.method,
        region=f"balls, n_z > {MIN_N_Z}" if truth.ball_ids is not None else "mask",
        method_reason=field.method_reason,
        normals=errors,
        measured=_errors(field, truth.normals, judged & field.is_measured) if is_own else None,
        coverage=_coverage(field, truth.normals, judged & field.is_measured) if is_own else None,
        board=board,
        ball_height_rmse_um=_ball_height_rmse_um(field, truth, judged),
    )


def angular_error_deg(estimate: FloatArray, truth: FloatArray) -> NDArray[np.float64]:
    """Angle between two arrays of vectors (..., 3), degrees, accurate for small angles too.

    Where `estimate` has no normal (NaN, masked, or a vector of 0) it counts as (0, 0, 1); where `truth` has none, the
    error is NaN.

    Raises
    ------
    InputError
        Arrays that are not numbers, or whose shapes do not fit each other or do not end in 3.

    Examples
    --------
    >>> import numpy as np
    >>> angular_error_deg(np.float32([[0, 0.6, 0.8]]), np.float32([[0, 0, 1]])).round(2).tolist()
    [36.87]
    """
    given, is_given = _vectors("estimate", estimate)
    known, is_known = _vectors("truth", truth)
    try:
        np.broadcast_shapes(given.shape, known.shape)
    except ValueError:
        msg = f"estimate and truth: must have shapes that fit, got {given.shape} and {known.shape}"
        raise InputError(msg) from None
    filled = np.where(is_given[..., np.newaxis], given, [0.0, 0.0, 1.0])
    sine = np.linalg.norm(np.cross(filled, known), axis=-1)
    cosine = (filled * known).sum(axis=-1)
    degrees: NDArray[np.float64] = np.where(is_known, np.degrees(np.arctan2(sine, cosine)), np.nan)
    return degrees


def _vectors(name: str, values: ArrayLike) -> tuple[NDArray[np.float64], BoolArray]:
    """Plain vectors (..., 3), and which of them are normals."""
    vectors = plain(name, without_mask(values, np.nan), np.float64)
    if vectors.shape[-1:] != (3,):
        msg = f"{name}: must have shape (..., 3), got {vectors.shape}"
        raise InputError(msg)
    return vectors, np.isfinite(vectors).all(axis=-1) & (vectors != 0.0).any(axis=-1)


def _errors(field: NormalField, truth: FloatArray, judged: BoolArray) -> AngularErrors | None:
    if not judged.any():
        return None
    error_deg = angular_error_deg(field.normals[judged], truth[judged])
    return AngularErrors(
        mean_deg=float(error_deg.mean()),
        median_deg=float(np.median(error_deg)),
        p95_deg=float(np.percentile(error_deg, 95)),
        pixels=int(judged.sum()),
        invalid=int((~field.mask[judged]).sum()),
    )


def _coverage(field: NormalField, truth: FloatArray, judged: BoolArray) -> float | None:
    """Share of errors within the stated standard error."""
    if not judged.any():
        return None
    within = angular_error_deg(field.normals[judged], truth[judged]) <= field.standard_error_deg[judged]
    return float(within.mean())


def _ball_height_rmse_um(field: NormalField, truth: Truth, judged: BoolArray) -> float | None:
    pitch = field.pixel_pitch_um
    if truth.height_um is None or truth.ball_ids is None or pitch is None:
        return None
    judged = judged & (field.normals[..., 2] > 0.0)  # of an estimator that lets some face away
    if not (field.mask & judged).any():
        return None
    try:
        height = integrate_normals(field, mask=judged)
    except ConvergenceError:
        return None
    # Balls do not touch, so components are balls; a stray pixel that lost its neighbours is its own component.
    labels = height.labels[height.mask]
    error_um = height.height_px[height.mask].astype(np.float64) * pitch - truth.height_um[height.mask]
    counts = np.bincount(labels)
    means = np.bincount(labels, weights=error_um) / counts
    return float(np.sqrt(np.mean((error_um - means[labels]) ** 2)))
