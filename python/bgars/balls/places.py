"""Places without a ball, looked at once more: a ball that was overlooked, something else, or seen to be empty."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from bgars.balls.circles import (
    MIN_SHARE,
    MIN_SHARE_LIKE_OTHERS,
    MIN_STRENGTH_LIKE_OTHERS,
    SMALLEST_OF_USUAL,
    Detection,
    inside,
    unfitted,
)
from bgars.balls.highlights import highlight_circles
from bgars.balls.rim_fit import Circles, fit_rims, rim_costs
from bgars.balls.rim_scan import CoarseCircles, scan_rims

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bgars.balls.levels import Levels

    Array = NDArray[np.float64]

__all__ = ["SecondLook", "look_again"]

NEAR = 0.3
"""Farthest from its place, in pitches, that something still counts as being on it."""
MIN_SUPPORT = 1.0 / 3.0
"""Of a rim, where a ball belongs and something slopes as balls do: offsets of sectors without a rim are anywhere within
3 pixels, so that a tenth of them is near the circle by chance, and eight of 24 once in 400 times."""
ALONG, RIMS = 24, 2
"""Balls that are fitted along, and edges that are followed up on each place."""
SIZES, MOVED = (0.75, 1.3), 1.1
"""Of the usual radius, and the most that a fit goes from its edge, as a ratio."""
MAX_U_RADIUS = 0.1
"""Standard uncertainty of a radius, as a share of it, from which on a circle is none."""
BALL_SLOPE = 0.5
"""Outward slope, of the usual ball's, that a ball has: a coined one has half."""
EMPTY_SLOPE = 0.25
"""And that nothing that is seen to be empty has, however rough the board."""
BOARD_SIGMA = 3.0
"""Standard deviations of board beyond which a slope is no board."""
FLAT_SLOPE = 0.02
"""Least standard deviation of the slope of board: a degree, by which lights may be off."""
BOARD_DISC, FEWEST_BOARD = 0.6, 4
"""Radius of the discs of board between four balls, in radii, and how many show what board is like."""
MIN_SEEN = 0.9
"""Of a place that must be in the image, in the mask and not clipped."""


class SecondLook(NamedTuple):
    """What is on places: balls to add, and which of the places hold something that is no ball, or are not seen."""

    circles: Circles
    unclear: NDArray[np.bool_]


def look_again(levels: Levels, found: Detection, row: Array, col: Array, pitch_px: float) -> SecondLook:
    """Look for balls on places without one, and whether the others are seen to be empty.

    The statistic is the mean outward slope within a disc of the usual radius: 0 on a board and less in shadows, which
    fall inward; 2/3 on a matte sphere. A place is empty when it is no more than 3 standard deviations above the board
    between the balls and below a quarter of the usual ball, so close to the board and far from every ball. Everything
    else is unclear: places that are clipped, masked or cut by the image, and all of them where there is no ball to
    compare with.

    Parameters
    ----------
    levels : Levels
        The capture.
    found : Detection
        The balls there are.
    row, col : (M,) float64
        Places without a ball, in array coordinates.
    pitch_px : float
        Distance of neighbours.
    """
    balls = found.circles
    if not len(balls.row):
        return SecondLook(balls, np.ones(len(row), np.bool_))
    usual_px = float(np.median(balls.radius_px))
    slope_of_ball = float(np.median(_outward(found, balls.row, balls.col, usual_px)))
    limit = min(_board_limit(found, pitch_px, usual_px), EMPTY_SLOPE * slope_of_ball)
    outward = _outward(found, row, col, usual_px)
    apart = np.hypot(row[:, None] - found.rejected.row, col[:, None] - found.rejected.col)
    rejected: NDArray[np.bool_] = np.asarray(apart < NEAR * pitch_px)
    size = found.rejected.radius_px / usual_px
    crumbs = (rejected & (size > SMALLEST_OF_USUAL) & (size < SIZES[0])).any(axis=1)
    # Rings of highlights are no smaller balls.
    crumbs &= ~np.isfinite(highlight_circles(levels, row, col, np.full(len(row), usual_px)).radius_px)
    circles, at = _fitted(levels, found, row, col, usual_px)
    here = _outward(found, circles.row, circles.col, usual_px)
    good = (circles.support >= MIN_SUPPORT) & (circles.u_radius_px < MAX_U_RADIUS * circles.radius_px)
    good &= (circles.radius_px > SIZES[0] * usual_px) & (circles.radius_px < SIZES[1] * usual_px)
    good &= np.hypot(circles.row - row[at], circles.col - col[at]) < NEAR * pitch_px
    good &= (here >= BALL_SLOPE * slope_of_ball) & ~crumbs[at]
    apart = np.hypot(circles.row[:, None] - balls.row, circles.col[:, None] - balls.col)
    good &= (apart > 0.85 * (circles.radius_px[:, None] + balls.radius_px)).all(axis=1)
    best = [
        _likeliest(levels, circles, candidates)
        for candidates in (np.flatnonzero(good & (at == place)) for place in range(len(row)))
        if len(candidates)
    ]
    unclear = (outward > limit) | rejected.any(axis=1) | ~_seen(levels, row, col, usual_px)
    new = np.array(best, np.intp)
    unclear[at[new]] = False
    return SecondLook(circles.take(new), unclear)


def _outward(found: Detection, row: Array, col: Array, radius_px: float) -> Array:
    """(N,) mean outward slope within discs of the full images."""
    row, col = ((column + 0.5) / found.factor - 0.5 for column in (row, col))
    radii = np.full(len(row), radius_px / found.factor)
    return inside(CoarseCircles(row, col, radii, radii, radii), found.slopes)[0]


def _board_limit(found: Detection, pitch_px: float, usual_px: float) -> float:
    """Outward slope that board hardly ever has, from the middles between each two diagonal neighbours."""
    points = found.circles.col + 1j * found.circles.row
    apart = points[None, :] - points[:, None]
    diagonal = np.argwhere(np.abs(np.abs(apart) / pitch_px - np.sqrt(2.0)) < 0.1)  # noqa: PLR2004 - of a pitch
    middle = np.unique(np.round((points[diagonal[:, 0]] + points[diagonal[:, 1]]) / (0.2 * pitch_px))) * 0.2 * pitch_px
    if len(middle) < FEWEST_BOARD:
        return BOARD_SIGMA * FLAT_SLOPE
    slope = _outward(found, middle.imag, middle.real, BOARD_DISC * usual_px)
    usual = float(np.median(slope))
    spread = 1.48 * float(np.median(np.abs(slope - usual)))
    return max(usual, 0.0) + BOARD_SIGMA * max(spread, FLAT_SLOPE)


def _fitted(
    levels: Levels, found: Detection, row: Array, col: Array, usual_px: float
) -> tuple[Circles, NDArray[np.intp]]:
    """Silhouettes of about the usual radius near places, each where an edge is seen, and the index of its place."""
    balls, factor = found.circles, found.factor
    reduced_row, reduced_col = ((column + 0.5) / factor - 0.5 for column in (row, col))
    scale = np.full(len(row), usual_px / factor)
    edges = scan_rims(found.reduced, reduced_row, reduced_col, scale, span=SIZES, rims=RIMS, threads=levels.threads)
    seen = np.flatnonzero((edges.share >= MIN_SHARE_LIKE_OTHERS) & (edges.strength >= MIN_STRENGTH_LIKE_OTHERS))
    start_row, start_col = ((column[seen] + 0.5) * factor - 0.5 for column in (edges.row, edges.col))
    start_px = edges.radius_px[seen] * factor
    # Balls of the part go along: the model of the rim is pooled over all, and most places have no rim.
    some = slice(None, None, max(1, len(balls.row) // ALONG))
    along = zip((start_row, start_col, start_px), (balls.row, balls.col, balls.radius_px), strict=True)
    row, col, radius_px = (np.concatenate([start, ball[some]]) for start, ball in along)
    sectors = balls.offsets_px.shape[1]
    fitted = fit_rims(levels, row, col, radius_px, blur_px=balls.blur_px, sectors=sectors).take(slice(len(seen)))
    # Flat board fits anywhere: a rim is where an edge is, too. A complete edge that no rim fits is a ball's as it is.
    there = np.abs(np.log(fitted.radius_px / start_px)) < np.log(MOVED)
    whole = np.flatnonzero(~there & (edges.share[seen] >= MIN_SHARE))
    edges = CoarseCircles(*(column[seen] for column in edges))
    fitted.put(whole, unfitted(CoarseCircles(*(column[whole] for column in edges)), factor, sectors))
    there[whole] = True
    index = np.flatnonzero(there)
    return fitted.take(index), seen[index] // RIMS


def _likeliest(levels: Levels, circles: Circles, candidates: NDArray[np.intp]) -> int:
    """Of circles on one place, the one that explains the pixels around them best."""
    row, col, radius_px = (
        np.mean(column[candidates], keepdims=True) for column in (circles.row, circles.col, circles.radius_px)
    )
    tried = [circles.take(candidates[[index]]) for index in range(len(candidates))]
    costs = rim_costs(levels, row, col, radius_px, tried)
    return int(candidates[np.argmin(costs[:, 0])])


def _seen(levels: Levels, row: Array, col: Array, radius_px: float) -> NDArray[np.bool_]:
    """Whether places are in the image and the mask, and not clipped in most lights."""
    grid = np.linspace(-1.0, 1.0, 13)
    y, x = (side.ravel() for side in np.meshgrid(grid, grid))
    y, x = y[np.hypot(x, y) <= 1.0], x[np.hypot(x, y) <= 1.0]
    r = np.rint(row[:, None] - radius_px * y).astype(np.intp)
    c = np.rint(col[:, None] + radius_px * x).astype(np.intp)
    there = (r >= 0) & (r < levels.height) & (c >= 0) & (c < levels.width)
    pixels = r.clip(0, levels.height - 1) * levels.width + c.clip(0, levels.width - 1)
    there &= levels.capture.mask.reshape(-1)[pixels]
    there &= levels.clipped_at(pixels).mean(axis=0) < 0.5  # noqa: PLR2004 - most
    seen: NDArray[np.bool_] = there.mean(axis=1) >= MIN_SEEN
    return seen
