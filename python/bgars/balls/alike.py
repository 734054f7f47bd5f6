"""Balls of one part judge each other: weak silhouettes against highlights, and against the usual radius."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bgars.balls.highlights import HighlightCircles, highlight_circles
from bgars.balls.pooled_rim import COST_SCALE, POOLED_ERROR, RATIO_ERROR, pooled_ratio
from bgars.balls.rim_fit import Circles, fit_rims, rim_costs

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bgars.balls.levels import Levels

    Array = NDArray[np.float64]

__all__ = ["fit_alike"]

ENOUGH = 4
"""Balls that make a population."""
OTHER_START = 1.3  # radii to start from where the first show no highlights
MIN_SUPPORT = 0.5  # of sectors: a rim that counts
SHOULDER, SHOULDER_OF_USUAL, SHOULDER_OF_FEW = 0.8, 0.93, 0.75
"""Of the highlights' radius: smaller circles are shoulders of highlights. Wide lobes make that radius 13 % too large;
a ball flattened to 0.8 would look the same among few."""
SLIPPED = 0.04
"""Difference from the ratio of all rims together, as a fraction, of a fit that ended at another edge."""
START_ERROR = 0.04
"""What circles to start from are wrong by in common, as a fraction of their radius."""
SHOULDER_CLEAR = 0.84
"""Of the highlights' radius: metal mirrors the horizon at 0.71 and the nearest board up to here."""
FLATTENED = 0.7  # flattest silhouette, of the highlights' radius
USUAL = 0.04  # difference from the median highlight radius, as a fraction
HALF_VECTOR_BIAS = 0.06
"""Largest usual difference of the highlights' radius, as a fraction: off-specular peaks and wide lobes."""
DIFFERS_SIGMA, CENTRES_DIFFER_SIGMA = 3.0, 4.0
"""What radii and centres (two coordinates, and many balls) must differ by."""
SHAPE = 0.003
"""Standard deviation of radius ratios of real balls, which are not quite spheres."""
FAR = 1.5
"""Multiple of the limit of what agrees at which a silhouette counts as wholly elsewhere."""
UNSURE, SURE = 0.83, 0.92
"""Support of a rim that proves nothing, and of a complete one."""
CENTRE_DIFFERS = 0.015  # of the radius: a silhouette that lies aside of its highlights
BETTER_SUPPORT = 0.1  # of sectors: more, or less, that counts
REPLACED_U = 2.0  # factor on the uncertainty of what takes a silhouette's place
WORTH_A_TRY_PX = 0.05
"""Distance from the highlights' centre from which on a fit that starts there may end elsewhere."""


def _fit_again(levels: Levels, circles: Circles, row: Array, col: Array, radius_px: Array) -> Circles:
    """Fit rims from other starts, with the blur and the sectors of `circles`."""
    sectors = circles.offsets_px.shape[1]
    return fit_rims(levels, row, col, radius_px, blur_px=circles.blur_px, sectors=sectors)


def fit_alike(levels: Levels, row: Array, col: Array, radius_px: Array) -> Circles:
    """Silhouettes of all balls, checked against each other.

    On metal the rim is a grey level or two, and the shoulder of a highlight passes for it. Highlights tell: their
    centre is the ball's, and their radius is the silhouette's times a factor that all balls share.

    Parameters
    ----------
    levels : Levels
        The capture.
    row, col, radius_px : (N,) float64
        Circles to start from, good to a tenth of the radius, most of them.
    """
    if not len(row):
        return fit_rims(levels, row, col, radius_px)
    start_px = radius_px
    every = _highlights(levels, row, col, radius_px)
    shine = _of_usual_size(every)
    shines = np.isfinite(shine.radius_px)
    pooled = None
    circles = fit_rims(levels, row, col, radius_px)
    if shines.sum() >= max(ENOUGH, MIN_SUPPORT * len(row)) and not _clear(circles, shine):
        pooled = pooled_ratio(levels, HighlightCircles(*(column[shines] for column in shine)))
        row, col = np.where(shines, shine.row, row), np.where(shines, shine.col, col)
        radius_px = np.where(shines, pooled * shine.radius_px, radius_px)
        circles = fit_rims(levels, row, col, radius_px)
        _take_back_slips(levels, circles, row, col, radius_px, shines)
    if shines.any():
        _past_shoulders(levels, circles, every, shine, pooled)
    if shines.sum() >= ENOUGH:
        _agree_with_highlights(levels, circles, shine, pooled)
    _agree_with_centres(levels, circles, every, np.isfinite(every.radius_px) & ~shines)
    if pooled is not None:
        _rely_on_highlights(circles, every, pooled, float(np.median(shine.radius_px[shines])))
    _agree_with_radius(levels, circles, shines if shines.sum() >= ENOUGH else np.zeros_like(shines))
    if pooled is None:
        # Rims that all lie elsewhere than the edges looked for first may be the ends of shadows close by.
        moved = abs(float(np.median(circles.radius_px / start_px)) - 1.0)
        circles.u_radius_px = np.hypot(circles.u_radius_px, max(moved - START_ERROR, 0.0) * circles.radius_px)
    return circles


def _clear(circles: Circles, shine: HighlightCircles) -> bool:
    """Whether rims are complete, and all in one ratio to the highlights that is no shoulder's."""
    shines = np.isfinite(shine.radius_px)
    ratio = circles.radius_px[shines] / shine.radius_px[shines]
    usual = float(np.median(ratio))
    alike = float(np.mean(np.abs(ratio / usual - 1.0) < SLIPPED))
    return float(np.median(circles.support[shines])) >= UNSURE and alike >= UNSURE and usual > SHOULDER_CLEAR


def _past_shoulders(
    levels: Levels, circles: Circles, every: HighlightCircles, shine: HighlightCircles, pooled: float | None
) -> None:
    """Fit circles once more, from their highlights' size, that are so much smaller that they are shoulders."""
    shines = np.isfinite(shine.radius_px)
    ratio = circles.radius_px / shine.radius_px
    usual = float(np.nanmedian(ratio)) if pooled is None else pooled
    few = shines.sum() < ENOUGH
    far = shines & (ratio < (SHOULDER_OF_FEW if few else max(SHOULDER, SHOULDER_OF_USUAL * usual)))
    odd = np.isfinite(every.radius_px) & ~shines
    far = (far & (pooled is None)) | (odd & (circles.radius_px < FLATTENED * usual * every.radius_px))
    for factor in (1.0, 1.0 - HALF_VECTOR_BIAS, 0.8):
        index = np.flatnonzero(far)
        again = _fit_again(levels, circles, every.row[index], every.col[index], factor * every.radius_px[index])
        # The silhouette is the outermost circle: shoulders of highlights lie inside it.
        better = (
            (again.support >= MIN_SUPPORT)
            & (again.radius_px > 1.04 * circles.radius_px[index])
            & (again.radius_px > FLATTENED * every.radius_px[index])
        )
        better &= again.support >= circles.support[index] - BETTER_SUPPORT
        circles.put(index[better], again.take(np.flatnonzero(better)))


def _take_back_slips(
    levels: Levels, circles: Circles, row: Array, col: Array, radius_px: Array, shines: NDArray[np.bool_]
) -> None:
    """Put circles of highlights back to where they started that explain their pixels worse than before the fit."""
    nothing, offsets = np.zeros_like(row), np.full_like(circles.offsets_px, np.nan)
    u_px = RATIO_ERROR * radius_px
    start = Circles(row, col, radius_px, u_px, u_px, nothing, offsets, blur_px=circles.blur_px)
    costs = rim_costs(levels, row, col, radius_px, [start, circles])
    far = np.abs(circles.radius_px / radius_px - 1.0) > 2.0 * POOLED_ERROR
    slipped = np.flatnonzero(shines & far & (costs[1] > costs[0]))
    circles.put(slipped, start.take(slipped))


def _agree_with_centres(levels: Levels, circles: Circles, shine: HighlightCircles, odd: NDArray[np.bool_]) -> None:
    """Fit odd circles once more that are not around their highlights; what stays elsewhere takes their centre."""
    off = np.hypot(circles.row - shine.row, circles.col - shine.col)
    index = np.flatnonzero(odd & (off > np.maximum(CENTRE_DIFFERS * circles.radius_px, 3.0 * circles.u_centre_px)))
    if not len(index):
        return
    again = _fit_again(levels, circles, shine.row[index], shine.col[index], shine.radius_px[index])
    closer = np.hypot(again.row - shine.row[index], again.col - shine.col[index]) < 0.5 * off[index]
    closer &= (again.support >= circles.support[index] - BETTER_SUPPORT) & (again.support >= MIN_SUPPORT)
    circles.put(index[closer], again.take(np.flatnonzero(closer)))
    index = index[~closer]
    circles.row[index], circles.col[index] = shine.row[index], shine.col[index]
    circles.u_radius_px[index] = np.hypot(circles.u_radius_px[index], off[index])
    circles.u_centre_px[index] = np.hypot(shine.u_centre_px[index], SHAPE * shine.radius_px[index])


def _rely_on_highlights(circles: Circles, every: HighlightCircles, pooled: float, usual_px: float) -> None:
    """Give circles without a rim those of their highlights: a smaller ball's, or between a larger and a flat one's."""
    ratio = every.radius_px / usual_px
    index = np.flatnonzero((circles.support < MIN_SUPPORT) & (ratio > FLATTENED) & (ratio < 1.0 / FLATTENED))
    flat_px = np.maximum(every.radius_px[index] - usual_px, 0.0)
    circles.row[index], circles.col[index] = every.row[index], every.col[index]
    circles.radius_px[index] = pooled * (every.radius_px[index] - flat_px / 2.0)
    circles.u_radius_px[index] = np.hypot(RATIO_ERROR * every.radius_px[index], flat_px / 2.0)
    circles.u_centre_px[index] = np.hypot(every.u_centre_px[index], SHAPE * every.radius_px[index])
    circles.support[index] = MIN_SUPPORT


def _of_usual_size(shine: HighlightCircles) -> HighlightCircles:
    """Without those of unusual radius: odd balls, and flattened ones, whose highlights lie at R / flattening."""
    if np.isfinite(shine.radius_px).sum() < ENOUGH:
        return shine
    unusual = np.abs(np.log(shine.radius_px / np.nanmedian(shine.radius_px))) > USUAL
    return HighlightCircles(*(np.where(unusual, np.nan, column) for column in shine))


def _highlights(levels: Levels, row: Array, col: Array, radius_px: Array) -> HighlightCircles:
    """Highlight circles from the radii as they are, and from larger ones where that shows nothing."""
    shine = highlight_circles(levels, row, col, radius_px)
    start_px = OTHER_START * radius_px
    if np.isfinite(shine.radius_px).mean() > MIN_SUPPORT:
        start_px = np.full(len(row), float(np.nanmedian(shine.radius_px)))
    index = np.flatnonzero(~np.isfinite(shine.radius_px))
    if len(index):
        again = highlight_circles(levels, row[index], col[index], start_px[index])
        for column, other in zip(shine, again, strict=True):
            column[index] = other
    return shine


def _agree_with_highlights(levels: Levels, circles: Circles, shine: HighlightCircles, pooled: float | None) -> None:
    """Fit circles once more, or replace them, that are elsewhere than the highlights have them; then take means."""
    shines = np.isfinite(shine.radius_px)
    for turn in range(2):
        ratio, spread, shift, shift_px = _relation(circles, shine, pooled)
        expected = HighlightCircles(
            shine.row + shift[0], shine.col + shift[1], shine.radius_px * ratio, shine.u_centre_px, shine.u_radius_px
        )
        off_radius = np.abs(circles.radius_px - expected.radius_px)
        off_centre = np.hypot(circles.row - expected.row, circles.col - expected.col)
        u_shine_radius, u_shine_centre, birge = _own_uncertainty(circles, shine, spread, shift_px)
        u_radius = np.hypot(u_shine_radius, circles.u_radius_px)
        u_centre = np.hypot(u_shine_centre, birge * circles.u_centre_px)
        off = np.fmax(
            off_radius / np.maximum(DIFFERS_SIGMA * u_radius, 0.1),
            off_centre / np.maximum(CENTRES_DIFFER_SIGMA * u_centre, 0.1),
        )
        if turn == 0:
            _try_from(levels, circles, expected, np.flatnonzero(shines & ((off > 1.0) | (off_centre > WORTH_A_TRY_PX))))
    # Silhouettes that stay elsewhere: a complete rim is a fact (a flat or odd ball), an incomplete one is not. By
    # degrees: a silhouette at a limit must not jump to its highlights, or back, by rounding.
    far = np.where(shines, np.clip((off - 1.0) / (FAR - 1.0), 0.0, 1.0), 0.0)
    sure = np.clip((circles.support - UNSURE) / (SURE - UNSURE), 0.0, 1.0)
    sure *= np.clip(3.0 - circles.u_radius_px / np.median(circles.u_radius_px[shines]), 0.0, 1.0)
    common = _common_uncertainty(spread, shine, circles, shines & (far < 0.5))  # noqa: PLR2004
    if spread == POOLED_ERROR:
        common = np.hypot(common, POOLED_ERROR * circles.radius_px)

    def joined(shift: Array, own: Array, other: Array) -> tuple[Array, Array]:
        """How far to shift a silhouette's coordinate by, and its uncertainty."""
        weight = (1.0 - far) / (1.0 + (other / own) ** 2) + far * (1.0 - sure)
        mean = 1.0 / (1.0 / own**2 + 1.0 / other**2)
        apart = far * (sure * own**2 + (1.0 - sure) * (REPLACED_U * other) ** 2)
        u = np.sqrt((1.0 - far) * mean + apart + far * (1.0 - far) * shift**2)
        return np.where(shines, weight * shift, 0.0), np.where(shines, u, own)

    step, u = joined(expected.radius_px - circles.radius_px, circles.u_radius_px, u_shine_radius)
    circles.radius_px += step
    circles.u_radius_px = np.where(shines, np.hypot(u, np.sqrt(1.0 - far * sure) * common), u)
    (row, u_row), (col, u_col) = (
        joined(shift, circles.u_centre_px, u_shine_centre)
        for shift in (expected.row - circles.row, expected.col - circles.col)
    )
    circles.row += row
    circles.col += col
    circles.u_centre_px = np.sqrt((u_row**2 + u_col**2) / 2.0)
    replaced = far * (1.0 - sure) > 0.5  # noqa: PLR2004
    replaced |= shines & (pooled is not None)
    circles.support = np.where(replaced, np.maximum(circles.support, MIN_SUPPORT), circles.support)


def _try_from(levels: Levels, circles: Circles, expected: HighlightCircles, index: NDArray[np.intp]) -> None:
    """Fit some circles once more from where the highlights have them; the mean of both fits, weighted by likelihood.

    Not the better one of both: a choice between two that are about as good would hang on rounding.
    """
    if not len(index):
        return
    start = HighlightCircles(*(column[index] for column in expected))
    again = _fit_again(levels, circles, start.row, start.col, start.radius_px)
    first = circles.take(index)
    # Compared around the highlights' circle: around a shoulder inside the ball, the shoulder is the better rim.
    costs = rim_costs(levels, start.row, start.col, start.radius_px, [first, again])
    share = 1.0 / (1.0 + np.exp(np.clip((costs[1] - costs[0]) / COST_SCALE, -50.0, 50.0)))
    for name in ("row", "col", "radius_px", "u_centre_px", "u_radius_px", "support"):
        mine, other = getattr(first, name), getattr(again, name)
        getattr(circles, name)[index] = mine + share * (other - mine)
    circles.offsets_px[index] = np.where(share[:, None] > 0.5, again.offsets_px, first.offsets_px)  # noqa: PLR2004


def _own_uncertainty(
    circles: Circles, shine: HighlightCircles, spread: float, shift_px: float
) -> tuple[Array, Array, float]:
    """Uncertainties of highlight radii and centres.

    Disorder, balls that are no spheres, and of the spread against the silhouettes what these do not account for.
    """
    good = np.isfinite(shine.radius_px)
    usual = np.median(shine.radius_px[good])
    more_radius = max((spread * usual) ** 2 - float(np.median(circles.u_radius_px[good])) ** 2, 0.0)
    # Centres scatter by more than both state: both are then wrong by the same factor (Birge 1932).
    stated = np.median(np.hypot(shine.u_centre_px[good], circles.u_centre_px[good]))
    birge = max(shift_px / max(float(stated), 1e-9), 1.0)
    return (
        np.sqrt(shine.u_radius_px**2 + (SHAPE * shine.radius_px) ** 2 + more_radius),
        birge * shine.u_centre_px,
        birge,
    )


def _common_uncertainty(spread: float, shine: HighlightCircles, circles: Circles, joined: NDArray[np.bool_]) -> Array:
    """What all radii share: the error of the ratio, and of the rim model."""
    number = max(int(joined.sum()), 1)
    own = np.minimum(circles.u_radius_px, RATIO_ERROR * circles.radius_px)
    shared = float(np.median(own[joined])) / 2.0 if joined.any() else 0.0
    common: Array = np.hypot(spread * np.nan_to_num(shine.radius_px) / np.sqrt(number), shared)
    return common


def _relation(circles: Circles, shine: HighlightCircles, pooled: float | None) -> tuple[float, float, Array, float]:
    """Ratio of silhouette to highlight radius, its spread, shift (row, column) of centres, its spread; medians."""
    good = np.isfinite(shine.radius_px) & (circles.support >= MIN_SUPPORT)
    if pooled is not None:
        good &= np.abs(circles.radius_px / shine.radius_px / pooled - 1.0) < SLIPPED
        if good.sum() < ENOUGH:
            return pooled, POOLED_ERROR, np.zeros(2), float(np.nanmedian(shine.u_centre_px))
    if good.sum() < ENOUGH:
        good = np.isfinite(shine.radius_px)
    ratio = circles.radius_px[good] / shine.radius_px[good]
    # The half with the smaller uncertainties says more of the ratio; a shift is in all alike.
    sharp = circles.u_radius_px[good] <= np.median(circles.u_radius_px[good])
    middle = float(np.median(ratio[sharp]))
    shifts = np.stack([circles.row[good] - shine.row[good], circles.col[good] - shine.col[good]])
    shift = np.median(shifts, axis=1)
    spread = 1.48 * float(np.median(np.abs(ratio - middle)))
    shift_px = 1.48 * float(np.median(np.abs(shifts - shift[:, None])))
    # Lights all around cancel what lobes shift; only a clear shift is believed. What rims mirror is alike in all.
    doubt = shift_px**2 * 1.6 / max(int(good.sum()), 1) + float(np.median(circles.u_centre_px[good])) ** 2
    shift *= max(0.0, 1.0 - 2.0 * doubt / max(float(shift @ shift), 1e-12))
    return middle, spread, shift, shift_px


def _agree_with_radius(levels: Levels, circles: Circles, judged: NDArray[np.bool_]) -> None:
    """Fit circles once more from the usual radius that are off it; odd ones stay where their rim is the clearer."""
    if len(circles.row) < ENOUGH:
        return
    usual_px = float(np.median(circles.radius_px))
    spread_px = 1.48 * float(np.median(np.abs(circles.radius_px - usual_px)))
    off = np.abs(circles.radius_px - usual_px)
    index = np.flatnonzero((off > np.maximum(4.0 * spread_px, 0.03 * usual_px)) & ~judged)
    ratio = circles.radius_px[index] / usual_px
    index = index[(ratio > 0.6) & (ratio < 1.35)]  # noqa: PLR2004 - others are no slips
    if not len(index):
        return
    start_px = np.full(len(index), usual_px)
    again = _fit_again(levels, circles, circles.row[index], circles.col[index], start_px)
    usual = np.abs(again.radius_px - usual_px) < np.maximum(4.0 * spread_px, 0.03 * usual_px)
    better = usual & (again.support >= circles.support[index] + BETTER_SUPPORT)
    # Ends of shadows make circles, too, as complete as a rim but in fewer lights at once.
    first = circles.take(index)
    row, col = (first.row + again.row) / 2.0, (first.col + again.col) / 2.0
    costs = rim_costs(levels, row, col, (first.radius_px + again.radius_px) / 2.0, [first, again])
    better |= usual & (again.support >= first.support - BETTER_SUPPORT) & (costs[1] < costs[0])
    circles.put(index[better], again.take(np.flatnonzero(better)))
