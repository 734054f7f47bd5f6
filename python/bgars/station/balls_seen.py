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
from bgars.station.horizon import radius_around
from bgars.station.matt_lights import shading_misfit
from bgars.station.outline import as_outline, find_outline, refine_outline
from bgars.station.rim import fit_rim

if TYPE_CHECKING:
    from bgars.records.capture import Capture
    from bgars.station.levels import Levels
    from bgars.station.outline import Outline

__all__ = ["disc_of_mask", "given_outlines", "outlines_of"]

Array = NDArray[np.float64]

WRONG_SIGMAS, WRONG_SHARE = 4.0, 0.01
"""A stated radius that differs by more from what the images show is doubted."""
SOFT_PX = 2.5
"""Width of an edge from which on a ball is out of focus."""
SOFT_SHARE = 0.03
UNEXPLAINED_PX = 0.15
"""Shading runs into the edge of a matt ball, and a mirror is brighter at its rim: laws of edges differ by so much."""
STRAYED_PX = 1.5
NOT_SEEN_U_PX = 0.5
"""Uncertainty of a stated outline that the images do not show."""
NOT_A_DISC = 0.1
SEEN_ARC = 0.5
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
        found = _sharpened(levels, found, matt)
        around_px = None if matt or found is None else radius_around(levels, found)
        if found is not None and around_px is not None:
            found = _sharpened(levels, replace(found, radius_px=around_px), matt)
        if start is not None:
            found = _joined(found, start)
        if found is None:
            msg = (
                f"{capture.name}: no ball found: no sharp circle in the images (out of focus, or of the level of its "
                "background); photograph it again, or give its outline"
            )
            raise CalibrationError(msg)
        outlines.append(found)
    for index, circle in enumerate(() if given is None else given):
        if circle[2] > max(height, width):
            _judge(capture, as_outline(circle), height, width)
        seen = refine_outline(pictures, circle, steps)
        name = "outline" if given is None or len(given) == 1 else f"outline {index}"
        if seen is None or seen.arc < SEEN_ARC:
            other = find_outline(pictures, None, steps)
            if other is not None and other.arc > SEEN_ARC and _overlap(other.circle_px, circle):
                message = (
                    f"{capture.name}: {name}: no edge at the stated circle, radius {circle[2]:.1f} px at "
                    f"({circle[0]:.1f}, {circle[1]:.1f}); the images show one of {other.radius_px:.1f} px at "
                    f"({other.x_px:.1f}, {other.y_px:.1f}), x right, y up from the middle"
                )
                off = float(np.abs(other.circle_px - circle).max())
                findings.append(Remark("doubt", message, "wrong-outline", off, None, "px"))
                outlines.append(replace(as_outline(circle), u_centre_px=off, u_radius_px=off))
                continue
            outlines.append(as_outline(circle, NOT_SEEN_U_PX))
            findings.append(
                Remark("note", f"{capture.name}: {name}: not seen in the images, taken as stated", "outline-unseen")
            )
            continue
        off = np.abs(seen.circle_px - circle)
        allowed = max(WRONG_SHARE * circle[2], WRONG_SIGMAS * math.hypot(seen.u_radius_px, NOT_SEEN_U_PX))
        if off.max() > allowed:
            findings.append(
                Remark(
                    "doubt",
                    f"{capture.name}: {name}: stated radius {circle[2]:.2f} px at ({circle[0]:.1f}, {circle[1]:.1f}), "
                    f"the images show {seen.radius_px:.2f} px at ({seen.x_px:.1f}, {seen.y_px:.1f})",
                    "wrong-outline",
                    float(off.max()),
                    allowed,
                    "px",
                )
            )
            u_px = np.maximum(off, NOT_SEEN_U_PX)
            outlines.append(replace(as_outline(circle), u_centre_px=float(u_px[:2].max()), u_radius_px=float(u_px[2])))
        else:
            outlines.append(_joined(_sharpened(levels, seen, matt), circle))
    for outline in outlines:
        findings += _judge(capture, outline, height, width)
    return outlines, findings


def _judge(capture: Capture, outline: Outline, height: int, width: int) -> list[Remark]:
    if not outline.inside(height, width):
        msg = (
            f"{capture.name}: the ball is cut off: radius {outline.radius_px:.6g} px at ({outline.x_px:.6g}, "
            f"{outline.y_px:.1f}) from the middle of an image of {width} x {height} pixels"
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


def _pictures(levels: Levels) -> list[Array]:
    mean = levels.images.mean(axis=0)
    return [mean, levels.images.max(axis=0), np.log(np.maximum(mean, 0.0) + 2.0 * levels.noise)]


def _sharpened(levels: Levels, outline: Outline | None, matt: bool) -> Outline | None:
    """An outline as the pixels around it have it, where a law of their levels explains them."""
    if outline is None:
        return None
    fitted = fit_rim(levels, outline, matt=matt)
    if fitted is not None and float(np.abs(fitted.circle_px - outline.circle_px).max()) < STRAYED_PX:
        return fitted
    return replace(outline, u_radius_px=math.hypot(outline.u_radius_px, UNEXPLAINED_PX))


def _joined(seen: Outline | None, stated_px: Array) -> Outline:
    """Mean of a stated circle and what the images show, by their uncertainties."""
    if seen is None:
        return as_outline(stated_px, NOT_SEEN_U_PX)
    centre, radius = (1.0 / (1.0 + (u / NOT_SEEN_U_PX) ** 2) for u in (seen.u_centre_px, seen.u_radius_px))
    x, y, r = stated_px + np.array([centre, centre, radius]) * (seen.circle_px - stated_px)
    u_centre, u_radius = (NOT_SEEN_U_PX * math.sqrt(1.0 - share) for share in (centre, radius))
    return replace(seen, x_px=float(x), y_px=float(y), radius_px=float(r), u_centre_px=u_centre, u_radius_px=u_radius)


def _overlap(one_px: Array, other_px: Array) -> bool:
    """True where two circles can be meant for one ball."""
    return bool(np.hypot(*(one_px[:2] - other_px[:2])) < 0.5 * max(one_px[2], other_px[2]))


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
