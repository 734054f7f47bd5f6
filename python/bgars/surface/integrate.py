"""Height from normals (the Rust solver, with plain arguments)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, TypedDict, get_args, overload

import numpy as np

from bgars import _bgars
from bgars.errors import InputError
from bgars.records.bilateral_fit import BilateralFit
from bgars.records.component import Component
from bgars.records.depth_map import DepthMap
from bgars.records.height_map import HeightMap
from bgars.records.normal_field import NormalField
from bgars.records.scalar_checks import check_pitch, check_progress, number, thread_count
from bgars.surface.anchoring import anchored
from bgars.surface.integration_inputs import (
    anchor_regions,
    check_camera,
    check_others,
    count,
    edge_trust,
    normal_array,
    used_pixels,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike
    from typing_extensions import Unpack

    from bgars.records.anchors import Anchors
    from bgars.records.pinhole import Pinhole

__all__ = ["DIFFERENCES", "Difference", "IntegrationMethod", "Solver", "integrate_normals"]

Difference = Literal["trapezoid", "forward"]
DIFFERENCES: tuple[Difference, ...] = get_args(Difference)
IntegrationMethod = Literal["least-squares", "bilateral"]
Solver = Literal["converged", "compatible"]
LEAST_SQUARES_ITERS, BILATERAL_ITERS = 2_000, 150

if TYPE_CHECKING:

    class _Options(TypedDict, total=False):
        """Everything but the camera, which alone decides what comes back."""

        mask: ArrayLike | None
        method: IntegrationMethod
        difference: Difference
        weights: Literal["confidence"] | ArrayLike | None
        relative_tolerance: float
        absolute_tolerance: float
        max_iters: int | None
        k: float
        tol: float
        solver: Solver
        anchors: Anchors | None
        pixel_pitch_um: float | None
        threads: int | None
        progress: Callable[[int, float], object] | None


@overload
def integrate_normals(
    normals: NormalField | ArrayLike, *, camera: None = None, **options: Unpack[_Options]
) -> HeightMap: ...
@overload
def integrate_normals(
    normals: NormalField | ArrayLike, *, camera: Pinhole, **options: Unpack[_Options]
) -> DepthMap: ...
def integrate_normals(
    normals: NormalField | ArrayLike,
    *,
    mask: ArrayLike | None = None,
    method: IntegrationMethod = "least-squares",
    difference: Difference = "trapezoid",
    weights: Literal["confidence"] | ArrayLike | None = None,
    relative_tolerance: float = 1e-8,
    absolute_tolerance: float = 1e-12,
    max_iters: int | None = None,
    k: float = 2.0,
    tol: float = 1e-4,
    solver: Solver = "converged",
    camera: Pinhole | None = None,
    anchors: Anchors | None = None,
    pixel_pitch_um: float | None = None,
    threads: int | None = None,
    progress: Callable[[int, float], object] | None = None,
) -> HeightMap | DepthMap:
    """Integrate normals to heights, by least squares or with jumps (bilateral).

    **Least squares** minimises the sum over neighbouring pixels of ``(n_z dz + n_x)^2`` along x and ``(n_z dz +
    n_y)^2`` along y (up), by conjugate gradient on the normal equations, preconditioned by multigrid: about 8
    iterations whatever the size. A jump inside the mask is smeared over everything around it.

    **Bilateral** weighs the differences to the two sides of each pixel by how well the surface follows them, solves,
    and weighs again: a jump stays a jump, at ten to a hundred times the cost. On a surface without jumps least squares
    is the better choice: its edges take the mean of two normals, while a one-sided difference is of first order.

    **What neither can give**: heights across an occluding contour. Between a ball and its board the surface jumps where
    no pixel sees it, so the stand-off height is not in the normals: with both methods it is arbitrary.
    `anchors` cut the surface there and put its parts where other evidence says.

    Parameters
    ----------
    normals : NormalField or (H, W, 3) array_like
        Unit normals (a length of 0.5 to 2 is accepted), x right, y up, z toward the camera. An aligned, C-contiguous
        float32 array is used where it lies; others are copied once.
    mask : (H, W) array_like of bool, optional
        True = use; combined with the field's own mask. For plain arrays: by default every finite normal with n_z > 0.
    method : {"least-squares", "bilateral"}
        Integrator.
    difference : {"trapezoid", "forward"}
        Least squares: slope between two pixels, the mean of their normals, or the first pixel's alone as the paper
        prints it (this shifts the surface by half a pixel).
    weights : "confidence" or (H, W) array_like, optional
        Trust in each pixel, at least 0, of which only the ratios count; an edge of least squares takes the geometric
        mean of its two, and pixels of weight 0 are left out of its mask. n_z^2 is always a weight.
    relative_tolerance, absolute_tolerance : float
        Least squares: stop at a residual of this times the right side, or of this a pixel (root mean square, pixels).
    max_iters : int, optional
        Least squares: most iterations, by default 2000 (masks of narrow winding corridors may need hundreds, all others
        ten to twenty). Bilateral: most re-weightings, by default 150; where it is reached the result says ``converged =
        False``.
    k : float
        Bilateral: sharpness; at 0 both sides count alike, and at 2 a step of one pixel more on one side is a jump.
    tol : float
        Bilateral: stop when the energy changes by less than this times itself.
    solver : {"converged", "compatible"}
        Bilateral: every system solved by multigrid to 1e-6, or the published iteration, Jacobi-preconditioned conjugate
        gradient to 1e-3. Stopped that early, jumps depend on how far the solver happened to come. Under a camera whose
        two focal lengths differ, "compatible" also takes the published approximation for it.
    camera : Pinhole, optional
        Bilateral: perspective; the result is then a :class:`DepthMap`.
    anchors : Anchors, optional
        Known heights and cuts; needs a pixel pitch.
    pixel_pitch_um : float, optional
        Size of a pixel; a field brings its own.
    threads : int, optional
        Largest number of threads; by default the environment variable ``RAYON_NUM_THREADS``, else one per core.
        The result does not depend on it.
    progress : callable, optional
        Called with (iteration, relative residual), for bilateral with (re-weightings, relative change of the energy),
        at most ten times a second.

    Returns
    -------
    HeightMap or DepthMap
        Zero mean in each connected component without an anchor. Under a camera, depths of geometric mean 1.

    Raises
    ------
    InputError
        Shapes that do not fit, an empty mask, normals inside the mask that are not finite, face away or are no unit
        vectors, arguments that the method does not have.
    ConvergenceError
        Least squares: not solved within its iterations; carries iterations and residual. A bilateral system that is not
        leaves ``converged = False`` and its `residual`.

    References
    ----------
    B. K. P. Horn and M. J. Brooks, "The variational approach to shape from shading", CVGIP 33 (1986).
    Y. Quéau, J.-D. Durou, J.-F. Aujol, "Normal integration: a survey", J. Math. Imaging Vis. 60 (2018).
    X. Cao, H. Santo, B. Shi, F. Okura, Y. Matsushita, "Bilateral normal integration", ECCV 2022.

    Examples
    --------
    >>> import bgars, numpy as np
    >>> normals = np.tile(np.float32([-0.6, 0.0, 0.8]), (2, 3, 1))  # rises by 3/4 pixel a column
    >>> np.diff(bgars.integrate_normals(normals).height_px[0]).round(4).tolist()
    [0.75, 0.75]
    >>> np.diff(bgars.integrate_normals(normals, method="bilateral").height_px[0]).round(2).tolist()
    [0.75, 0.75]
    """
    check_progress(progress)
    threads = thread_count(threads)
    for name, value, allowed in (
        ("method", method, get_args(IntegrationMethod)),
        ("difference", difference, DIFFERENCES),
        ("solver", solver, get_args(Solver)),
    ):
        if value not in allowed:
            msg = f"{name}: must be one of {', '.join(allowed)}; got {value!r}"
            raise InputError(msg)
    least_squares = {
        "difference": difference,
        "relative_tolerance": number("relative_tolerance", relative_tolerance),
        "absolute_tolerance": number("absolute_tolerance", absolute_tolerance),
    }
    bilateral = {"k": number("k", k), "tol": number("tol", tol), "solver": solver}
    own, others = (bilateral, least_squares) if method == "bilateral" else (least_squares, bilateral)
    check_others(method, others, own)
    iters = count("max_iters", max_iters, BILATERAL_ITERS if method == "bilateral" else LEAST_SQUARES_ITERS)
    check_camera(camera, method, anchors)
    if isinstance(normals, NormalField):
        vectors, valid = normals.normals, normals.mask
        pixel_pitch_um = normals.pixel_pitch_um if pixel_pitch_um is None else pixel_pitch_um
    else:
        vectors, valid = normal_array(normals, mask, threads)
    check_pitch(pixel_pitch_um)
    use = used_pixels(valid, mask)
    trust = edge_trust(normals, weights, use)
    regions = anchor_regions(anchors, use.shape)
    arrays = (vectors, use, trust, regions)
    common: dict[str, Any] = {"max_iters": iters, "threads": threads, "progress": progress}
    if method == "least-squares":
        height_px, labels = np.zeros(use.shape, np.float32), np.zeros(use.shape, np.int32)
        parts, iterations, residual = _bgars.integrate_normals(
            *arrays,
            height_px=height_px,
            labels=labels,
            difference=difference,
            relative_tolerance=relative_tolerance,
            absolute_tolerance=absolute_tolerance,
            **common,
        )
        components = tuple(Component(*part) for part in parts)
        use = use if trust is None else labels >= 0
        found: dict[str, Any] = {"mask": use, "iterations": iterations, "residual": residual, "labels": labels}
    else:
        surface = _bgars.integrate_bilateral(
            *arrays,
            camera=None if camera is None else camera.numbers_px,
            k=k,
            tolerance=tol,
            setting=solver,
            **common,
        )
        height_px, labels = surface["height"], surface["labels"]
        components = tuple(Component(*part) for part in surface["components"])
        found = {
            "mask": use,
            "iterations": surface["inner_iterations"],
            "residual": surface["residual"],
            "labels": labels,
            "bilateral": BilateralFit(
                rightward=surface["rightward"],
                upward=surface["upward"],
                energies=np.array(surface["energies"]),
                converged=surface["converged"],
                k=k,
                solver=solver,
            ),
        }
    if camera is not None:
        return DepthMap(depth=np.exp(-height_px), camera=camera, components=components, **found)
    if anchors is not None:
        height_px, components = anchored(height_px, labels, components, anchors, pixel_pitch_um)
    return HeightMap(height_px=height_px, pixel_pitch_um=pixel_pitch_um, components=components, **found)
