"""Lights from what is in view: reference balls, or the solder balls of a part."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from bgars.balls import find_balls
from bgars.errors import CalibrationError, InputError
from bgars.inspection import measure_balls
from bgars.io.part_recipe import read_part_recipe
from bgars.pipelines.normals import estimate_normals
from bgars.records.capture import Capture
from bgars.records.light_calibration import BallView, LightCalibration
from bgars.records.part_recipe import PartRecipe
from bgars.records.remark import Remark
from bgars.records.rig import LightRig
from bgars.records.scalar_checks import check_progress
from bgars.station.lights import calibrate_lights as lights_of_spheres

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from os import PathLike

    from numpy.typing import ArrayLike, NDArray

    from bgars.records.measured_balls import BallMeasurement

__all__ = ["InView", "calibrate_lights"]

InView = Literal["mirror", "matt", "balls"]


def calibrate_lights(
    capture: Capture | Sequence[Capture],
    sphere: InView = "mirror",
    outline: ArrayLike | Sequence[ArrayLike | None] | None = None,
    *,
    near: bool | None = None,
    diameter_um: float | None = None,
    recipe: PartRecipe | str | PathLike[str] | None = None,
    progress: Callable[[float], object] | None = None,
) -> LightCalibration:
    """Find where the lights are, from a mirror or a matt ball in view, or from the solder balls of a part.

    Parameters
    ----------
    capture : Capture or sequence of Capture
        The ball under each light; or several captures, with the ball moved in between. Their rig is a starting guess
        only: what comes out does not depend on it. With "balls", one capture of a part with a pixel pitch, whose rig is
        right to some degrees.
    sphere : {"mirror", "matt", "balls"}
        A bearing ball, a chrome or a glossy black one; a matt one; or the solder balls of a part, whose shadows on the
        board show the lights, all balls at once.
    outline : (3,) or (N, 3) array_like, or a sequence of these, optional
        x, y (from the image centre, x right, y up) and radius of the ball, or of several balls, in pixels; with several
        captures, one entry a capture. By default the circle is looked for, or taken from a mask that is a disc. Not
        with "balls".
    near : bool, optional
        True: positions in space, which takes two balls or one ball moved. False: directions of far lamps. By default
        positions where the balls show that directions differ from place to place, else directions whose uncertainty
        holds what the balls do not tell of the lamps' distance, unless the capture states directions of its lights. Not
        with "balls": lights are then what the rig says.
    diameter_um : float, optional
        Diameter of the ball: gives the pixel pitch where the captures state none; else it is compared with theirs. Not
        with "balls".
    recipe : PartRecipe or path, optional
        With "balls": layout of the part, and usual roundness of its balls.
    progress : callable, optional
        Called with the fraction done.

    Returns
    -------
    LightCalibration
        The rig with standard uncertainties (`u_deg`), intensities where they can be measured, residuals, findings.

    Raises
    ------
    CalibrationError
        No ball, a ball that is cut off or overexposed, a light whose highlight is on no ball; a direction at or below
        the board, or with an uncertainty beyond 10 degrees; too few shadows.
    InputError
        Captures with different numbers of images, an outline of a wrong shape, an argument that does not go with
        `sphere`.

    Notes
    -----
    A mirror ball turns a step of the highlight into twice the angle: of a ball of 200 pixels radius one pixel is half a
    degree, and a radius that is wrong by 1 pixel tilts a light at 45 degrees by 0.2 degrees, all lights alike
    (`u_common_deg`).

    Shadows of solder balls fix the azimuth of each light, and its elevation against the others. That of all lights
    together looks the same as balls that are all flattened alike: if the recipe does not state their roundness,
    `u_common_deg` holds both.

    References
    ----------
    Zhou, W. & Kambhamettu, C. (2002). Estimation of illuminant direction and intensity of multiple light sources.
    Powell, M. W., Sarkar, S. & Goldgof, D. (2001). A simple strategy for calibrating the geometry of light sources.

    Examples
    --------
    >>> import bgars
    >>> scene, matt = bgars.Scene.hemisphere(300.0), bgars.Material(i_s=0.0)
    >>> ball, _ = bgars.simulate(scene, bgars.LightRig.ring(8), matt, bgars.Camera())
    >>> found = bgars.calibrate_lights(ball, sphere="matt")
    >>> float(abs(found.rig.elevations_deg - 45.0).max()) < 1.0
    True
    """
    check_progress(progress)
    if sphere != "balls":
        if recipe is not None:
            msg = f"recipe: goes with sphere 'balls' only, got sphere {sphere!r}"
            raise InputError(msg)
        return lights_of_spheres(capture, sphere, outline, near=near, diameter_um=diameter_um, progress=progress)
    given = {"outline": outline, "near": near, "diameter_um": diameter_um}
    named = next((name for name, value in given.items() if value is not None), None)
    if named is not None:
        msg = f"{named}: does not go with sphere 'balls', whose balls are found and measured as in an inspection"
        raise InputError(msg)
    captures = [capture] if isinstance(capture, Capture) else list(capture)
    if len(captures) != 1:
        msg = f"capture: must be one capture of a part with sphere 'balls', got {len(captures)}"
        raise InputError(msg)
    return _lights_of_part(captures[0], recipe, progress)


def _lights_of_part(
    capture: Capture, recipe: PartRecipe | str | PathLike[str] | None, progress: Callable[[float], object] | None
) -> LightCalibration:
    if recipe is not None and not isinstance(recipe, PartRecipe):
        recipe = read_part_recipe(recipe)
    layout = None if recipe is None else recipe.image_layout
    roundness = None
    if recipe is not None and recipe.aspect_ratio is not None and recipe.u_aspect_ratio is not None:
        roundness = recipe.aspect_ratio, recipe.u_aspect_ratio
    if capture.pixel_pitch_um is None:
        msg = f"{capture.name}: pixel_pitch_um: needed with sphere 'balls'; calibrate the scale first, or state it"
        raise InputError(msg)
    found = find_balls(capture, layout=layout)
    if not found.balls:
        msg = f"{capture.name}: no solder balls found"
        raise CalibrationError(msg)
    if progress is not None:
        progress(0.3)
    # What the capture says of its own uncertainty would be the prior of what is to be measured.
    free = replace(capture, rig=replace(capture.rig, u_deg=None))
    field = estimate_normals(free, method="robust-filter")
    measured = measure_balls(
        free, found, field=field, roundness=roundness,
        progress=None if progress is None else lambda share: progress(0.3 + 0.7 * share),
    )  # fmt: skip
    u_deg, common = measured.u_light_deg, measured.u_light_common_deg
    if u_deg is None or common is None or not np.isfinite(u_deg).all():
        msg = f"{capture.name}: the shadows of {len(found.balls)} balls are too few or too faint to show the lights"
        raise CalibrationError(msg)
    common = np.minimum(common, u_deg)
    return LightCalibration(
        rig=_rig(capture, measured.light_directions, u_deg),
        u_deg=u_deg,
        u_own_deg=np.sqrt(np.maximum(u_deg**2 - common**2, 0.0)),
        u_common_deg=common,
        sphere="balls",
        balls=tuple(_views(capture, measured)),
        residual_px=0.0,
        findings=tuple(_findings(measured, capture, known=roundness is not None)),
    )


def _rig(capture: Capture, directions: NDArray[np.float64], u_deg: NDArray[np.float64]) -> LightRig:
    rig = capture.rig
    if rig.positions_um is None:
        return LightRig.from_directions(directions, intensities=rig.intensities, u_deg=u_deg)
    # Shadows turn a near light around the image centre; its distance stays what the rig says.
    distances = np.linalg.norm(rig.positions_um, axis=1, keepdims=True)
    return LightRig.from_positions(directions * distances, intensities=rig.intensities, u_deg=u_deg)


def _views(capture: Capture, measured: BallMeasurement) -> list[BallView]:
    pitch = float(capture.pixel_pitch_um or 1.0)
    nothing = np.full((len(capture.rig), 2), np.nan)
    return [
        BallView(
            capture.name,
            np.array([ball.x_um, ball.y_um, 0.5 * ball.diameter_um]) / pitch,
            np.array([ball.u_x_um, ball.u_y_um, 0.5 * ball.u_diameter_um]) / pitch,
            nothing,
            nothing,
        )
        for ball in measured.balls
        if np.isfinite([ball.x_um, ball.y_um, ball.diameter_um]).all()
    ]


def _findings(measured: BallMeasurement, capture: Capture, *, known: bool) -> list[Remark]:
    found = [Remark("doubt", f"{capture.name}: {text}", "balls-doubt") for text in measured.doubts]
    found += [Remark("note", f"{capture.name}: {text}", "balls-warning") for text in measured.warnings]
    if not known:
        message = (
            "the usual roundness of the balls is not stated (aspect_ratio and u_aspect_ratio of a recipe): a common "
            "error in elevation of all lights looks the same as balls that are all flattened alike"
        )
        found.append(Remark("note", message, "roundness-unknown"))
    return found
