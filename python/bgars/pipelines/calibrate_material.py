"""Calibration: a surface's material, fitted where its shape is known."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bgars import _bgars
from bgars.errors import CalibrationError
from bgars.pipelines.normals import estimate_normals
from bgars.records.scalar_checks import check_progress, thread_count
from bgars.records.whole_capture import need_whole

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike

    from bgars.records.capture import Capture
    from bgars.records.found_balls import FoundBalls
    from bgars.records.reflectance_fit import ReflectanceFit

__all__ = ["calibrate_material"]


def calibrate_material(
    capture: Capture,
    *,
    anchors: FoundBalls | ArrayLike | None = None,
    threads: int | None = None,
    progress: Callable[[float], object] | None = None,
) -> ReflectanceFit:
    """Fit the material of a part on its balls, or of a reference sphere, to be used on other captures.

    Parameters
    ----------
    capture : Capture
        At least 4 lights; the lights and the exposure of the captures that the material will be used on.
    anchors : FoundBalls, (N, 3) array_like, or (H, W) array_like of bool, optional
        Balls, circles, or the mask of one ball, as of :func:`bgars.estimate_normals`. Searched for by default.
    threads, progress
        See :func:`bgars.estimate_normals`.

    Returns
    -------
    ReflectanceFit
        The material, how well it explains the balls, and which those are.

    Raises
    ------
    CalibrationError
        No ball, too few lights, or no material that explains the balls.
    InputError
        Anchors that do not fit the images.

    Examples
    --------
    >>> import bgars
    >>> fit = bgars.calibrate_material(bgars.read_capture(bgars.sample_capture()))
    >>> len(fit.circles_px), len(fit.material.gains), fit.loss < 0.1
    (1, 8, True)
    """
    check_progress(progress)
    threads = thread_count(threads)
    need_whole(capture)
    if len(capture.rig) < _bgars.REFLECTANCE_MIN_LIGHTS:
        least = _bgars.REFLECTANCE_MIN_LIGHTS
        msg = f"{capture.name}: a material needs {least} lights or more, the capture has {len(capture.rig)}"
        raise CalibrationError(msg)
    fit = estimate_normals(
        capture, method="reflectance", anchors=anchors, threads=threads, progress=progress
    ).reflectance
    if fit is None:
        msg = (
            f"{capture.name}: no ball {'found' if anchors is None else 'given'}, so no known shape to fit a material on"
        )
        raise CalibrationError(msg)
    if not fit.accepted:
        msg = f"{capture.name}: no material explains the balls (loss {fit.loss:.2f}, at most 2 is accepted)"
        raise CalibrationError(msg)
    return fit
