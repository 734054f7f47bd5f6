"""The outline of a ball: a circle found in the image, and where its edge lies to a fraction of a pixel."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

__all__ = ["Outline", "as_outline", "find_outline", "refine_outline"]

Array = NDArray[np.float64]

COARSE_PX = 200
"""Longer side of the image on which the circle is looked for."""
LEAST_SHARE, MOST_SHARE = 0.06, 0.62
"""Radii looked for, of the shorter side; more than half of it is a ball that is cut off."""
FAINT = 1e-3
"""Change of the logarithm of the level, over a pixel, that is no edge."""
VOTED_PX = 4.0
"""Pixels of that image beside a known outline whose edges are its own: three widths of the filter, and one."""
STRONGEST = 4000
"""Edge pixels that vote."""
WINDOWS = (0.10, 0.05, 0.025)
"""Half widths of the band in which the edge is looked for, of the radius, in turn."""
LEAST_WINDOW_PX, WIDE_EDGE = 3.0, 2.5
ROUNDS = 12
SCALE_PX = 0.25
"""Scatter of edge points beyond which they lose weight, unless all scatter more."""
LARGEST_SCALE_PX, LARGEST_SCALE_SHARE, LARGEST_SCALE_EDGE = 0.35, 0.004, 0.2
"""Scatter that an outline has at most: pixels, share of the radius, share of the width of its edge."""
SEEN = 3.0
"""Edge points count where they lie within so many scales."""
CORRELATED_POINTS = 3.0
"""Neighbouring edge points that share their error."""
FLOOR_PX = 0.015
"""What the grid of pixels leaves of an edge that is averaged over a whole outline."""
WAVES = (2, 3, 4)
"""Waves of an outline about its circle that say how well it is one: radius and centre are waves 0 and 1 of the same."""
PLAIN_ARC = 0.7
"""Share of an outline that makes it plain: of several plain circles around one centre the ball is the largest."""
ALIKE = 2.0
"""Pictures whose outline is so many times as uncertain have no say."""
MOVED_SHARE = 0.5
"""Uncertainty of what shading beside an edge moves it by, of that."""
SMOOTH_PX = 0.7
"""Width of the filter that takes slopes."""
LEAST_ARC = 0.35
"""Share of the outline that must be seen."""


@dataclass(frozen=True)
class Outline:
    """Outline of a ball: a circle, x right and y up from the image centre.

    Attributes
    ----------
    x_px, y_px, radius_px : float
        The circle.
    u_centre_px, u_radius_px : float
        Standard uncertainties, of either coordinate and of the radius.
    edge_px : float
        Width of the edge in the image, a standard deviation; NaN where it was not seen.
    arc : float
        Share of the circle on which the edge was seen.
    given : bool
        True where the caller stated it and the images do not show it.
    """

    x_px: float
    y_px: float
    radius_px: float
    u_centre_px: float
    u_radius_px: float
    edge_px: float = math.nan
    arc: float = 0.0
    given: bool = False

    @property
    def circle_px(self) -> Array:
        """(3,) x, y, radius."""
        return np.array([self.x_px, self.y_px, self.radius_px])

    @property
    def u_px(self) -> Array:
        """(3,) standard uncertainties of x, y, radius."""
        return np.array([self.u_centre_px, self.u_centre_px, self.u_radius_px])

    def inside(self, height: int, width: int) -> bool:
        """True where the whole circle is in an image of that size."""
        return bool(abs(self.x_px) + self.radius_px <= width / 2.0 and abs(self.y_px) + self.radius_px <= height / 2.0)


def as_outline(circle_px: Array, u_px: float = 0.5) -> Outline:
    """Return a circle (x, y, radius) that a caller states, known to `u_px`."""
    x, y, radius = (float(value) for value in circle_px)
    return Outline(x, y, radius, u_px, u_px, given=True)


def find_outline(
    pictures: list[Array],
    misfit: Callable[[Outline], float] | None = None,
    steps: Sequence[float] = (),
    beside: Outline | None = None,
) -> Outline | None:
    """Look for the outline of one ball in several pictures of it (H, W); None where there is no circle.

    `misfit` says how badly a circle explains what is inside it, where that can be told; else the ball is the largest
    of the plainest circles. Edges of a ball that is known already (`beside`) do not vote.
    """
    starts = [start for picture in pictures if (start := _vote(picture, beside)) is not None]
    # A mirror ball shows the horizon as a circle of 1 / sqrt(2) of its radius, often plainer than its own outline.
    starts += [start * [1.0, 1.0, math.sqrt(2.0)] for start in starts]
    found = [refined for start in starts if (refined := refine_outline(pictures, start, steps)) is not None]
    if misfit is not None and found:
        return min(found, key=misfit)
    return max(found, key=lambda one: min(one.arc, PLAIN_ARC) * one.radius_px, default=None)


def refine_outline(pictures: list[Array], start_px: Array, steps: Sequence[float] = ()) -> Outline | None:
    """Return where the edge lies around a circle (x, y, radius); None where too little of it is seen.

    `steps` are the grey levels by which each picture is rounded, in its own units: an edge of few of them is nowhere.
    """
    rounding = [*steps, *[0.0] * (len(pictures) - len(steps))]
    fits = [
        fit
        for picture, step in zip(pictures, rounding, strict=True)
        if (fit := _fit_edge(picture, start_px, step)) is not None
    ]
    if not fits:
        return None
    best = max(fits, key=lambda one: one.arc / one.u_radius_px)
    # Pictures that show the edge as well, in another light, see it elsewhere by as much as shading moves it.
    alike = [fit for fit in fits if fit.arc > 0.5 * best.arc and fit.u_radius_px < ALIKE * best.u_radius_px]
    spread = np.array([fit.circle_px for fit in alike]) - best.circle_px
    off = 0.5 * np.abs(spread).max(axis=0)
    return replace(
        best,
        u_centre_px=float(np.hypot(best.u_centre_px, min(max(off[0], off[1]), 0.5))),
        u_radius_px=float(np.hypot(best.u_radius_px, min(off[2], 0.5))),
    )


def _vote(picture: Array, beside: Outline | None = None) -> Array | None:
    """Circle on which most edges point to one centre (Duda & Hart 1972, with directions of edges)."""
    step = max(1, math.ceil(max(picture.shape) / COARSE_PX))
    height, width = picture.shape[0] // step, picture.shape[1] // step
    coarse = picture[: height * step, : width * step].reshape(height, step, width, step).mean(axis=(1, 3))
    top = float(np.percentile(coarse, 99.5))
    if not top > float(coarse.min()):
        return None
    tones = np.log(np.maximum(coarse, 0.0) + 0.02 * top)
    down, right = ndimage.gaussian_filter(tones, 1.0, order=(1, 0)), ndimage.gaussian_filter(tones, 1.0, order=(0, 1))
    size = np.hypot(down, right)
    if beside is not None:
        x = (np.arange(width) + 0.5) * step - picture.shape[1] / 2.0 - beside.x_px
        y = picture.shape[0] / 2.0 - (np.arange(height) + 0.5) * step - beside.y_px
        size[np.hypot(x[None, :], y[:, None]) < beside.radius_px + VOTED_PX * step] = 0.0
    places = np.argsort(size.ravel())[::-1][:STRONGEST]
    places = places[size.ravel()[places] > FAINT]
    if places.size == 0:
        return None
    rows, cols = np.unravel_index(places, size.shape)
    unit_row, unit_col = down[rows, cols] / size[rows, cols], right[rows, cols] / size[rows, cols]
    best, found = 0.0, None
    shorter = min(height, width)
    for radius in np.arange(max(4.0, LEAST_SHARE * shorter), MOST_SHARE * shorter, 0.5):
        votes = np.zeros((height, width))
        for sign in (-1.0, 1.0):
            at_row = np.rint(rows + sign * radius * unit_row).astype(int)
            at_col = np.rint(cols + sign * radius * unit_col).astype(int)
            use = (at_row >= 0) & (at_row < height) & (at_col >= 0) & (at_col < width)
            np.add.at(votes, (at_row[use], at_col[use]), 1.0)
        votes = ndimage.uniform_filter(votes, 3) * 9.0
        place = int(votes.argmax())
        score = float(votes.flat[place]) / math.sqrt(radius)
        if score > best:
            best, found = score, (*divmod(place, width), radius)
    if found is None:
        return None
    row, col, radius = found
    height_px, width_px = picture.shape
    x = (col + 0.5) * step - width_px / 2.0
    y = height_px / 2.0 - (row + 0.5) * step
    return np.array([x, y, radius * step])


def _fit_edge(picture: Array, start_px: Array, step: float = 0.0) -> Outline | None:
    """Robust circle through the steepest places along rays from the centre (Cauchy weights)."""
    circle = np.array(start_px, dtype=np.float64)
    fit: Outline | None = None
    for share in WINDOWS:
        # An edge that is wider than the band would look like none.
        half = max(share * circle[2], LEAST_WINDOW_PX, 0.0 if fit is None else WIDE_EDGE * fit.edge_px)
        edge = _edge_points(picture, circle, half)
        if len(edge.angles) < 12:  # noqa: PLR2004 - three unknowns, and something to judge them by
            return None
        points = circle[:2] + edge.radii[:, None] * np.column_stack([np.cos(edge.angles), np.sin(edge.angles)])
        try:
            fit = _circle(points, edge, circle, _rays(circle[2]), step)
        except np.linalg.LinAlgError:  # edges all on one side, or a circle that ran away: none
            return None
        if fit is None:
            return None
        if (
            abs(fit.radius_px - circle[2]) > 2.0 * half
            or np.hypot(fit.x_px - circle[0], fit.y_px - circle[1]) > 2 * half
        ):
            return None
        circle = fit.circle_px
    return fit


def _rays(radius_px: float) -> int:
    return int(np.clip(2.0 * math.pi * radius_px / 1.5, 90, 2000))


class _Edge(NamedTuple):
    """The strongest edge on each ray that shows one."""

    angles: Array
    radii: Array
    widths_px: Array
    rises: Array
    """Change of level across it."""
    shading_px: Array
    """From its steepest place to where half of the rise is reached: 0 of a plain step."""


def _edge_points(picture: Array, circle: Array, half_px: float) -> _Edge:
    height, width = picture.shape
    count = _rays(circle[2])
    angles = np.arange(count) * 2.0 * math.pi / count
    step = 0.25
    radii = np.arange(circle[2] - half_px, circle[2] + half_px + step / 2, step)
    x = circle[0] + radii[None, :] * np.cos(angles)[:, None]
    y = circle[1] + radii[None, :] * np.sin(angles)[:, None]
    rows, cols = height / 2.0 - 0.5 - y, x + width / 2.0 - 0.5
    values = ndimage.map_coordinates(picture, [rows, cols], order=1, mode="nearest")
    off = (rows < 1) | (rows > height - 2) | (cols < 1) | (cols > width - 2)
    signed = ndimage.gaussian_filter1d(values, SMOOTH_PX / step, axis=1, order=1) / step
    slope = np.abs(signed)
    slope[off] = 0.0
    slope[:, :2] = slope[:, -2:] = 0.0
    at = slope.argmax(axis=1)
    lines = np.arange(count)
    peak = slope[lines, at]
    around = np.percentile(slope, 20.0, axis=1)
    use = (peak > 3.0 * around + 1e-9) & (peak > 0.1 * np.percentile(peak, 90)) & (at > 1) & (at < len(radii) - 2)
    if not use.any():
        return _Edge(*(angles[:0],) * 5)
    before, middle, after = slope[lines, at - 1], peak, slope[lines, np.minimum(at + 1, len(radii) - 1)]
    bend = before - 2.0 * middle + after
    shift = np.where(bend < 0, 0.5 * (before - after) / np.where(bend < 0, bend, -1.0), 0.0)
    radius = radii[at] + step * np.clip(shift, -1.0, 1.0)
    # A blurred step has slope (rise / s) / sqrt(2 pi): its width from its height and its rise.
    near = np.abs(radii[None, :] - radius[:, None]) < 1.0 + 0.25 * half_px
    rise = np.maximum(slope.sum(axis=1, where=near) * step, 1e-12)
    wide = rise / np.maximum(peak, 1e-12) / math.sqrt(2.0 * math.pi)
    # Of a plain step the steepest place is where half of the rise is reached; shading and dark rims part the two.
    away = [round(side * (2.5 * float(np.median(wide[use])) + 0.5) / step) for side in (-1, 1)]
    levels = ndimage.gaussian_filter1d(values, SMOOTH_PX / step, axis=1)
    half_level = 0.5 * (_at(levels, at + away[0]) + _at(levels, at + away[1]))
    gap = (half_level - levels[lines, at]) / np.where(use, signed[lines, at], 1.0)
    shading = np.clip(gap, -0.5 * half_px, 0.5 * half_px)
    blur = np.sqrt(np.maximum(wide**2 - SMOOTH_PX**2, 0.0))
    return _Edge(angles[use], radius[use], blur[use], rise[use], shading[use])


def _at(lines: Array, places: NDArray[np.intp]) -> Array:
    """(N,) value of each line at its place."""
    value: Array = lines[np.arange(len(lines)), np.clip(places, 2, lines.shape[1] - 3)]
    return value


def _circle(points: Array, edge: _Edge, start: Array, count: int, step: float) -> Outline | None:
    circle = start.copy()
    scale = SCALE_PX
    for _ in range(ROUNDS):
        offset = points - circle[:2]
        distance = np.hypot(*offset.T)
        off = distance - circle[2]
        scale = max(SCALE_PX, 1.4826 * float(np.median(np.abs(off - np.median(off)))))
        weight = 1.0 / (1.0 + (off / scale) ** 2)
        rows = np.column_stack([offset / distance[:, None], np.ones(len(points))])
        normal = rows.T @ (weight[:, None] * rows)
        circle = circle + np.linalg.solve(normal, rows.T @ (weight * off))
    offset = points - circle[:2]
    off = np.hypot(*offset.T) - circle[2]
    # Edges of noise scatter over the whole band: they are no outline, however many there are.
    soft_px = LARGEST_SCALE_EDGE * float(np.median(edge.widths_px))
    good = np.abs(off) < SEEN * min(scale, max(LARGEST_SCALE_PX, LARGEST_SCALE_SHARE * circle[2], soft_px))
    arc = float(good.sum()) / count
    if arc < LEAST_ARC:
        return None
    rows = np.column_stack([offset[good] / np.hypot(*offset[good].T)[:, None], np.ones(int(good.sum()))])
    rms = float(np.sqrt(np.mean(off[good] ** 2)))
    edge_px = float(np.median(edge.widths_px[good]))
    covariance = rms**2 * CORRELATED_POINTS * np.linalg.inv(rows.T @ rows)
    u = np.sqrt(np.diag(covariance))
    waves_px = _waves_px(np.arctan2(*offset[good].T[::-1]), off[good])
    # Half a step of rounding, or a black that is cut off, moves an edge of one pixel by its share of the rise.
    rounded_px = step * max(1.0, edge_px) / float(np.median(edge.rises[good]))
    # Shading and dark rims move the steepest place about as far to one side as half of the rise lies to the other.
    usual = float(np.median(edge.shading_px[good]))
    reach_px = 3.0 * (1.4826 * float(np.median(np.abs(edge.shading_px[good] - usual))) + FLOOR_PX)
    gap_px = np.clip(edge.shading_px[good], usual - reach_px, usual + reach_px)
    moved_px, *_ = np.linalg.lstsq(rows, gap_px, rcond=None)
    circle = circle - moved_px
    u_moved = MOVED_SHARE * np.abs(moved_px)
    return Outline(
        float(circle[0]),
        float(circle[1]),
        float(circle[2]),
        float(np.linalg.norm([max(u[0], u[1]), FLOOR_PX, waves_px, rounded_px, max(u_moved[:2])])),
        float(np.linalg.norm([u[2], FLOOR_PX, waves_px, rounded_px, u_moved[2]])),
        edge_px,
        arc,
    )


def _waves_px(angles: Array, off_px: Array) -> float:
    """Root mean square amplitude of the low waves of an outline about its circle, above what scatter makes of them."""
    columns = [wave(n * angles) for n in WAVES for wave in (np.cos, np.sin)]
    rows = np.column_stack([np.ones(len(angles)), np.cos(angles), np.sin(angles), *columns])
    normal = rows.T @ rows + 0.05 * len(angles) * np.diag([0.0] * 3 + [1.0] * len(columns))
    found = np.linalg.solve(normal, rows.T @ off_px)[3:]
    scatter = 2.0 * CORRELATED_POINTS * float(np.mean(off_px**2)) / len(angles)
    return math.sqrt(max(float(np.mean(found**2)) - scatter, 0.0))
