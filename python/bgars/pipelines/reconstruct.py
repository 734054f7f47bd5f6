"""The main job: capture -> normals -> height -> mesh, joined here and nowhere else."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from bgars.normals.methods import DEFAULT_METHOD, Method
from bgars.normals.noise_floor import without_background
from bgars.pipelines.check import checked_beside, tell_before
from bgars.pipelines.normals import estimate_normals
from bgars.records.circle_pixels import inside_circles
from bgars.records.scalar_checks import check_progress, thread_count
from bgars.records.whole_capture import need_whole
from bgars.surface.flatten import Bow, Flatten, find_bow, flattened
from bgars.surface.integrate import Difference, integrate_normals
from bgars.surface.mesh import check_faces, mesh_from_height, mesh_size

if TYPE_CHECKING:
    from collections.abc import Callable

    import trimesh

    from bgars.pipelines.check import Tell
    from bgars.records.capture import Capture
    from bgars.records.height_map import HeightMap
    from bgars.records.normal_field import NormalField
    from bgars.records.reflectance_fit import ReflectanceFit
    from bgars.records.surface_material import SurfaceMaterial

__all__ = ["Reconstruction", "reconstruct", "reconstructed", "solver_fraction", "summarise_field", "summarise_fit"]

Stage = Literal["normals", "height"]


@dataclass(frozen=True, eq=False)
class Reconstruction:
    """What the main job makes of a capture: one record per stage.

    Attributes
    ----------
    capture : Capture
    field : NormalField
    height : HeightMap
    mesh : trimesh.Trimesh
        Made when it is first asked for; :func:`bgars.write_mesh` writes PLY and OBJ from `height` and `field` alone.
    bow : Bow or None
        A bow of the whole part that the lights may have caused (before its removal).
    """

    capture: Capture
    field: NormalField
    height: HeightMap
    bow: Bow | None = None

    @cached_property
    def mesh(self) -> trimesh.Trimesh:
        """The surface as triangles."""
        return mesh_from_height(self.height, self.field)

    def summary(self) -> dict[str, Any]:
        """Return the scalars of every stage as plain Python values, for JSON."""
        vertices, faces = mesh_size(self.height)
        return {
            "capture": self.capture.name,
            "lights": len(self.capture.rig),
            "image_size_px": [int(self.capture.images.shape[2]), int(self.capture.images.shape[1])],
            "pixel_pitch_um": self.capture.pixel_pitch_um,
            "normals": summarise_field(self.field),
            "height": {**self.height.summary(), "bow": None if self.bow is None else str(self.bow)},
            "mesh": {"vertices": vertices, "faces": faces},
        }


def summarise_field(field: NormalField) -> dict[str, Any]:
    """Return the scalars of a normal field as plain Python values."""
    valid = int(field.mask.sum())
    return {
        "method": field.method,
        "method_reason": field.method_reason,
        "choice": field.method_reason,  # its old name, for one release
        "valid_pixels": valid,
        "measured_share": float((field.is_measured & field.mask).sum() / valid) if valid else 0.0,
        "measured_share_on_balls": _share_on_balls(field),
        "mean_confidence": float(field.confidence[field.mask].mean()) if field.mask.any() else 0.0,
        "mean_lights_kept": float(field.lights_kept[field.mask].mean()) if field.mask.any() else 0.0,
        "reflectance": None if field.reflectance is None else summarise_fit(field.reflectance),
    }


def _share_on_balls(field: NormalField) -> float | None:
    """Share of the valid normals on balls that are measured; None where no balls are known."""
    fit = field.reflectance
    if fit is None or not fit.accepted or not fit.circles_px:
        return None
    on_balls = field.mask & inside_circles(fit.circles_px, field.mask.shape)
    return float((field.is_measured & on_balls).sum() / on_balls.sum()) if on_balls.any() else None


def summarise_fit(fit: ReflectanceFit) -> dict[str, Any]:
    """Return a material and how it was fitted as plain Python values."""
    return {
        "accepted": fit.accepted,
        "loss": fit.loss,
        "balls": len(fit.circles_px),
        "own_material": sum(fit.own_material),
        "residuals_learnt": fit.residuals_learnt,
        "material": asdict(fit.material),
    }


def reconstruct(
    capture: Capture,
    *,
    method: Method = DEFAULT_METHOD,
    threshold: float | None = None,
    material: SurfaceMaterial | None = None,
    difference: Difference = "trapezoid",
    weights: Literal["confidence"] | None = None,
    flatten: Flatten | None = None,
    check: bool = True,
    threads: int | None = None,
    progress: Callable[[Stage, float], object] | None = None,
) -> Reconstruction:
    """Turn a capture into normals, a height map and a mesh.

    Parameters
    ----------
    capture : Capture
        From :func:`bgars.read_capture`.
    method, threshold, material
        See :func:`bgars.estimate_normals`.
    difference, weights
        See :func:`bgars.integrate_normals`.
    flatten : {"plane", "quadratic"}, optional
        Subtract a plane, or a quadratic surface: the bow that near or wrong lights cause on a flat part.
    check : bool
        Look first whether the images show what the capture says (:func:`bgars.check`): wrong geometry is refused, and
        what else is found is a :class:`~bgars.CaptureWarning`.
    threads : int, optional
        Largest number of threads; see :func:`bgars.estimate_normals`.
    progress : callable, optional
        Called with (stage, fraction done of that stage); the solver's fraction is logarithmic in its residual.

    Raises
    ------
    InputError
        See the stages; lights in wrong order, mirrored or below the surface, an image twice or turned, a dead lamp
        (`check`).
    ConvergenceError
        The integration did not reach its tolerance.

    Examples
    --------
    >>> import bgars
    >>> result = bgars.reconstruct(bgars.read_capture(bgars.sample_capture()))
    >>> result.height.unit, len(result.height.components)
    ('um', 1)
    """
    return reconstructed(
        capture,
        tell=tell_before(capture, stacklevel=5) if check else None,
        method=method,
        threshold=threshold,
        material=material,
        difference=difference,
        weights=weights,
        flatten=flatten,
        threads=threads,
        progress=progress,
    )


def reconstructed(
    capture: Capture,
    *,
    tell: Tell | None,
    method: Method = DEFAULT_METHOD,
    threshold: float | None = None,
    material: SurfaceMaterial | None = None,
    difference: Difference = "trapezoid",
    weights: Literal["confidence"] | None = None,
    flatten: Flatten | None = None,
    threads: int | None = None,
    progress: Callable[[Stage, float], object] | None = None,
) -> Reconstruction:
    """Reconstruct a surface; its capture is checked while its normals are estimated, and `tell` says what was found."""
    check_progress(progress)
    threads = thread_count(threads)

    def report(stage: Stage, fraction: float) -> None:
        if progress is not None:
            progress(stage, fraction)

    need_whole(capture)
    report("normals", 0.0)
    estimate = partial(
        estimate_normals,
        capture,
        method=method,
        threshold=threshold,
        material=material,
        threads=threads,
        progress=lambda fraction: report("normals", fraction),
    )
    _, field = checked_beside(capture, tell, estimate, threads=threads)
    field = without_background(field, capture)
    report("normals", 1.0)
    height = integrate_normals(
        field,
        difference=difference,
        weights=weights,
        threads=threads,
        progress=lambda _, residual: report("height", solver_fraction(residual)),
    )
    report("height", 1.0)
    bow = find_bow(height) if flatten != "quadratic" else None
    if flatten is not None:
        height = flattened(height, flatten)
    check_faces(*mesh_size(height))
    return Reconstruction(capture, field, height, bow)


def solver_fraction(residual: float, tolerance: float = 1e-8) -> float:
    """How far a residual has come on its way from 1 to the tolerance, on a log scale."""
    return float(np.clip(np.log(max(residual, tolerance)) / np.log(tolerance), 0.0, 1.0))
