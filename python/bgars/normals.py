"""Normals from a light stack (the Rust kernels, with plain arguments)."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from bgars import _bgars
from bgars.errors import InputError
from bgars.records import Capture, NormalField, float_full_scale, integer_full_scale
from bgars.rig import LightRig

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray

    from bgars.records import PixelArray

__all__ = ["DEFAULT_METHOD", "FILTERS", "METHODS", "Method", "estimate_normals"]

Method = Literal["lambertian", "specular-filter", "robust-filter", "blind"]
METHODS: tuple[Method, ...] = get_args(Method)
FILTERS: tuple[Method, ...] = ("lambertian", "specular-filter", "robust-filter")
"""The methods that are least squares on chosen lights: those of the published experiments."""
DEFAULT_METHOD: Method = "robust-filter"
DEFAULT_THRESHOLD = 50.0
STACK_NDIM = 3


def estimate_normals(
    images: Capture | ArrayLike,
    light_directions: ArrayLike | None = None,
    *,
    method: Method = DEFAULT_METHOD,
    mask: ArrayLike | None = None,
    light_intensities: ArrayLike | None = None,
    saturation: float | None = None,
    threshold: float = DEFAULT_THRESHOLD,
    keep_sets: bool = False,
    out: NormalField | None = None,
    threads: int | None = None,
    progress: Callable[[float], object] | None = None,
) -> NormalField:
    """Estimate the surface normal of every pixel.

    Every method but ``blind`` solves ``I_k = rho l_k . n`` by least squares over the lights it keeps at a pixel
    (Woodham 1980); they differ in which lights they keep.

    Parameters
    ----------
    images : Capture or (L, H, W) array_like of uint8, uint16 or float32
        A capture, or one image a light. A C-contiguous array, read-only or not, is used where it lies; strided and
        Fortran-ordered ones (a crop, a transposed stack) and float64 are copied once.
    light_directions : (L, 3) array_like
        Unit vectors from the surface to the light; only with plain arrays.
    method : {"lambertian", "specular-filter", "robust-filter", "blind"}
        ``lambertian`` keeps every light. ``specular-filter`` is the published filter: sort the values, cut at the
        first gap over `threshold` with at least 3 values kept. ``robust-filter`` keeps the window of sorted values
        that a Lambertian facet explains best, shadows and highlights left out (docs/method.md). ``blind`` fits a
        diffuse part with one specular lobe to the whole capture, together with normals and albedo of every pixel, and
        takes it where it predicts left-out lights better than ``lambertian`` and ``robust-filter``, one of these
        elsewhere; `NormalField.choice` says which and why. It needs 5 lights.
    mask : (H, W) array_like of bool, optional
        True = use; combined with the capture's own mask.
    light_intensities : (L,) array_like, optional
        Relative intensities, divided out; only with plain arrays.
    saturation : float, optional
        Grey level that counts as clipped; only with plain arrays. Full scale of an integer dtype by default, none for
        floats.
    threshold : float
        Gap of ``specular-filter`` in grey levels of 255; scaled with the bit depth.
    keep_sets : bool
        Also return which lights were kept: `NormalField.kept_sets`, (H, W, L) bool.
    out : NormalField, optional
        Result of an earlier call on images of the same size, to be overwritten and returned: on a line that measures
        one part after the other, its memory is used again.
    threads : int, optional
        Most threads to work on; by default what the environment variable ``RAYON_NUM_THREADS`` says, else one a core.
        The result does not depend on it.
    progress : callable, optional
        Called with the fraction done, at most ten times a second; not at all where the work is done before that.

    Returns
    -------
    NormalField
        A pixel whose kept lights are coplanar or nearly so (27 det / tr^3 of ``L^T L`` below 1e-6), whose solution is
        zero or faces away from the camera is invalid: NaN, mask False.

    Raises
    ------
    InputError
        Counts or shapes that do not fit, fewer than 3 or coplanar lights, an empty mask, NaN inside the mask.

    References
    ----------
    R. J. Woodham, "Photometric method for determining surface orientation from multiple images", Opt. Eng. 19 (1980).

    Examples
    --------
    >>> import bgars, numpy as np
    >>> rig = bgars.LightRig.ring(4)
    >>> images = np.full((4, 1, 1), 100, np.uint8)  # one pixel, equally bright under all lights: it faces the camera
    >>> float(bgars.estimate_normals(images, rig.directions).normals[0, 0, 2])
    1.0
    """
    if method not in METHODS:
        msg = f"method: must be one of {', '.join(METHODS)}; got {method!r}"
        raise InputError(msg)
    if isinstance(images, Capture):
        for name, value in (
            ("light_directions", light_directions),
            ("light_intensities", light_intensities),
            ("saturation", saturation),
        ):
            if value is not None:
                msg = f"{name}: the capture brings its own; leave it out, or give plain arrays"
                raise InputError(msg)
        capture = images
    else:
        capture = _capture_from_arrays(images, light_directions, light_intensities, saturation)
    use = _combined_mask(capture, mask)
    field = _result(capture, method, keep_sets, out)
    choice = _bgars.estimate_normals(
        capture.images,
        **_light_arguments(capture),
        response=capture.response,
        dark=capture.dark,
        black_level=capture.black_level,
        saturation=capture.saturation,
        full_scale=capture.full_scale,
        mask=use,
        method=method,
        threshold=threshold,
        threads=threads,
        progress=progress,
        out=field,
    )
    return replace(field, choice=choice or "")


def _result(capture: Capture, method: Method, keep_sets: bool, out: NormalField | None) -> NormalField:
    """The arrays to be written: fresh ones, or those of an earlier result."""
    lights, height, width = capture.images.shape
    sets_shape = (height, width, lights) if keep_sets else None
    if out is None:
        normals, albedo, valid, confidence, measured, lights_kept, kept_sets = _bgars.normal_arrays(
            height, width, lights if keep_sets else 0
        )
        return NormalField(
            normals=normals,
            albedo=albedo,
            mask=valid,
            confidence=confidence,
            measured=measured,
            lights_kept=lights_kept,
            method=method,
            pixel_pitch_um=capture.pixel_pitch_um,
            kept_sets=kept_sets,
        )
    shape = out.normals.shape
    if shape != (height, width, 3):
        msg = f"out: must be the result for images of {width} x {height} pixels, got one for {shape[1]} x {shape[0]}"
        raise InputError(msg)
    if (None if out.kept_sets is None else out.kept_sets.shape) != sets_shape:
        msg = "out: must have kept sets, for the same number of lights, exactly when keep_sets is asked for"
        raise InputError(msg)
    return replace(out, method=method, pixel_pitch_um=capture.pixel_pitch_um)


def _capture_from_arrays(
    images: ArrayLike,
    light_directions: ArrayLike | None,
    light_intensities: ArrayLike | None,
    saturation: float | None,
) -> Capture:
    if light_directions is None:
        msg = "light_directions: needed with plain image arrays, shape (L, 3)"
        raise InputError(msg)
    stack = pixel_stack(images)
    rig = LightRig.from_directions(light_directions, intensities=light_intensities)
    if len(rig) != len(stack):
        msg = f"images and light_directions: {len(stack)} images but {len(rig)} lights; they must be equal in number"
        raise InputError(msg)
    full_scale = integer_full_scale(stack)
    if full_scale is not None:
        clip = full_scale if saturation is None else saturation
    else:
        full_scale = saturation or float_full_scale(stack)
        clip = float("inf") if saturation is None else saturation
    return Capture(
        images=stack,
        rig=rig,
        mask=np.broadcast_to(np.True_, stack.shape[1:]),
        saturation=clip,
        full_scale=full_scale,
    )


def pixel_stack(images: ArrayLike) -> PixelArray:
    """Return a C-contiguous (L, H, W) stack of a supported dtype, without a copy where possible."""
    stack = np.asarray(images)
    if stack.ndim != STACK_NDIM:
        msg = f"images: must have shape (L, H, W), got {stack.shape}"
        raise InputError(msg)
    if stack.dtype == np.float64:
        stack = stack.astype(np.float32)
    if stack.dtype not in (np.uint8, np.uint16, np.float32):
        msg = f"images: must be uint8, uint16 or float32, got {stack.dtype}"
        raise InputError(msg)
    return np.ascontiguousarray(stack)


def _combined_mask(capture: Capture, mask: ArrayLike | None) -> NDArray[np.bool_] | None:
    """The pixels to use; None for all of them."""
    if mask is None:
        if capture.mask.strides == (0, 0) and capture.mask[:1, :1].all():
            return None  # one True for all pixels, as captures without a mask have it
        return np.ascontiguousarray(capture.mask)
    given = np.asarray(mask)
    if given.dtype != np.bool_ or given.shape != capture.images.shape[1:]:
        expected = tuple(capture.images.shape[1:])
        msg = f"mask: must be bool of shape {expected}, got {given.dtype} of shape {given.shape}"
        raise InputError(msg)
    combined: NDArray[np.bool_] = np.ascontiguousarray(given & capture.mask)
    if not combined.any():
        msg = "mask: no pixel to use (all False)"
        raise InputError(msg)
    return combined


def _light_arguments(capture: Capture) -> dict[str, Any]:
    """The rig in the units of the kernel: unit vectors, or positions in pixels."""
    rig = capture.rig
    if rig.positions_um is None or rig.intensity_distance_um is None:
        return {
            "lights": rig.directions,
            "lights_are_positions": False,
            "reference_px": [],
            "intensities": rig.intensities.tolist(),
        }
    if capture.pixel_pitch_um is None:
        msg = "pixel_pitch_um: needed with near lights, to place pixels and lights together"
        raise InputError(msg)
    return {
        "lights": rig.positions_um / capture.pixel_pitch_um,
        "lights_are_positions": True,
        "reference_px": (rig.intensity_distance_um / capture.pixel_pitch_um).tolist(),
        "intensities": rig.intensities.tolist(),
    }
