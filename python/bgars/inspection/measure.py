"""Balls measured from the shadows that they cast: heights, diameters, shapes, and the lights along with them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bgars.errors import InputError
from bgars.inspection.flat_top import flat_tops
from bgars.inspection.problem import make_problem, thread_count
from bgars.inspection.results import measurement
from bgars.inspection.shadow_fit import fit_shadows
from bgars.records.same_images import refuse_repeated
from bgars.records.scalar_checks import check_progress

if TYPE_CHECKING:
    from collections.abc import Callable

    from bgars.records.capture import Capture
    from bgars.records.found_balls import FoundBalls
    from bgars.records.measured_balls import BallMeasurement
    from bgars.records.normal_field import NormalField

__all__ = ["check_shadows", "measure_balls"]


def measure_balls(
    capture: Capture,
    found: FoundBalls,
    *,
    field: NormalField | None = None,
    ball_field: Callable[[], NormalField] | None = None,
    refine_lights: bool = True,
    roundness: tuple[float, float] | None = None,
    threads: int | None = None,
    progress: Callable[[float], object] | None = None,
) -> BallMeasurement:
    """Measure every ball of a part from the shadows in its images.

    Each light throws the shadow of each ball on the board. Stretches of the edges of all shadows are measured to a few
    hundredths of a pixel, and balls (centre, height, radius, q), directions of the lights and shape of the board are
    fitted to all of them at once.

    Parameters
    ----------
    capture : Capture
        Its response, dark frame, black level, saturation and intensities are honoured.
    found : FoundBalls
        Balls in the image.
    field : NormalField, optional
        Normals of the same capture: flat tops, which no shadow shows, and a first shape of the board come from it.
    ball_field : callable, optional
        Returns the normals that flat tops are looked for in, instead of `field`; called when the shadows are done, so
        that these normals may be made meanwhile.
    refine_lights : bool
        Also fit where the lights are; the rig is the prior. Otherwise the rig is taken as exact.
    roundness : (float, float), optional
        Usual q of these balls and its standard uncertainty, common to all; by default spheres, with doubts.
    threads : int, optional
        Largest number of threads; by default ``RAYON_NUM_THREADS``, else one per core. The result does not depend
        on it.
    progress : callable, optional
        Called with the fraction done.

    Returns
    -------
    BallMeasurement
        Balls in the order of `found`. What could not be measured is NaN, with reasons. Heights are above the smooth
        board under the ball. They rest on two assumptions, which no image can replace: errors of the rig are
        independent from light to light, and the balls are round on the whole (one ball may well be flattened).

    Raises
    ------
    InputError
        A capture without a pixel pitch, balls outside the image, a field of another size, an image twice.
    CalibrationError
        An image whose shadows say clearly that it belongs to another light, or that it is shifted.

    References
    ----------
    docs/method.md; B. Triggs et al., "Bundle adjustment - a modern synthesis" (2000); S. Geman and D. McClure,
    "Bayesian image analysis" (1985), for the weights.

    Examples
    --------
    >>> import bgars
    >>> from bgars.records.found_balls import FoundBall, FoundBalls
    >>> from bgars.inspection import measure_balls
    >>> scene = bgars.Scene.ball(600.0, height_um=500.0)
    >>> capture, truth = bgars.simulate(scene, bgars.LightRig.ring(8), bgars.Material(), bgars.Camera(supersample=4))
    >>> ball = FoundBall("A1", 0, 0, 0.1, -0.1, 30.1, u_centre_px=0.2, u_radius_px=0.2)
    >>> found = FoundBalls((ball,), (), (), 1, 1, None, 0.0, (0.0, 0.0))
    >>> top = measure_balls(capture, found, refine_lights=False).balls[0]
    >>> abs(top.top_um - 500.0) < top.u_top_um
    True
    """
    if field is not None and field.mask.shape != capture.images.shape[1:]:
        msg = f"field: must have the shape of the images {capture.images.shape[1:]}, got {field.mask.shape}"
        raise InputError(msg)
    check_progress(progress)
    workers = thread_count(threads)
    report = progress or _quiet
    refuse_repeated(capture)
    problem = make_problem(capture, found, roundness)
    fit = fit_shadows(problem, field, refine_lights=refine_lights, threads=workers, progress=report)
    tops = field if ball_field is None else ball_field()
    flats = None if tops is None or fit is None or fit.solution is None else flat_tops(tops, fit.solution.balls)
    report(1.0)
    return measurement(found, problem, fit, flats)


def check_shadows(capture: Capture, found: FoundBalls, *, threads: int | None = None) -> tuple[str, ...]:
    """Check that images, lights and shadows belong together.

    The whole measurement is made for it: where shadows merge, only the fit tells a wrong light from a hidden shadow.

    Parameters
    ----------
    capture, found, threads
        As for :func:`measure_balls`.

    Returns
    -------
    tuple of str
        What is doubtful though numbers may still be right: a light some degrees from where the rig says, an image
        shifted by less than a pixel.

    Raises
    ------
    InputError
        An image that is there twice; see :func:`measure_balls` for others.
    CalibrationError
        Images swapped or taken from another light, shifted by a pixel or more; lights far from where the rig says.
    """
    return measure_balls(capture, found, threads=threads).warnings


def _quiet(_: float) -> None:
    """No progress."""
