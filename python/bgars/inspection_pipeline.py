"""Inspection: find the balls, measure them, judge the part; joined here and nowhere else."""

from __future__ import annotations

from importlib.metadata import version
from typing import TYPE_CHECKING, Literal

from bgars.balls import find_balls
from bgars.inspection import measure_balls
from bgars.inspection.exposure import check_capture
from bgars.inspection.judge import judge_part
from bgars.io.part_recipe import read_part_recipe
from bgars.io.provenance import capture_files, checksums
from bgars.normals import DEFAULT_METHOD, Method, estimate_normals
from bgars.part_recipe import PartRecipe

if TYPE_CHECKING:
    from collections.abc import Callable
    from os import PathLike

    from bgars.ball_records import BallMeasurement, FoundBalls
    from bgars.part_result import PartResult
    from bgars.records import Capture, NormalField

__all__ = ["inspect"]

InspectionStage = Literal["find", "normals", "measure", "judge"]
MATERIAL_UNUSED = "material.file of the recipe is not used by method {method}"


def inspect(
    capture: Capture,
    recipe: PartRecipe | str | PathLike[str] | None = None,
    *,
    method: Method = DEFAULT_METHOD,
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
    threads : int, optional
        Most threads to work on; the result does not depend on it.
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
        No pixel pitch, a black or saturated image, a recipe that contradicts itself.
    CalibrationError
        Images that do not show what the rig says.
    """
    if recipe is not None and not isinstance(recipe, PartRecipe):
        recipe = read_part_recipe(recipe)

    def report(stage: InspectionStage, fraction: float) -> None:
        if progress is not None:
            progress(stage, fraction)

    check_capture(capture)
    report("find", 0.0)
    found = _found(capture, recipe, threads)
    report("find", 1.0)
    field = estimate_normals(
        capture,
        # Without balls there is nothing to measure; the cheapest estimate will do.
        method=method if found.balls else "lambertian",
        anchors=found if found.balls and method == "reflectance" else None,
        threads=threads,
        progress=lambda fraction: report("normals", fraction),
    )
    report("normals", 1.0)
    measurement = _measured(capture, found, field, threads, lambda fraction: report("measure", fraction))
    report("measure", 1.0)
    files = capture_files(capture) + (() if recipe is None or recipe.file is None else (recipe.file,))
    result = judge_part(
        found,
        measurement,
        recipe,
        name=capture.name,
        pixel_pitch_um=float(capture.pixel_pitch_um or 0.0),
        files=checksums(files),
        version=version("bgars"),
        warnings=_unused(recipe, method),
    )
    report("judge", 1.0)
    return result


def _unused(recipe: PartRecipe | None, method: Method) -> tuple[str, ...]:
    if recipe is None or recipe.material_file is None:
        return ()
    return (MATERIAL_UNUSED.format(method=method),)


def _found(capture: Capture, recipe: PartRecipe | None, threads: int | None) -> FoundBalls:
    layout = None if recipe is None else recipe.image_layout
    return find_balls(capture, layout=layout, threads=threads)


def _measured(
    capture: Capture,
    found: FoundBalls,
    field: NormalField,
    threads: int | None,
    progress: Callable[[float], object],
) -> BallMeasurement:
    return measure_balls(capture, found, field=field, threads=threads, progress=progress)
