"""An outline that a caller states, against what the images show of it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bgars.records.remark import Remark
from bgars.station.horizon import radius_around
from bgars.station.outline import as_outline, find_outline, refine_outline
from bgars.station.overexposed import HIDDEN, clipped_ground
from bgars.station.rim import sharpened

if TYPE_CHECKING:
    from bgars.records.capture import Capture
    from bgars.station.levels import Levels
    from bgars.station.outline import Outline

__all__ = ["NOT_SEEN_U_PX", "as_option", "joined", "stated_outline"]

Array = NDArray[np.float64]

WRONG_SIGMAS, WRONG_SHARE = 4.0, 0.01
"""A stated radius that differs by more from what the images show is doubted."""
NOT_SEEN_U_PX = 0.5
"""Uncertainty of a stated outline that the images do not show."""
SEEN_ARC = 0.5
COARSE = (4, 2)
"""An edge that is seen only where so many pixels are one is blurred over about as many."""


def as_option(circle_px: Array, height: int, width: int) -> str:
    """Return a circle (x, y, radius) as the option ``--outline`` takes it: columns and rows from the first pixel.

    Examples
    --------
    >>> as_option(np.array([0.0, 10.0, 40.0]), 101, 201)
    '--outline 100.0,40.0,40.0'
    """
    x, y, radius = circle_px
    return f"--outline {x + width / 2.0 - 0.5:.1f},{height / 2.0 - y - 0.5:.1f},{radius:.1f}"


def stated_outline(
    capture: Capture, levels: Levels, pictures: list[Array], circle: Array, steps: tuple[float, ...], name: str, *,
    matt: bool,
) -> tuple[Outline, list[Remark]]:  # fmt: skip
    """Return the outline that a stated circle stands for, and what contradicts it."""
    height, width = pictures[0].shape
    stated = f"{capture.name}: {name}: {as_option(circle, height, width)} is stated"
    share = 0.0 if matt else clipped_ground(levels, as_outline(circle))
    if share > HIDDEN:
        message = (
            f"{stated}, but the ground beside it is clipped ({100 * share:.0f} % of it, {100 * HIDDEN:.0f} % hides "
            "the edge): taken as stated; expose shorter"
        )
        remark = Remark("doubt", message, "overexposed-ground", share, HIDDEN)
        return as_outline(circle, NOT_SEEN_U_PX), [remark]
    seen = refine_outline(pictures, circle, steps)
    unseen = seen is None or seen.arc < SEEN_ARC
    if unseen:
        other = find_outline(pictures, None, steps)
        if other is None or other.arc <= SEEN_ARC or not _overlap(other.circle_px, circle):
            edge_px = _wide_edge_px(pictures, circle)
            message = f"{capture.name}: {name}: not seen in the images, taken as stated"
            remark = Remark("note", message, "outline-unseen")
            return replace(as_outline(circle, NOT_SEEN_U_PX), edge_px=edge_px), [remark]
        seen = other
    assert seen is not None
    around_px = None if matt else radius_around(levels, seen)
    outer = None if around_px is None else sharpened(levels, replace(seen, radius_px=around_px), matt=matt)
    shown = seen if outer is None else outer
    off = np.abs(shown.circle_px - circle)
    allowed = max(WRONG_SHARE * circle[2], WRONG_SIGMAS * math.hypot(seen.u_radius_px, NOT_SEEN_U_PX))
    if not unseen and off.max() <= allowed:
        return joined(sharpened(levels, seen, matt=matt), circle), []
    what = "an edge" if outer is None else "the horizon in the ball near it, and its edge"
    there = as_option(shown.circle_px, height, width)
    remark = Remark(
        "doubt", f"{stated}, but the images show {what} at {there}", "wrong-outline", float(off.max()), allowed, "px"
    )
    u_px = np.maximum(off, NOT_SEEN_U_PX)
    if unseen:
        u_px[:] = off.max()
    return replace(as_outline(circle), u_centre_px=float(u_px[:2].max()), u_radius_px=float(u_px[2])), [remark]


def joined(seen: Outline | None, stated_px: Array) -> Outline:
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


def _wide_edge_px(pictures: list[Array], circle: Array) -> float:
    """Width of an edge around a circle that is too soft to be seen at full resolution; NaN where there is none."""
    height, width = pictures[0].shape
    for count in COARSE:
        rows, cols = height // count, width // count
        top, left = (height - rows * count) // 2, (width - cols * count) // 2
        small = [
            picture[top : top + rows * count, left : left + cols * count]
            .reshape(rows, count, cols, count)
            .mean(axis=(1, 3))
            for picture in pictures
        ]
        seen = refine_outline(small, circle / count)
        if seen is not None and seen.arc >= SEEN_ARC:
            return count * seen.edge_px
    return math.nan
