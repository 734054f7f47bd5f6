"""Inspection: find the balls, measure them, judge the part; joined here and nowhere else."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from bgars.balls import find_balls
from bgars.errors import InputError
from bgars.inspection import measure_balls
from bgars.inspection.exposure import check_capture
from bgars.inspection.judge import judge_part
from bgars.io.material_file import read_material
from bgars.io.part_recipe import read_part_recipe
from bgars.io.provenance import capture_files, checksums
from bgars.normals.methods import DEFAULT_METHOD, Method
from bgars.pipelines.check import checked_beside, tell_before
from bgars.pipelines.normals import ball_normals, estimate_normals
from bgars.pipelines.part_surface import part_surface
from bgars.records.circle_pixels import inside_circles
from bgars.records.part_material import part_material
from bgars.records.part_recipe import PartRecipe
from bgars.records.scalar_checks import check_progress, thread_count
from bgars.records.whole_capture import need_whole
from bgars.version import __version__

if TYPE_CHECKING:
    from collections.abc import Callable
    from os import PathLike

    from bgars.pipelines.check import Tell
    from bgars.records.capture import Capture
    from bgars.records.found_balls import FoundBalls
    from bgars.records.measured_balls import BallMeasurement
    from bgars.records.normal_field import NormalField
    from bgars.records.part_result import PartResult
    from bgars.records.surface_material import SurfaceMaterial

__all__ = ["inspect", "inspected"]

InspectionStage = Literal["find", "measure", "judge", "surface"]
BOARD_STEP = 4
"""Every so many rows and columns of the board give it its first shape."""
TOPS = 0.84
"""Share of a ball's radius within which its normals are wanted: flat tops are looked for within 0.8."""
LAYOUT = "layout: "
"""What a complaint of the finder about a recipe begins with; its keys have the same names in the file."""
MATERIAL_UNUSED = "material.file of the recipe is not used by method {method}"


def inspect(
    capture: Capture,
    recipe: PartRecipe | str | PathLike[str] | None = None,
    *,
    method: Method = DEFAULT_METHOD,
    surface: bool = False,
    check: bool = True,
    threads: int | None = None,
    progress: Callable[[InspectionStage, float], object] | None = None,
) -> PartResult:
    """Find, measure and judge the solder balls of a part.

    Parameters
    ----------
    capture : Capture
        With a pixel pitch.
    recipe : PartRecipe or path, optional
        Layout and limits. Without one the lattice is inferred; missing, extra and bridged balls fail, and the rest is
        measured, but undecided: there is nothing to judge it by.
    method : str
        Estimator of the normals, which show flat tops; heights come from shadows.
    surface : bool
        Integrate the normals, too: ``result.surface`` is then the height map that :func:`bgars.write_report` draws. No
        reading depends on it.
    check : bool
        Look first whether the images show what the capture says (:func:`bgars.check`): wrong geometry is refused, and
        what else is found is a :class:`~bgars.CaptureWarning`, kept in ``result.warnings``.
    threads : int, optional
        Largest number of threads; the result does not depend on it.
    progress : callable, optional
        Called with (stage, fraction done of that stage).

    Returns
    -------
    PartResult
        It passes only when every ball that the recipe wants is there, measured, and inside its limits by more than
        the expanded uncertainty.

    Raises
    ------
    InputError
        No pixel pitch, a black or saturated image, a recipe that contradicts itself; lights in wrong order, mirrored
        or below the surface, an image twice or turned, a dead lamp (`check`).
    CalibrationError
        Images that do not show what the rig says.
    """
    return inspected(
        capture,
        recipe,
        tell=tell_before(capture, stacklevel=5) if check else None,
        method=method,
        surface=surface,
        threads=threads,
        progress=progress,
    )


def inspected(
    capture: Capture,
    recipe: PartRecipe | str | PathLike[str] | None,
    *,
    tell: Tell | None,
    method: Method = DEFAULT_METHOD,
    surface: bool = False,
    threads: int | None = None,
    progress: Callable[[InspectionStage, float], object] | None = None,
    judged: Callable[[PartResult], object] | None = None,
) -> PartResult:
    """Inspect a part; its capture is checked while the balls are looked for, and `tell` says what was found.

    `judged` is called with the result before its surface is made.
    """
    check_progress(progress)
    threads = thread_count(threads)
    if recipe is not None and not isinstance(recipe, PartRecipe):
        recipe = read_part_recipe(recipe)
    if recipe is not None and recipe.strip is not None:
        msg = "recipe: its images show a strip of parts; name the one to inspect: bgars.inspect_place(.., place)"
        raise InputError(msg)

    def report(stage: InspectionStage, fraction: float) -> None:
        if progress is not None:
            progress(stage, fraction)

    def look() -> FoundBalls:
        check_capture(capture)
        return _found(capture, recipe, threads, report)

    need_whole(capture)
    material, warnings = _material(recipe, method, len(capture.rig))
    report("find", 0.0)
    with ThreadPoolExecutor(1) as background:
        # The board's normals need no balls: they are made while the balls are looked for.
        started = background.submit(_board_normals, capture, threads)
        found_first, found = checked_beside(capture, tell, look, threads=threads)
        report("find", 1.0)
        board = started.result()
        measurement, field = _measured(capture, found, board, method, material, recipe, threads, report, surface)
    report("measure", 1.0)
    files = capture_files(capture) + (() if recipe is None or recipe.file is None else (recipe.file,))
    result = judge_part(
        found,
        measurement,
        recipe,
        name=capture.name,
        pixel_pitch_um=float(capture.pixel_pitch_um or 0.0),
        files=checksums(files),
        version=__version__,
        light_files=[path.name for path in capture.files],
        warnings=(*found_first, *warnings),
    )
    report("judge", 1.0)
    fit = None if field is None else field.reflectance
    result = replace(
        result,
        method=method,
        method_reason="" if field is None else field.method_reason,
        material=None if fit is None else part_material(fit, from_file=material is not None),
        capture=capture.name,
    )
    if judged is not None:
        judged(result)
    if surface and field is not None:
        report("surface", 0.0)
        result = replace(result, surface=part_surface(result, field, board, BOARD_STEP, threads=threads))
        report("surface", 1.0)
    return result


def _material(recipe: PartRecipe | None, method: Method, lights: int) -> tuple[SurfaceMaterial | None, tuple[str, ...]]:
    """The recipe's material, where the method uses one; a warning where it does not."""
    if recipe is None or recipe.material_file is None:
        return None, ()
    if method != "reflectance":
        return None, (MATERIAL_UNUSED.format(method=method),)
    return read_material(recipe.material_file, lights=lights), ()


def _found(
    capture: Capture,
    recipe: PartRecipe | None,
    threads: int | None,
    report: Callable[[InspectionStage, float], None],
) -> FoundBalls:
    layout = None if recipe is None else recipe.image_layout
    try:
        return find_balls(capture, layout=layout, threads=threads, progress=lambda fraction: report("find", fraction))
    except InputError as error:
        if recipe is None or recipe.file is None or not str(error).startswith(LAYOUT):
            raise
        msg = f"{recipe.file}: {str(error).removeprefix(LAYOUT)}"
        raise InputError(msg) from None


def _board_normals(capture: Capture, threads: int | None) -> NormalField | None:
    """Normals of some pixels all over the image; those of balls are left out where they are used."""
    mask = np.zeros_like(capture.mask)
    mask[::BOARD_STEP, ::BOARD_STEP] = capture.mask[::BOARD_STEP, ::BOARD_STEP]
    return estimate_normals(capture, method="robust-filter", mask=mask, threads=threads) if mask.any() else None


def _measured(
    capture: Capture,
    found: FoundBalls,
    field: NormalField | None,
    method: Method,
    material: SurfaceMaterial | None,
    recipe: PartRecipe | None,
    threads: int | None,
    report: Callable[[InspectionStage, float], None],
    surface: bool,
) -> tuple[BallMeasurement, NormalField | None]:
    """Measure the balls; their normals are made beside the fit of the shadows, which needs only those of the board.

    Returns also these normals; None where there is no ball.
    """
    if not found.balls:
        return measure_balls(capture, found, threads=threads), None
    balls = inside_circles(((ball.x_px, ball.y_px, ball.radius_px + 1.0) for ball in found.balls), capture.mask.shape)
    if not (balls & capture.mask).any():
        return measure_balls(capture, found, field=field, threads=threads), None
    # Nothing but flat tops needs them; a little more of each ball, because its shadows may see another radius.
    tops = [(ball.x_px, ball.y_px, TOPS * ball.radius_px + 1.0) for ball in found.balls]
    wanted = None if surface else inside_circles(tops, capture.mask.shape)
    roundness = (
        None
        if recipe is None or recipe.aspect_ratio is None or recipe.u_aspect_ratio is None
        else (recipe.aspect_ratio, recipe.u_aspect_ratio)
    )
    with ThreadPoolExecutor(1) as background:
        normals = background.submit(
            ball_normals, capture, found, balls, wanted=wanted, method=method, material=material, threads=threads
        )
        measurement = measure_balls(
            capture,
            found,
            field=field,
            ball_field=normals.result,
            roundness=roundness,
            threads=threads,
            progress=lambda fraction: report("measure", fraction),
        )
        return measurement, normals.result()
