"""All circles of balls in a capture: candidates, tests, silhouettes."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from bgars.balls.alike import fit_alike
from bgars.balls.constellation import shining_circles
from bgars.balls.highlights import mirrors_lights
from bgars.balls.mask_blobs import round_blobs
from bgars.balls.outward import outward_centres, slope_field
from bgars.balls.rim_fit import Circles
from bgars.balls.rim_pixels import sector_count
from bgars.balls.rim_scan import CoarseCircles, scan_rims, seen_by_most

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from bgars.balls.levels import Levels
    from bgars.records.pixels import BoolArray, FloatArray

    Slopes = tuple[FloatArray, FloatArray]

__all__ = [
    "MIN_SHARE",
    "MIN_SHARE_LIKE_OTHERS",
    "MIN_STRENGTH_LIKE_OTHERS",
    "SMALLEST_OF_USUAL",
    "Detection",
    "find_circles",
    "inside",
    "unfitted",
]

WORKING_SIZE_PX = 512
FLOOR_LEVELS = 2.0  # grey levels below which slopes fade: noise has none
SMALLEST_RADIUS_PX = 3.5
"""In the reduced images: fewer pixels show no rim."""
MIN_SHARE = 0.7  # of directions that show the rim
MIN_SHARE_LIKE_OTHERS = 0.45  # the same, where the size is that of the others
MIN_STRENGTH = 0.15  # step of the root of the grey level, lower quartile over directions
MIN_STRENGTH_LIKE_OTHERS = 0.08  # the same, where the size is that of the others
MIN_OUTWARD, MIN_ALIGNMENT = 0.3, 0.6  # mean outward slope of a disc, and how well slopes point outward
MIN_OUTWARD_CLIPPED, MIN_ALIGNMENT_CLIPPED, CLIPPED = 0.1, 0.9, 0.25
"""Where so much of a disc is clipped, slopes are small; their directions are left."""
OUTER_STRENGTH = 0.8  # of the strength of a rim inside: the rim around it wins
OUTER_STRENGTH_OF_HIGHLIGHTS = 0.35  # the same, around the small rims of highlights
HIGHLIGHT_RATIO = 2.5
"""A rim around another one wins from such a fraction of its strength on: highlights make strong rims inside balls, the
smaller the more likely."""
OUTER_SEEN = 0.35
"""Of the edge that most lights show of a rim inside: ends of shadows have a fifth, silhouettes half and more."""
MIN_SUPPORT = 0.5  # of sectors of the fitted rim
MIN_SUPPORT_IN_MASK = 0.85
"""A mask says that there is an object: round parts of it are no balls."""
MAX_U_RADIUS = 0.1  # standard uncertainty over radius from which on a circle is none
LIKE_OTHERS = (0.8, 1.25)  # ratio to the usual radius of circles like the others
SCALES_LIKE_OTHERS = (0.6, 3.0)  # ratio of scales to the usual radius that are worth a look
ODD_SIZE = 1.35  # ratio to the usual radius from which on a size is odd
USUAL_STRENGTH = 0.3  # of an odd rim's strength: a usual one that takes its place
ENOUGH_TO_JUDGE_SIZE = 3  # circles that have a usual size
SMALLEST_OF_USUAL = 0.35  # of the median radius: what is smaller is dirt
LIKE_SHINE, SHINING = 1.1, 0.5
"""Ratio of highlight circles that are alike, and the share of all balls that makes them the rule."""
INNER = 0.7
"""Of the highlight circle: where flat balls and caps have no rim yet, and mirrored board has none any more."""
COARSE_ERROR = 0.05
"""Standard deviation of a circle of coarse edges, in radii."""
MIN_COVERED = 0.97  # share of a disc that must lie in the mask
MOST_MIRRORS = 50


class Detection(NamedTuple):
    """Circles, and the reduced images they were found in.

    Attributes
    ----------
    circles : Circles
        In array coordinates of the full images.
    slopes : two (H', W') float32
        Slope along x and y (:func:`bgars.balls.outward.slope_field`).
    brightest : (H', W') float32
        Highest level over the lights.
    reduced : (L, H', W') float32
        Linear grey levels.
    factor : int
        Pixels of the full images a reduced pixel is wide.
    rejected : Circles
        What looked like a ball, but whose silhouette was not found.
    """

    circles: Circles
    slopes: Slopes
    brightest: FloatArray
    reduced: FloatArray
    factor: int
    rejected: Circles


def find_circles(levels: Levels, progress: Callable[[float], object] | None) -> Detection:
    """Find the silhouettes of all balls.

    Parameters
    ----------
    levels : Levels
        The capture.
    progress : callable or None
        Called with the fraction done.
    """
    report = progress or (lambda _: None)
    capture = levels.capture
    factor = max(1, max(levels.height, levels.width) // WORKING_SIZE_PX)
    reduced = levels.reduced(factor)
    report(0.15)
    pixel_um = None if capture.pixel_pitch_um is None else capture.pixel_pitch_um * factor
    slopes = slope_field(reduced, capture.rig, pixel_um, FLOOR_LEVELS)
    height, width = slopes[0].shape
    mask = None if capture.mask.all() else capture.mask[: height * factor : factor, : width * factor : factor]
    if mask is not None:
        slopes = (slopes[0] * mask, slopes[1] * mask)
    brightest = reduced.max(axis=0)
    blobs = None if mask is None else _blobs_that_are_balls(levels, slopes, reduced, factor)
    if blobs is not None and len(blobs.row):
        return Detection(blobs, slopes, brightest, reduced, factor, blobs.take(slice(0)))
    coarse = _coarse_circles(levels, reduced, slopes, mask)
    report(0.4)
    crumbs = np.zeros(len(coarse.row), np.bool_)
    if len(coarse.row) > ENOUGH_TO_JUDGE_SIZE:
        crumbs = coarse.radius_px <= SMALLEST_OF_USUAL * np.median(coarse.radius_px)
    coarse, small = _take(coarse, ~crumbs), _take(coarse, crumbs)
    row, col = ((column + 0.5) * factor - 0.5 for column in coarse[:2])
    circles = fit_alike(levels, row, col, coarse.radius_px * factor)
    good = circles.support >= (MIN_SUPPORT if mask is None else MIN_SUPPORT_IN_MASK)
    good &= circles.u_radius_px < MAX_U_RADIUS * circles.radius_px
    usual_px = np.median(circles.radius_px) if len(circles.row) else 1.0
    moved = np.abs(np.log(circles.radius_px / (coarse.radius_px * factor)))
    good &= np.minimum(moved, np.abs(np.log(circles.radius_px / usual_px))) < np.log(LIKE_OTHERS[1])
    report(0.95)
    rejected = circles.take(np.flatnonzero(~good)).join(unfitted(small, factor, circles.offsets_px.shape[1]))
    return Detection(circles.take(np.flatnonzero(good)), slopes, brightest, reduced, factor, rejected)


def unfitted(coarse: CoarseCircles, factor: int, sectors: int) -> Circles:
    """Circles as they are, in full pixels, with their share of the rim as support."""
    row, col = ((column + 0.5) * factor - 0.5 for column in coarse[:2])
    radius_px = coarse.radius_px * factor
    offsets, u_px = np.full((len(row), sectors), np.nan), COARSE_ERROR * radius_px
    return Circles(row, col, radius_px, u_px, u_px, coarse.share + 0.0, offsets)


def _blobs_that_are_balls(levels: Levels, slopes: Slopes, reduced: FloatArray, factor: int) -> Circles:
    """Round blobs of the mask whose inside slopes outward everywhere or mirrors the lights, as circles."""
    blobs = round_blobs(levels.capture.mask)
    row, col = ((column + 0.5) / factor - 0.5 for column in blobs[:2])
    seen = CoarseCircles(row, col, blobs.radius_px / factor, blobs.rms_px, blobs.rms_px)
    good = _slopes_outward(levels, seen, slopes)
    directions = levels.capture.rig.directions
    for index in np.flatnonzero(~good)[:MOST_MIRRORS]:
        disc = float(seen.row[index]), float(seen.col[index]), float(seen.radius_px[index])
        good[index] = mirrors_lights(reduced, directions, *disc)
    row, col, radius_px, rms_px = (column[good] for column in blobs)
    # Someone drew the mask: its outline may be off as a whole by as much as it is uneven.
    outline = np.sqrt(2.0 * np.pi * radius_px)
    return Circles(
        row,
        col,
        radius_px,
        rms_px * 2.0 / outline + 0.1,
        rms_px,
        np.ones(len(row)),
        np.full((len(row), sector_count(radius_px)), np.nan),
    )


def _coarse_circles(levels: Levels, reduced: FloatArray, slopes: Slopes, mask: BoolArray | None) -> CoarseCircles:
    """Circles to a pixel or two, in reduced pixels."""
    threads = levels.threads
    centres = np.array(outward_centres(*slopes)).reshape(-1, 4)
    centres = centres[_best_of_place(centres)]
    coarse = scan_rims(reduced, *centres[:, :3].T, threads=threads)
    coarse = _accepted(levels, reduced, coarse, slopes, MIN_SHARE, MIN_STRENGTH)
    if len(coarse.row) > 1:
        usual_px = float(np.median(coarse.radius_px))
        rest = centres[_outside(centres, coarse)]
        scale_px = np.full(len(rest), usual_px)
        more = scan_rims(reduced, rest[:, 0], rest[:, 1], scale_px, span=LIKE_OTHERS, rims=1, threads=threads)
        more = _take(more, np.abs(np.log(more.radius_px / usual_px)) < np.log(LIKE_OTHERS[1]))
        more = _accepted(levels, reduced, more, slopes, MIN_SHARE_LIKE_OTHERS, MIN_STRENGTH_LIKE_OTHERS)
        coarse = _merged(coarse, more, usual_px)
    coarse = _with_shining(coarse, _shining(levels, reduced, centres, slopes))
    if mask is not None:
        coarse = _take(coarse, _covered(coarse, mask) > MIN_COVERED)
    return coarse


def _shining(levels: Levels, reduced: FloatArray, centres: NDArray[np.float64], slopes: Slopes) -> CoarseCircles:
    """Circles of like highlights, in reduced pixels; none where fewer than a population has them."""
    shine = shining_circles(levels, reduced, *centres[:, :3].T)
    factor = levels.height // reduced.shape[1]
    row, col = ((column + 0.5) / factor - 0.5 for column in (shine.row, shine.col))
    every = CoarseCircles(row, col, shine.radius_px / factor, np.zeros(len(row)), np.ones(len(row)))
    if not len(row):
        return every
    usual_px = float(np.median(every.radius_px))
    every = _take(every, np.flatnonzero(np.abs(np.log(every.radius_px / usual_px)) < np.log(LIKE_SHINE)))
    return _take(every, np.flatnonzero(_slopes_outward(levels, every, slopes)))


def _with_shining(coarse: CoarseCircles, shining: CoarseCircles) -> CoarseCircles:
    """Both sets; circles inside those of highlights are the highlights themselves, which have rims, too."""
    distance = np.hypot(coarse.row[:, None] - shining.row, coarse.col[:, None] - shining.col)
    here = distance < np.maximum(coarse.radius_px[:, None], shining.radius_px)
    alone = int((~here.any(axis=1)).sum()) + len(shining.row)
    if len(shining.row) < max(ENOUGH_TO_JUDGE_SIZE, SHINING * alone):
        return coarse
    inner = here & (coarse.radius_px[:, None] < INNER * shining.radius_px)
    new = np.flatnonzero(~(here & ~inner).any(axis=0))
    kept = _take(coarse, np.flatnonzero(~inner.any(axis=1)))
    return CoarseCircles(*(np.concatenate(pair) for pair in zip(kept, _take(shining, new), strict=True)))


def _covered(coarse: CoarseCircles, mask: BoolArray) -> NDArray[np.float64]:
    """Fraction of each disc, and a little around it, that the mask leaves."""
    angles = np.arange(48) * (2 * np.pi / 48)
    radii = np.array([0.3, 0.6, 0.9, 1.05])
    y, x = (np.outer(radii, side(angles)).ravel() for side in (np.sin, np.cos))
    row = np.rint(coarse.row[:, None] - coarse.radius_px[:, None] * y).astype(np.intp).clip(0, mask.shape[0] - 1)
    col = np.rint(coarse.col[:, None] + coarse.radius_px[:, None] * x).astype(np.intp).clip(0, mask.shape[1] - 1)
    covered: NDArray[np.float64] = mask[row, col].mean(axis=1)
    return covered


def _accepted(
    levels: Levels,
    reduced: FloatArray,
    coarse: CoarseCircles,
    slopes: Slopes,
    share: float,
    strength: float,
) -> CoarseCircles:
    """Circles with a rim all around, whose inside slopes outward, one per place."""
    coarse = _take(
        coarse,
        (coarse.share >= share) & (coarse.strength >= strength) & (coarse.radius_px >= SMALLEST_RADIUS_PX),
    )
    coarse = _take(coarse, _slopes_outward(levels, coarse, slopes))
    return _without_overlaps(coarse, seen_by_most(reduced, coarse, levels.threads))


def _slopes_outward(levels: Levels, coarse: CoarseCircles, slopes: Slopes) -> NDArray[np.bool_]:
    """Whether the inside of each circle slopes outward: enough, or everywhere where it is clipped."""
    outward, alignment = inside(coarse, slopes)
    good: NDArray[np.bool_] = (outward >= MIN_OUTWARD) & (alignment >= MIN_ALIGNMENT)
    faint = np.flatnonzero(~good & (outward >= MIN_OUTWARD_CLIPPED) & (alignment >= MIN_ALIGNMENT_CLIPPED))
    if len(faint):
        factor = levels.height // slopes[0].shape[0]
        grid = np.linspace(-0.7, 0.7, 9)
        y, x = (side.ravel() for side in np.meshgrid(grid, grid))
        row = np.rint(factor * (coarse.row[faint, None] - coarse.radius_px[faint, None] * y)).astype(np.intp)
        col = np.rint(factor * (coarse.col[faint, None] + coarse.radius_px[faint, None] * x)).astype(np.intp)
        pixels = row.clip(0, levels.height - 1) * levels.width + col.clip(0, levels.width - 1)
        good[faint] = levels.clipped_at(pixels).mean(axis=(0, 2)) > CLIPPED
    return good


def inside(coarse: CoarseCircles, slopes: Slopes) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean outward slope inside each circle, and its fraction of the mean slope: 2/3 and 1 for a sphere."""
    radii = np.sqrt((np.arange(12) + 0.5) / 12)
    angles = np.arange(24) * (2 * np.pi / 24)
    x, y = (np.outer(radii, side(angles)).ravel() for side in (np.cos, np.sin))
    row = np.rint(coarse.row[:, None] - coarse.radius_px[:, None] * y).astype(np.intp)
    col = np.rint(coarse.col[:, None] + coarse.radius_px[:, None] * x).astype(np.intp)
    height, width = slopes[0].shape
    seen = (row >= 0) & (row < height) & (col >= 0) & (col < width)
    slope_x, slope_y = (slope[row.clip(0, height - 1), col.clip(0, width - 1)] * seen for slope in slopes)
    distance = np.hypot(x, y)
    outward = ((slope_x * x + slope_y * y) / distance).sum(axis=1)
    size = np.hypot(slope_x, slope_y).sum(axis=1)
    return outward / np.maximum(seen.sum(axis=1), 1), outward / np.maximum(size, 1e-9)


def _take(coarse: CoarseCircles, index: NDArray[np.generic]) -> CoarseCircles:
    return CoarseCircles(*(column[index] for column in coarse))


def _best_of_place(centres: NDArray[np.float64]) -> NDArray[np.intp]:
    """Indices of centres (best first) that no better one of about the same scale is next to."""
    keep: list[int] = []
    for index, (row, col, scale_px, _) in enumerate(centres):
        other = centres[keep]
        distance = np.hypot(other[:, 0] - row, other[:, 1] - col)
        ratio = scale_px / other[:, 2]
        if not ((distance < 0.3 * np.minimum(scale_px, other[:, 2]) + 1) & (np.abs(np.log2(ratio)) < 1)).any():
            keep.append(index)
    return np.array(keep, np.intp)


def _outside(centres: NDArray[np.float64], coarse: CoarseCircles) -> NDArray[np.intp]:
    """Indices of centres outside all circles, and of a scale that one like the others would have."""
    distance = np.hypot(centres[:, :1] - coarse.row, centres[:, 1:2] - coarse.col)
    ratio = centres[:, 2] / np.median(coarse.radius_px)
    odd = np.abs(np.log(coarse.radius_px / np.median(coarse.radius_px))) > np.log(ODD_SIZE)
    free = ((distance > coarse.radius_px) | odd).all(axis=1)
    return np.flatnonzero(free & (ratio > SCALES_LIKE_OTHERS[0]) & (ratio < SCALES_LIKE_OTHERS[1]))


def _merged(coarse: CoarseCircles, more: CoarseCircles, usual_px: float) -> CoarseCircles:
    """Both sets; one of the usual size takes the place of an odd one that it meets, if its rim is not much weaker."""
    distance = np.hypot(coarse.row[:, None] - more.row, coarse.col[:, None] - more.col)
    odd = np.abs(np.log(coarse.radius_px / usual_px)) > np.log(ODD_SIZE)
    meets = distance < 0.85 * np.minimum(coarse.radius_px[:, None] + more.radius_px, 1.3 * usual_px)
    better = more.strength >= USUAL_STRENGTH * coarse.strength[:, None]
    replaced = (meets & better & odd[:, None]).any(axis=1)
    kept = _take(coarse, ~replaced)
    distance, radius_px = distance[~replaced], kept.radius_px
    free = (distance >= 0.85 * (radius_px[:, None] + more.radius_px)).all(axis=0)
    return CoarseCircles(*(np.concatenate(pair) for pair in zip(kept, _take(more, free), strict=True)))


def _without_overlaps(coarse: CoarseCircles, seen: NDArray[np.float64]) -> CoarseCircles:
    """Keep the outer one of nested circles, and of those that run into each other the one with the stronger rim.

    `seen`: their edges that most lights show.
    """
    distance = np.hypot(coarse.row[:, None] - coarse.row, coarse.col[:, None] - coarse.col)
    radius = coarse.radius_px
    nested = (radius > 1.15 * radius[:, None]) & (distance < 0.35 * radius)
    # Rims of neighbours do not cross, ends of their shadows do.
    crossing = (distance > 0.7 * radius[:, None]) & (distance < radius[:, None] + 0.9 * radius)
    crossing &= (radius > 0.5 * radius[:, None]) & (coarse.strength > 0.5 * coarse.strength[:, None])
    nested &= ~np.any(crossing, axis=1)
    needed = np.where(radius > HIGHLIGHT_RATIO * radius[:, None], OUTER_STRENGTH_OF_HIGHLIGHTS, OUTER_STRENGTH)
    nested &= coarse.strength >= needed * coarse.strength[:, None]
    nested &= seen >= OUTER_SEEN * seen[:, None]
    inner = np.any(nested, axis=1)
    coarse = _take(coarse, ~inner)
    keep: list[int] = []
    crossed = np.any(crossing, axis=1)[~inner]
    for index in np.argsort(-coarse.strength * coarse.share * np.where(crossed, 0.3, 1.0)):
        apart = np.hypot(coarse.row[keep] - coarse.row[index], coarse.col[keep] - coarse.col[index])
        if not (apart < 0.85 * (coarse.radius_px[keep] + coarse.radius_px[index])).any():
            keep.append(int(index))
    return _take(coarse, np.array(keep, np.intp))
