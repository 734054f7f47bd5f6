"""Normals from a light stack: the public function, which joins least squares, the ball finder and reflectance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from bgars import _bgars
from bgars.balls import find_balls
from bgars.errors import InputError
from bgars.files.counted import counted
from bgars.normals.given import given_field, within
from bgars.normals.methods import DEFAULT_METHOD, TABLE, Method, added_method
from bgars.normals.pixelwise import PIXELWISE_METHODS, PixelwiseMethod, capture_of, combined_mask, pixelwise_normals
from bgars.normals.reflectance import add_reflectance
from bgars.records.circle_pixels import inside_circles
from bgars.records.found_balls import FoundBalls
from bgars.records.normal_field import NormalField
from bgars.records.plain_arrays import plain, plain_bool
from bgars.records.scalar_checks import check_progress, number, thread_count
from bgars.records.whole_capture import need_whole

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from bgars.records.capture import Capture
    from bgars.records.surface_material import SurfaceMaterial

__all__ = ["RUNNERS", "ball_normals", "estimate_normals"]

CIRCLE_VALUES = 3
RIM_PX = 0.01
BRIDGE_WIDTH = 0.8
"""Half width of the strip between two joined balls that is looked at, in radii of the smaller."""


def estimate_normals(
    images: Capture | ArrayLike,
    light_directions: ArrayLike | None = None,
    *,
    method: Method = DEFAULT_METHOD,
    mask: ArrayLike | None = None,
    light_intensities: ArrayLike | None = None,
    saturation: float | None = None,
    threshold: float | None = None,
    anchors: FoundBalls | ArrayLike | None = None,
    material: SurfaceMaterial | None = None,
    keep_sets: bool = False,
    out: NormalField | None = None,
    threads: int | None = None,
    progress: Callable[[float], object] | None = None,
) -> NormalField:
    """Estimate the surface normal of every pixel.

    Parameters
    ----------
    images : Capture or (L, H, W) array_like of uint8, uint16 or float32
        A capture, or one image per light. A C-contiguous array, read-only or not, is used where it lies; strided and
        Fortran-ordered ones (a crop, a transposed stack) and other types are copied once: (L, H, W, 3) as its
        luminance, whole numbers from 0 to 65535 as uint8 where none is above 255, else as uint16.
    light_directions : (L, 3) array_like
        Unit vectors from the surface to the light; only with plain arrays.
    method : {"reflectance", "robust-filter", "specular-filter", "lambertian", "blind"} or str
        ``reflectance``: on balls, the normal whose brightness under all lights, highlights included, fits the material
        best; the material is fitted on the balls themselves; other pixels are left to ``robust-filter``. Captures with
        fewer than 4 lights, or with neither balls nor a material, are left to ``blind``: one material is fitted to the
        whole capture together with normals and albedo of every pixel, and taken where it predicts left-out lights about
        as well as the simpler methods (some 20 us per pixel; at least 5 lights). `NormalField.method_reason` says what
        was done. The other three solve ``I_k = rho l_k . n`` by least squares (Woodham 1980) over the lights they keep
        at a pixel: ``lambertian`` all; ``specular-filter``, as published: sort the values, cut at the first gap over
        `threshold` with at least 3 values kept; ``robust-filter`` the window of sorted values that a Lambertian facet
        explains best (docs/method.md). Further names: :func:`bgars.register_method`.
    mask : (H, W) array_like of bool, optional
        True = use; combined with the capture's own mask.
    light_intensities : (L,) array_like, optional
        Relative intensities, divided out; only with plain arrays.
    saturation : float, optional
        Grey level that counts as clipped; only with plain arrays. Full scale of an integer dtype by default, none for
        floats.
    threshold : float, optional
        Gap of ``specular-filter`` in grey levels of 255, scaled with the bit depth; 50, as published, by default.
    anchors : FoundBalls, (N, 3) array_like, or (H, W) array_like of bool, optional
        Balls for ``reflectance``: from :func:`bgars.find_balls`, or circles (x right and y up from the image centre,
        radius, in pixels), or the mask of one ball. By default they are searched for.
    material : SurfaceMaterial, optional
        Material for ``reflectance`` that was fitted before, with the same rig and exposure
        (:func:`bgars.read_material`). Without balls every pixel is then taken to be of it.
    keep_sets : bool
        Also return which lights were kept: `NormalField.kept_sets`, (H, W, L) bool.
    out : NormalField, optional
        Result of an earlier call on images of the same size, to be overwritten and returned. After an error in the
        pixels, or an interruption, its content means nothing.
    threads : int, optional
        Largest number of threads; by default the environment variable ``RAYON_NUM_THREADS``, else one per core.
        The result does not depend on it.
    progress : callable, optional
        Called with the fraction done, at most ten times a second, and with 1 at the end.

    Returns
    -------
    NormalField
        A pixel whose kept lights are coplanar or nearly so (27 det / tr^3 of ``L^T L`` below 1e-6), whose solution is
        zero or faces away from the camera is invalid: NaN, mask False. A ball's pixel whose light alone does not fix
        the normal to 2 degrees is drawn to the sphere of its circle: `is_measured` is False there.

    Raises
    ------
    InputError
        Counts or shapes that do not fit, fewer than 3 or coplanar lights, an empty mask, NaN inside the mask; anchors,
        a material or a threshold with a method that uses none.

    References
    ----------
    R. J. Woodham, "Photometric method for determining surface orientation from multiple images", Opt. Eng. 19 (1980).
    R. L. Cook, K. E. Torrance, "A reflectance model for computer graphics", ACM Trans. Graph. 1 (1982).

    Examples
    --------
    >>> import bgars, numpy as np
    >>> rig = bgars.LightRig.ring(4)
    >>> images = np.full((4, 1, 1), 100, np.uint8)  # one pixel, equally bright under all lights: it faces the camera
    >>> float(bgars.estimate_normals(images, rig.directions).normals[0, 0, 2])
    1.0
    """
    check_progress(progress)
    threads = thread_count(threads)
    is_own = isinstance(method, str) and method in RUNNERS
    run = RUNNERS[method] if is_own else added_method(method)
    if is_own:
        _refuse_idle(method, {"threshold": threshold, "anchors": anchors, "material": material})
    threshold = None if threshold is None else number("threshold", threshold)
    saturation = None if saturation is None else number("saturation", saturation)
    capture = capture_of(images, light_directions, light_intensities, saturation)
    need_whole(capture)
    use = combined_mask(capture, mask)
    options = {
        **{"mask": use, "threshold": threshold, "anchors": anchors, "material": material},
        **{"keep_sets": keep_sets or None, "out": out, "threads": threads, "progress": progress},
    }
    found = run(capture, **{name: value for name, value in options.items() if value is not None})
    if progress is not None:
        progress(1.0)
    return found if is_own else within(replace(given_field(found, capture, method), method=method), use)


def ball_normals(
    capture: Capture,
    found: FoundBalls,
    mask: NDArray[np.bool_],
    *,
    wanted: NDArray[np.bool_] | None,
    method: Method,
    material: SurfaceMaterial | None,
    threads: int | None,
) -> NormalField:
    """Normals of balls by a method; of ``reflectance``, which learns from all pixels of `mask`, only those wanted."""
    if method != "reflectance":
        return estimate_normals(capture, method=method, mask=mask, threads=threads)
    use = combined_mask(capture, mask)
    return _by_reflectance(capture, mask=use, wanted=wanted, anchors=found, material=material, threads=threads)


def _refuse_idle(method: Method, given: dict[str, object]) -> None:
    """Raise InputError where an option is given that the method has no use for."""
    for option, value in given.items():
        if value is not None and option not in TABLE[method].options:
            users = [name for name, entry in TABLE.items() if option in entry.options]
            msg = f"{option}: only the method {' or '.join(users)} uses it, got method {method!r}"
            raise InputError(msg)


def _by_reflectance(
    capture: Capture,
    *,
    mask: NDArray[np.bool_] | None = None,
    wanted: NDArray[np.bool_] | None = None,
    anchors: FoundBalls | ArrayLike | None = None,
    material: SurfaceMaterial | None = None,
    keep_sets: bool = False,
    out: NormalField | None = None,
    threads: int | None = None,
    progress: Callable[[float], object] | None = None,
) -> NormalField:
    """Method ``reflectance`` where it can work, else what stands in for it."""
    use = mask

    def part(start: float, end: float) -> Callable[[float], object] | None:
        if progress is None:
            return None
        return lambda fraction: progress(start + (end - start) * fraction)

    def pixelwise(
        name: PixelwiseMethod,
        share: tuple[float, float] = (0.0, 1.0),
        pixels: NDArray[np.bool_] | None = use,
        *,
        fills: bool = False,
    ) -> NormalField:
        return pixelwise_normals(
            capture,
            method=name,
            mask=pixels,
            keep_sets=keep_sets,
            out=out,
            fills=fills,
            threads=threads,
            progress=part(*share),
        )

    lights = len(capture.rig)
    fallback: PixelwiseMethod = "blind" if lights >= _bgars.BLIND_MIN_LIGHTS else "robust-filter"
    least = _bgars.REFLECTANCE_MIN_LIGHTS
    if lights < least:
        return _because(pixelwise(fallback), f"reflectance needs {least} lights, the capture has {lights}")
    given = "found" if anchors is None else "given"
    found = anchors if anchors is not None else find_balls(capture, threads=threads, progress=part(0.0, 0.3))
    circles_px = _circles(found, capture.mask.shape)
    if not len(circles_px) and material is None:
        return _because(pixelwise(fallback, (0.3, 1.0)), f"no balls {given} to fit a material on, and none given")
    free = _free_pixels(found, capture.mask.shape) if len(circles_px) else np.ones(capture.mask.shape, np.bool_)
    field = add_reflectance(
        pixelwise("robust-filter", (0.3, 0.5), _outside(circles_px, use, capture.mask.shape), fills=True),
        capture,
        circles_px,
        mask=use,
        free=free,
        wanted=wanted,
        material=material,
        threads=threads,
        progress=part(0.5, 1.0),
    )
    balls = len(circles_px)
    source = "given" if material is not None else f"fitted on {counted(balls, 'ball')} {given}"
    fit = field.reflectance
    if fit is not None and not fit.accepted:
        reason = f"the material {source} does not explain the balls: {fit.refusal}"
        return replace(_because(pixelwise(fallback, (0.5, 1.0)), reason), reflectance=fit)
    where = "on balls, robust-filter elsewhere" if balls else "where it explains the pixel, robust-filter elsewhere"
    shape = "" if fit is None else fit.shape_in_words
    checked = f"loss {0.0 if fit is None else fit.loss:.3f}" if balls else "no balls to check it by"
    return replace(field, method_reason=f"reflectance {where}: material {source}{shape}, {checked}")


RUNNERS: dict[Method, Callable[..., Any]] = {
    **{name: partial(pixelwise_normals, method=name) for name in PIXELWISE_METHODS},
    "reflectance": _by_reflectance,
}
"""Of each method of the table the function: called with the capture and, by name, with the options that were given."""


def _because(field: NormalField, reason: str) -> NormalField:
    """The field with the reason why its method stands in for reflectance."""
    return replace(field, method_reason=f"{field.method_reason.removesuffix(', as asked')}; {reason}")


def _circles(anchors: FoundBalls | ArrayLike, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """(N, 4): x right, y up, radius of each anchor and standard uncertainty of the radius, in pixels."""
    if isinstance(anchors, FoundBalls):
        circles = [(ball.x_px, ball.y_px, ball.radius_px, ball.u_radius_px) for ball in anchors.balls]
        return np.array(circles, np.float64).reshape(-1, CIRCLE_VALUES + 1)
    given = plain("anchors", anchors)
    if given.dtype == np.bool_:
        given = plain_bool("anchors", given)
        if given.shape != shape or not given.any():
            msg = (
                f"anchors: a mask of one ball must have shape {shape} and pixels, got {given.shape}, {given.sum()} True"
            )
            raise InputError(msg)
        rows, cols = np.nonzero(given)
        centre = (cols.mean() + 0.5 - shape[1] / 2, shape[0] / 2 - rows.mean() - 0.5)
        return _exact([[*centre, np.sqrt(given.sum() / np.pi)]])
    if given.shape[1:] != (CIRCLE_VALUES,) or given.dtype.kind not in "fiu":
        msg = f"anchors: must be balls, circles of shape (N, 3) or a mask of one ball, got {given.dtype} {given.shape}"
        raise InputError(msg)
    if not (np.isfinite(given).all() and (given[:, 2] > 0).all()):
        msg = "anchors: circles must be finite, with radii above 0 px"
        raise InputError(msg)
    return _exact(given)


def _exact(circles_px: ArrayLike) -> NDArray[np.float64]:
    """Circles without uncertainty."""
    return np.pad(np.asarray(circles_px, np.float64), ((0, 0), (0, 1)))


def _outside(
    circles_px: NDArray[np.float64], use: NDArray[np.bool_] | None, shape: tuple[int, ...]
) -> NDArray[np.bool_] | None:
    """The pixels to use outside all circles, or all of them where none is outside."""
    # A little smaller, so that no pixel at a rim falls between both methods.
    outside = ~inside_circles(((x, y, radius - RIM_PX) for x, y, radius in circles_px[:, :3]), shape)
    if use is not None:
        outside &= use
    return outside if outside.any() else use


def _free_pixels(anchors: FoundBalls | ArrayLike, shape: tuple[int, ...]) -> NDArray[np.bool_] | None:
    """Strips between joined balls; None without any."""
    if not isinstance(anchors, FoundBalls) or not anchors.bridges:
        return None
    balls = {ball.name: ball for ball in anchors.balls}
    height, width = shape
    x_px = np.arange(width) + 0.5 - width / 2
    y_px = (height / 2 - np.arange(height) - 0.5)[:, None]
    free = np.zeros(shape, np.bool_)
    for first, second in anchors.bridges:
        one, other = balls[first], balls[second]
        dx, dy = other.x_px - one.x_px, other.y_px - one.y_px
        length = max(np.hypot(dx, dy), 1e-9)
        along = ((x_px - one.x_px) * dx + (y_px - one.y_px) * dy) / length
        across = ((x_px - one.x_px) * dy - (y_px - one.y_px) * dx) / length
        half_width = BRIDGE_WIDTH * min(one.radius_px, other.radius_px)
        free |= (along > 0) & (along < length) & (np.abs(across) < half_width)
    return free
