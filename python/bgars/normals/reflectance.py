"""Normals by reflectance: the highlights are information, once the material is known."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bgars import _bgars
from bgars.normals.choice import contest
from bgars.normals.kernel_outputs import kernel_view
from bgars.records.kernel_capture import kernel_capture
from bgars.records.reflectance_fit import ReflectanceFit
from bgars.records.surface_material import SurfaceLobe, SurfaceMaterial

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from bgars.records.capture import Capture
    from bgars.records.normal_field import NormalField

__all__ = ["add_reflectance"]


def add_reflectance(
    field: NormalField,
    capture: Capture,
    circles_px: NDArray[np.float64],
    *,
    mask: NDArray[np.bool_] | None,
    free: NDArray[np.bool_] | None = None,
    wanted: NDArray[np.bool_] | None = None,
    material: SurfaceMaterial | None = None,
    threads: int | None = None,
    progress: Callable[[float], object] | None = None,
) -> NormalField:
    """Replace the normals of balls in a field by those of the reflectance estimator; the arrays are overwritten.

    Parameters
    ----------
    field : NormalField
        Another method's estimate; its other pixels stay.
    capture : Capture
        At least 4 lights.
    circles_px : (N, 4) float64
        Silhouettes of balls: x right, y up (origin at the image centre), radius, standard uncertainty of the radius.
    mask : (H, W) bool or None
        Pixels to use.
    free : (H, W) bool, optional
        Pixels that may be of the same material without a known shape, such as a bridge; kept where it explains them.
    wanted : (H, W) bool, optional
        Pixels, of those to use, whose normals are wanted; by default all.
    material : SurfaceMaterial, optional
        A material that was fitted before; by default it is fitted to the balls.
    threads, progress
        See :func:`bgars.estimate_normals`.

    Returns
    -------
    NormalField
        With `reflectance`; where the fit was not accepted, its normals on balls mean nothing.
    """
    found = _bgars.estimate_reflectance(
        kernel_capture(capture),
        mask=mask,
        circles=np.ascontiguousarray(circles_px, np.float64),
        free=None if free is None else np.ascontiguousarray(free),
        wanted=wanted,
        material=material,
        threads=threads,
        progress=progress,
        out=kernel_view(field),
    )
    fitted = material or SurfaceMaterial(
        diffuse_level=found["diffuse_level"],
        grazing=found["grazing"],
        ambient_level=found["ambient_level"],
        lobes=tuple(SurfaceLobe(*lobe) for lobe in found["lobes"]),
        masking=found["masking"],
        gains=tuple(found["gains"]),
        standard_errors={name: error for name, error in found["standard_errors"] or () if error > 0},
    )
    shape, ratio, u_ratio = found["shape"]
    most = _bgars.REFLECTANCE_MAX_LOSS
    refusal = "" if found["accepted"] else f"loss {found['loss']:.2f}, at most {most:g} is accepted"
    compared = contest(capture, found["left_out"], circles_px, mask=mask, threads=threads)
    if compared is not None and compared.lost:
        refusal = str(compared)
    fit = ReflectanceFit(
        material=fitted,
        loss=found["loss"],
        accepted=not refusal,
        circles_px=tuple((float(x), float(y), float(radius)) for x, y, radius in circles_px[:, :3]),
        own_material=tuple(found["own_material"]),
        residuals_learnt=found["residuals_learnt"],
        deviation_deg=tuple(found["deviation_deg"]),
        flat_radius=tuple(found["flat_radius"]),
        shape=shape,
        shape_ratio=ratio,
        u_shape_ratio=u_ratio,
        refusal=refusal,
    )
    return replace(field, method="reflectance" if fit.accepted else field.method, reflectance=fit)
