"""One image with many parts: each is inspected as if it were alone."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bgars.errors import InputError
from bgars.io.part_recipe import read_part_recipe
from bgars.normals.methods import DEFAULT_METHOD, Method
from bgars.pipelines.inspect import inspect
from bgars.records.part_identity import PartIdentity
from bgars.records.part_recipe import PartRecipe, layout_places
from bgars.records.whole_capture import need_whole

if TYPE_CHECKING:
    from collections.abc import Callable
    from os import PathLike

    from bgars.pipelines.inspect import InspectionStage
    from bgars.records.capture import Capture
    from bgars.records.part_result import PartResult
    from bgars.records.strip_layout import StripLayout, StripPlace

__all__ = ["inspect_place", "part_of_strip", "places_of_strip"]


def places_of_strip(capture: Capture, recipe: PartRecipe) -> tuple[StripPlace, ...]:
    """Return the places of a strip that carry a part; every one lies in the image, and its balls in its window.

    Raises
    ------
    InputError
        They do not, the recipe names no strip, or the capture has no pixel pitch; file, rule and value are named.

    Examples
    --------
    >>> import bgars
    >>> capture, recipe = (
    ...     bgars.read_capture(bgars.sample_capture()), bgars.read_part_recipe(bgars.sample_part_recipe()))
    >>> places_of_strip(capture, recipe)
    Traceback (most recent call last):
        ...
    bgars.errors.InputError: strip: the recipe names none
    """
    strip = _strip_of(recipe)
    file = "" if recipe.file is None else f"{recipe.file}: "
    balls = layout_places(recipe.layout)
    for axis, name, window_um in (("x_um", "width", strip.window[0]), ("y_um", "height", strip.window[1])):
        along = [getattr(ball, axis) for ball in balls]
        size_um = max(along) - min(along) + (recipe.diameter_um or 0.0)
        if size_um > window_um:
            msg = f"{file}strip: the balls of a part need a {name} of {size_um:g} um, its window has {window_um:g} um"
            raise InputError(msg)
    for place in strip.places():
        try:
            _window(capture, strip, place)
        except InputError as error:
            msg = f"{file}{error}"
            raise InputError(msg) from None
    return strip.places()


def part_of_strip(capture: Capture, strip: StripLayout, place: StripPlace) -> Capture:
    """Return the capture with everything masked but one part.

    The images keep their size: near lights, and a lens that looks at the strip's ends from the side, stay where they
    are.

    Raises
    ------
    InputError
        No pixel pitch, or the place lies outside the image.
    """
    rows, cols = _window(capture, strip, place)
    mask = np.zeros_like(capture.mask)
    mask[rows, cols] = capture.mask[rows, cols]
    return replace(capture, mask=mask)


def inspect_place(
    capture: Capture,
    recipe: PartRecipe | str | PathLike[str],
    place: str,
    *,
    method: Method = DEFAULT_METHOD,
    surface: bool = False,
    check: bool = True,
    threads: int | None = None,
    progress: Callable[[InspectionStage, float], object] | None = None,
) -> PartResult:
    """Find, measure and judge the balls of one part of a strip.

    Parameters
    ----------
    capture : Capture
        Of the whole strip, with a pixel pitch.
    recipe : PartRecipe or path
        With a strip.
    place : str
        Such as ``"R1C2"``: row from the top of the image, column from its left.
    method, surface, check, threads, progress
        As in :func:`bgars.inspect`.

    Returns
    -------
    PartResult
        Its ``identity.position`` is the place; coordinates are those of the whole image.

    Raises
    ------
    FileFormatError
        The recipe file cannot be read.
    InputError
        As :func:`places_of_strip` and :func:`bgars.inspect`; no part at this place.
    CalibrationError
        As :func:`bgars.inspect`.
    """
    need_whole(capture)
    recipe = recipe if isinstance(recipe, PartRecipe) else read_part_recipe(recipe)
    places_of_strip(capture, recipe)
    strip = _strip_of(recipe)
    alone = part_of_strip(capture, strip, strip.place(place))
    single = replace(recipe, strip=None)
    result = inspect(alone, single, method=method, surface=surface, check=check, threads=threads, progress=progress)
    return replace(result, recipe=recipe, identity=PartIdentity(position=place))


def _strip_of(recipe: PartRecipe) -> StripLayout:
    if recipe.strip is None:
        msg = "strip: the recipe names none"
        raise InputError(msg)
    return recipe.strip


def _window(capture: Capture, strip: StripLayout, place: StripPlace) -> tuple[slice, slice]:
    """Rows and columns of a place's window, as far as the image shows it."""
    if capture.pixel_pitch_um is None:
        msg = "strip: needs a pixel pitch (pixel_pitch_um in capture.toml), got none"
        raise InputError(msg)
    height, width = capture.mask.shape
    x_px = (width - 1) / 2 + place.x_um / capture.pixel_pitch_um
    y_px = (height - 1) / 2 - place.y_um / capture.pixel_pitch_um
    half_x_px, half_y_px = (size_um / capture.pixel_pitch_um / 2 for size_um in strip.window)
    # A window may reach over the image's edge by its margin, which is less than a quarter; a part may not.
    if not (half_x_px / 2 <= x_px <= width - half_x_px / 2 and half_y_px / 2 <= y_px <= height - half_y_px / 2):
        size = f"{width * capture.pixel_pitch_um:.0f} x {height * capture.pixel_pitch_um:.0f} um"
        msg = (
            f"strip: place {place.name} must lie in the image of {size}, got its middle at "
            f"x = {place.x_um:.0f}, y = {place.y_um:.0f} um from the image's middle"
        )
        raise InputError(msg)
    return _span(y_px, half_y_px, height), _span(x_px, half_x_px, width)


def _span(middle_px: float, half_px: float, size_px: int) -> slice:
    return slice(max(0, round(middle_px - half_px + 0.5)), min(size_px, round(middle_px + half_px + 0.5)))
