"""Reference balls of a capture: where their outlines are, and what is wrong with them."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bgars.errors import CalibrationError, InputError
from bgars.records.remark import Remark
from bgars.station.another_ball import another_ball
from bgars.station.horizon import radius_around
from bgars.station.matt_lights import shading_misfit
from bgars.station.outline import as_outline, find_outline, refine_outline
from bgars.station.overexposed import BURNT, HIDDEN, TOUCHED, clipped_ball, clipped_ground, moved_share
from bgars.station.rim import sharpened
from bgars.station.stated_outline import joined, stated_outline

if TYPE_CHECKING:
    from bgars.records.capture import Capture
    from bgars.station.levels import Levels
    from bgars.station.outline import Outline

__all__ = ["disc_of_mask", "given_outlines", "outlines_of"]

Array = NDArray[np.float64]

SOFT_PX = 2.5
"""Width of an edge from which on a ball is out of focus."""
SOFT_SHARE = 0.03
NOT_A_DISC = 0.1
LEAST_RADIUS_PX = 12.0


def given_outlines(outline: ArrayLike | None) -> Array | None:
    """Return (N, 3) circles as a caller gives them, one or several.

    Raises
    ------
    InputError
        Another shape, or a radius that is not above 0.
    """
    if outline is None:
        return None
    circles = np.atleast_2d(np.asarray(outline, dtype=np.float64))
    if circles.ndim != 2 or circles.shape[1] != 3:  # noqa: PLR2004 - x, y, radius
        msg = f"outline: must be (x, y, radius) or have shape (N, 3), got {circles.shape}"
        raise InputError(msg)
    if not (np.isfinite(circles).all() and (circles[:, 2] > 0).all()):
        msg = f"outline: must be finite with a radius above 0, got {circles.tolist()}"
        raise InputError(msg)
    return circles


def outlines_of(
    capture: Capture, levels: Levels, given: Array | None, *, matt: bool
) -> tuple[list[Outline], list[Remark]]:
    """Return the outlines of the balls in view, measured where the images show them.

    Raises
    ------
    CalibrationError
        No ball is found, or it is cut off by the edge of the image.
    """
    pictures = _pictures(levels)
    dim = float(np.median(pictures[0])) + 2.0 * levels.noise
    steps = (levels.rounding, levels.rounding, levels.rounding / max(dim, levels.noise))
    height, width = pictures[0].shape
    findings: list[Remark] = []
    outlines: list[Outline] = []
    if given is None:
        start = disc_of_mask(capture)
        found = (
            find_outline(pictures, partial(shading_misfit, levels) if matt else None, steps)
            if start is None
            else refine_outline(pictures, start, steps)
        )
        found = sharpened(levels, found, matt=matt)
        around_px = None if matt or found is None else radius_around(levels, found)
        if found is not None and around_px is not None:
            found = sharpened(levels, replace(found, radius_px=around_px), matt=matt)
        if start is not None:
            found = joined(found, start)
        if found is None:
            msg = (
                f"{capture.name}: no ball found: no sharp circle in the images (out of focus, or of the level of its "
                "background); photograph it again, or give its outline"
            )
            raise CalibrationError(msg)
        found, said = (found, []) if matt else _exposed(capture, levels, found)
        outlines.append(found)
        findings += said
        findings += another_ball(capture, levels, pictures, found, steps, matt=matt)
    for index, circle in enumerate(() if given is None else given):
        if circle[2] > max(height, width):
            _judge(capture, as_outline(circle), height, width)
        name = "outline" if given is None or len(given) == 1 else f"outline {index}"
        outline, said = stated_outline(capture, levels, pictures, circle, steps, name, matt=matt)
        findings += said
        if not matt and clipped_ground(levels, outline) <= HIDDEN:
            outline, said = _exposed(capture, levels, outline)
            findings += said
        outlines.append(outline)
    for outline in outlines:
        findings += _judge(capture, outline, height, width)
    return outlines, findings


def _judge(capture: Capture, outline: Outline, height: int, width: int) -> list[Remark]:
    if not outline.inside(height, width):
        msg = (
            f"{capture.name}: the ball is cut off: radius {outline.radius_px:.6g} px at column "
            f"{outline.x_px + width / 2.0 - 0.5:.1f}, row {height / 2.0 - outline.y_px - 0.5:.1f} of an image of "
            f"{width} x {height} pixels"
        )
        raise CalibrationError(msg)
    if outline.radius_px < LEAST_RADIUS_PX:
        msg = (
            f"{capture.name}: the ball is too small: its radius must be {LEAST_RADIUS_PX:g} px or more, got "
            f"{outline.radius_px:.1f}"
        )
        raise CalibrationError(msg)
    limit = max(SOFT_PX, SOFT_SHARE * outline.radius_px)
    if outline.edge_px > limit:
        return [
            Remark(
                "doubt",
                f"{capture.name}: the ball is out of focus: its edge is {outline.edge_px:.1f} px wide "
                f"(standard deviation), at most {limit:.1f} is sharp",
                "out-of-focus",
                outline.edge_px,
                limit,
                "px",
            )
        ]
    return []


def _exposed(capture: Capture, levels: Levels, outline: Outline) -> tuple[Outline, list[Remark]]:
    """The outline of a mirror ball with what clipped ground leaves of it.

    Raises
    ------
    CalibrationError
        Most of the lit ground beside it is clipped.
    """
    ground, ball = clipped_ground(levels, outline), clipped_ball(levels, outline)
    findings = []
    if ground > HIDDEN:
        msg = (
            f"{capture.name}: overexposed: {100 * ground:.0f} % of the ground beside the ball is clipped, at most "
            f"{100 * HIDDEN:.0f} % leaves its edge to be seen; expose shorter (a bracket measures highlights, too), or "
            "give its outline"
        )
        raise CalibrationError(msg)
    if ground > TOUCHED:
        message = (
            f"{capture.name}: overexposed: {100 * ground:.0f} % of the ground beside the ball is clipped (limit "
            f"{100 * TOUCHED:.0f} %), which moves its edge; expose shorter"
        )
        findings.append(Remark("doubt", message, "overexposed-ground", ground, TOUCHED))
        u_px = moved_share(ground) * outline.radius_px
        outline = replace(
            outline,
            u_centre_px=math.hypot(outline.u_centre_px, u_px),
            u_radius_px=math.hypot(outline.u_radius_px, u_px),
        )
    if ball > BURNT:
        message = (
            f"{capture.name}: overexposed: {100 * ball:.0f} % of the ball is clipped (limit {100 * BURNT:.0f} %), "
            "which hides highlights; expose shorter"
        )
        findings.append(Remark("doubt", message, "overexposed-ball", ball, BURNT))
    return outline, findings


def _pictures(levels: Levels) -> list[Array]:
    mean = levels.images.mean(axis=0)
    return [mean, levels.images.max(axis=0), np.log(np.maximum(mean, 0.0) + 2.0 * levels.noise)]


def disc_of_mask(capture: Capture) -> Array | None:
    """Return the circle of a mask that is a disc; None for any other mask, or one of all pixels."""
    mask = capture.mask
    if mask.all():
        return None
    height, width = mask.shape
    rows, cols = np.nonzero(mask)
    radius = math.sqrt(len(rows) / math.pi)
    row, col = rows.mean(), cols.mean()
    inside = np.hypot(rows - row, cols - col) <= radius
    if 1.0 - inside.mean() > NOT_A_DISC / 2.0:
        return None
    return np.array([col + 0.5 - width / 2.0, height / 2.0 - row - 0.5, radius])
