"""Height from normals (the Rust solver, with plain arguments)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, get_args

import numpy as np

from bgars import _bgars
from bgars.errors import InputError
from bgars.records import Component, HeightMap, NormalField

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike

    from bgars.records import BoolArray, FloatArray

__all__ = ["DIFFERENCES", "Difference", "IntegrationMethod", "integrate_normals"]

Difference = Literal["trapezoid", "forward"]
DIFFERENCES: tuple[Difference, ...] = get_args(Difference)
IntegrationMethod = Literal["least-squares"]
NORMALS_NDIM = 3


def integrate_normals(
    normals: NormalField | ArrayLike,
    *,
    mask: ArrayLike | None = None,
    method: IntegrationMethod = "least-squares",
    difference: Difference = "trapezoid",
    weights: Literal["confidence"] | ArrayLike | None = None,
    relative_tolerance: float = 1e-8,
    absolute_tolerance: float = 1e-12,
    max_iters: int = 2_000,
    pixel_pitch_um: float | None = None,
    threads: int | None = None,
    progress: Callable[[int, float], object] | None = None,
) -> HeightMap:
    """Integrate normals to heights by weighted least squares.

    Minimises the sum over neighbouring pixels of ``(n_z dz + n_x)^2`` along x and ``(n_z dz + n_y)^2`` along y (up), by
    conjugate gradient on the normal equations, preconditioned by multigrid: about 8 iterations whatever the size.
    **What this cannot give**: heights across an occluding contour. Between a ball and its board the surface jumps where
    no pixel sees it, so the stand-off height is not in the normals, and parts that do not touch (components) each float
    freely.

    Parameters
    ----------
    normals : NormalField or (H, W, 3) array_like
        Unit normals, x right, y up, z toward the camera. A C-contiguous float32 array is used where it lies; others are
        copied once.
    mask : (H, W) array_like of bool, optional
        True = use; combined with the field's own mask. For plain arrays: by default every finite normal with n_z > 0.
    method : {"least-squares"}
        Integrator.
    difference : {"trapezoid", "forward"}
        Slope between two pixels: mean of their normals, or the first pixel's alone as the paper prints it (this
        shifts the surface by half a pixel).
    weights : "confidence" or (H, W) array_like, optional
        Trust in each pixel, at least 0; an edge takes the geometric mean of its two. n_z^2 is always a weight.
    relative_tolerance, absolute_tolerance : float
        Stop at a residual of this times the right side, or of this a pixel (root mean square, pixels).
    max_iters : int
        Most iterations. Masks of narrow winding corridors may need hundreds; all others, ten to twenty.
    pixel_pitch_um : float, optional
        Size of a pixel; a field brings its own.
    threads : int, optional
        Most threads to work on; by default what the environment variable ``RAYON_NUM_THREADS`` says, else one a core.
        The result does not depend on it.
    progress : callable, optional
        Called with (iteration, relative residual), at most ten times a second.

    Returns
    -------
    HeightMap
        Zero mean in each connected component.

    Raises
    ------
    InputError
        Shapes that do not fit, an empty mask, normals inside the mask that are not finite or face away.
    ConvergenceError
        `max_iters` reached; carries iterations and residual.

    References
    ----------
    B. K. P. Horn and M. J. Brooks, "The variational approach to shape from shading", CVGIP 33 (1986).
    Y. Quéau, J.-D. Durou, J.-F. Aujol, "Normal integration: a survey", J. Math. Imaging Vis. 60 (2018).

    Examples
    --------
    >>> import bgars, numpy as np
    >>> normals = np.tile(np.float32([-0.6, 0.0, 0.8]), (2, 3, 1))  # rises by 3/4 pixel a column
    >>> bgars.integrate_normals(normals).height_px[0].round(4).tolist()
    [-0.75, 0.0, 0.75]
    """
    if method not in get_args(IntegrationMethod):
        msg = f"method: must be one of {', '.join(get_args(IntegrationMethod))}; got {method!r}"
        raise InputError(msg)
    if difference not in DIFFERENCES:
        msg = f"difference: must be one of {', '.join(DIFFERENCES)}; got {difference!r}"
        raise InputError(msg)
    if isinstance(normals, NormalField):
        vectors, valid = normals.normals, normals.mask
        pixel_pitch_um = normals.pixel_pitch_um if pixel_pitch_um is None else pixel_pitch_um
    else:
        vectors, valid = _normal_array(normals, mask)
    if pixel_pitch_um is not None and not (np.isfinite(pixel_pitch_um) and pixel_pitch_um > 0):
        msg = f"pixel_pitch_um: must be finite and above 0, got {pixel_pitch_um:g}"
        raise InputError(msg)
    use = np.ascontiguousarray(valid if mask is None else valid & _bool_mask(mask, valid.shape))
    height_px, labels, components, iterations, residual = _bgars.integrate_normals(
        np.ascontiguousarray(vectors),
        use,
        _edge_trust(normals, weights, use),
        difference=difference,
        relative_tolerance=relative_tolerance,
        absolute_tolerance=absolute_tolerance,
        max_iters=max_iters,
        threads=threads,
        progress=progress,
    )
    return HeightMap(
        height_px=height_px,
        mask=use,
        pixel_pitch_um=pixel_pitch_um,
        iterations=iterations,
        residual=residual,
        components=tuple(Component(*part) for part in components),
        labels=labels,
    )


def _normal_array(normals: ArrayLike, mask: ArrayLike | None) -> tuple[FloatArray, BoolArray]:
    vectors = np.asarray(normals, dtype=np.float32)
    if vectors.ndim != NORMALS_NDIM or vectors.shape[2] != NORMALS_NDIM:
        msg = f"normals: must have shape (H, W, 3), got {vectors.shape}"
        raise InputError(msg)
    if mask is not None:
        return vectors, np.ones(vectors.shape[:2], dtype=np.bool_)
    vectors = np.ascontiguousarray(vectors)
    return vectors, _bgars.usable_normals(vectors)


def _bool_mask(mask: ArrayLike, shape: tuple[int, ...]) -> BoolArray:
    given = np.asarray(mask)
    if given.dtype != np.bool_ or given.shape != shape:
        msg = f"mask: must be bool of shape {shape}, got {given.dtype} of shape {given.shape}"
        raise InputError(msg)
    return given


def _edge_trust(
    normals: NormalField | ArrayLike, weights: Literal["confidence"] | ArrayLike | None, use: BoolArray
) -> FloatArray | None:
    if weights is None:
        return None
    if isinstance(weights, str):
        if weights != "confidence" or not isinstance(normals, NormalField):
            msg = f"weights: must be an array of shape (H, W), or 'confidence' with a NormalField; got {weights!r}"
            raise InputError(msg)
        return np.ascontiguousarray(normals.confidence)
    trust = np.ascontiguousarray(weights, dtype=np.float32)
    if trust.shape != use.shape:
        msg = f"weights: must have shape {use.shape}, got {trust.shape}"
        raise InputError(msg)
    return trust
