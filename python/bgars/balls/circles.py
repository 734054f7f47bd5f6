"""All circles of balls in a capture: candidates, tests, silhouettes."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from bgars.balls.alike import fit_alike
from bgars.balls.highlights import mirrors_lights
from bgars.balls.mask_blobs import round_blobs
from bgars.balls.outward import outward_centres, slope_field
from bgars.balls.rim_fit import Circles
from bgars.balls.rim_pixels import SECTORS
from bgars.balls.rim_scan import CoarseCircles, scan_rims

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from bgars.balls.levels import Levels
    from bgars.records import BoolArray, FloatArray

__all__ = ["Detection", "find_circles"]

WORKING_SIZE_PX = 512
FLOOR_LEVELS = 2.0
SMALLEST_RADIUS_PX = 3.5
"""In the reduced images: fewer pixels show no rim."""
MIN_SHARE = 0.7
MIN_SHARE_LIKE_OTHERS = 0.45
MIN_STRENGTH = 0.15
MIN_STRENGTH_LIKE_OTHERS = 0.08
MIN_OUTWARD = 0.3
MIN_ALIGNMENT = 0.6
OUTER_STRENGTH = 0.8
OUTER_STRENGTH_OF_HIGHLIGHTS = 0.35
HIGHLIGHT_RATIO = 2.5
"""A rim around another one wins from such a fraction of its strength on: highlights make strong rims inside balls, the
smaller the more likely."""
MIN_SUPPORT = 0.5
MIN_SUPPORT_IN_MASK = 0.85
"""A mask says that there is an object: round parts of it are no balls."""
MAX_U_RADIUS = 0.1
LIKE_OTHERS = (0.8, 1.25)
SCALES_LIKE_OTHERS = (0.6, 3.0)
ODD_SIZE = 1.35
USUAL_STRENGTH = 0.3
ENOUGH_TO_JUDGE_SIZE = 3
SMALLEST_OF_USUAL = 0.35
MIN_COVERED = 0.97
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
    factor : int
        Pixels of the full images a reduced pixel is wide.
    """

    circles: Circles
    slopes: tuple[FloatArray, FloatArray]
    brightest: FloatArray
    factor: int


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
        return Detection(blobs, slopes, brightest, factor)
    coarse = _coarse_circles(reduced, slopes, mask, levels.threads)
    report(0.4)
    row, col = ((column + 0.5) * factor - 0.5 for column in coarse[:2])
    circles = fit_alike(levels, row, col, coarse.radius_px * factor)
    good = circles.support >= (MIN_SUPPORT if mask is None else MIN_SUPPORT_IN_MASK)
    good &= circles.u_radius_px < MAX_U_RADIUS * circles.radius_px
    usual_px = np.median(circles.radius_px) if len(circles.row) else 1.0
    moved = np.abs(np.log(circles.radius_px / (coarse.radius_px * factor)))
    good &= np.minimum(moved, np.abs(np.log(circles.radius_px / usual_px))) < np.log(LIKE_OTHERS[1])
    report(0.95)
    return Detection(circles.take(np.flatnonzero(good)), slopes, brightest, factor)


def _blobs_that_are_balls(
    levels: Levels, slopes: tuple[FloatArray, FloatArray], reduced: FloatArray, factor: int
) -> Circles:
    """Round blobs of the mask whose inside slopes outward everywhere or mirrors the lights, as circles."""
    blobs = round_blobs(levels.capture.mask)
    row, col = ((column + 0.5) / factor - 0.5 for column in blobs[:2])
    seen = CoarseCircles(row, col, blobs.radius_px / factor, blobs.rms_px, blobs.rms_px)
    outward, alignment = _inside(seen, slopes)
    good = (outward >= MIN_OUTWARD) & (alignment >= MIN_ALIGNMENT)
    directions = levels.capture.rig.directions
    for index in np.flatnonzero(~good)[:MOST_MIRRORS]:
        disc = float(seen.row[index]), float(seen.col[index]), float(seen.radius_px[index])
        good[index] = mirrors_lights(reduced, directions, *disc)
    row, col, radius_px, rms_px = (column[good] for column in blobs)
    # Someone drew the mask: its outline may be off as a whole by as much as it is uneven.
    outline = np.sqrt(2.0 * np.pi * radius_px)
    return Circles(row, col, radius_px, rms_px * 2.0 / outline + 0.1, rms_px, np.ones(len(row)), _no_offsets(len(row)))


def _no_offsets(count: int) -> NDArray[np.float64]:
    return np.full((count, SECTORS), np.nan)


def _coarse_circles(
    reduced: FloatArray, slopes: tuple[FloatArray, FloatArray], mask: BoolArray | None, threads: int
) -> CoarseCircles:
    """Circles to a pixel or two, in reduced pixels."""
    centres = np.array(outward_centres(*slopes)).reshape(-1, 4)
    centres = centres[_best_of_place(centres)]
    coarse = _accepted(scan_rims(reduced, *centres[:, :3].T, threads=threads), slopes, MIN_SHARE, MIN_STRENGTH)
    if len(coarse.row) > 1:
        usual_px = float(np.median(coarse.radius_px))
        rest = centres[_outside(centres, coarse)]
        scale_px = np.full(len(rest), usual_px)
        more = scan_rims(reduced, rest[:, 0], rest[:, 1], scale_px, span=LIKE_OTHERS, rims=1, threads=threads)
        more = _take(more, np.abs(np.log(more.radius_px / usual_px)) < np.log(LIKE_OTHERS[1]))
        coarse = _merged(coarse, _accepted(more, slopes, MIN_SHARE_LIKE_OTHERS, MIN_STRENGTH_LIKE_OTHERS), usual_px)
    if mask is not None:
        coarse = _take(coarse, _covered(coarse, mask) > MIN_COVERED)
    if len(coarse.row) > ENOUGH_TO_JUDGE_SIZE:
        coarse = _take(coarse, coarse.radius_px > SMALLEST_OF_USUAL * np.median(coarse.radius_px))
    return coarse


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
    coarse: CoarseCircles, slopes: tuple[FloatArray, FloatArray], share: float, strength: float
) -> CoarseCircles:
    """Circles with a rim all around, whose inside slopes outward, one a place."""
    coarse = _take(
        coarse,
        (coarse.share >= share) & (coarse.strength >= strength) & (coarse.radius_px >= SMALLEST_RADIUS_PX),
    )
    outward, alignment = _inside(coarse, slopes)
    coarse = _take(coarse, (outward >= MIN_OUTWARD) & (alignment >= MIN_ALIGNMENT))
    return _without_overlaps(coarse)


def _inside(
    coarse: CoarseCircles, slopes: tuple[FloatArray, FloatArray]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
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


def _without_overlaps(coarse: CoarseCircles) -> CoarseCircles:
    """Keep the outer one of nested circles, and of those that run into each other the one with the stronger rim."""
    distance = np.hypot(coarse.row[:, None] - coarse.row, coarse.col[:, None] - coarse.col)
    radius = coarse.radius_px
    nested = (radius > 1.15 * radius[:, None]) & (distance < 0.35 * radius)
    # Rims of neighbours do not cross, ends of their shadows do.
    crossing = (distance > 0.7 * radius[:, None]) & (distance < radius[:, None] + 0.9 * radius)
    crossing &= (radius > 0.5 * radius[:, None]) & (coarse.strength > 0.5 * coarse.strength[:, None])
    nested &= ~np.any(crossing, axis=1)
    needed = np.where(radius > HIGHLIGHT_RATIO * radius[:, None], OUTER_STRENGTH_OF_HIGHLIGHTS, OUTER_STRENGTH)
    nested &= coarse.strength >= needed * coarse.strength[:, None]
    inner = np.any(nested, axis=1)
    coarse = _take(coarse, ~inner)
    keep: list[int] = []
    crossed = np.any(crossing, axis=1)[~inner]
    for index in np.argsort(-coarse.strength * coarse.share * np.where(crossed, 0.3, 1.0)):
        apart = np.hypot(coarse.row[keep] - coarse.row[index], coarse.col[keep] - coarse.col[index])
        if not (apart < 0.85 * (coarse.radius_px[keep] + coarse.radius_px[index])).any():
            keep.append(int(index))
    return _take(coarse, np.array(keep, np.intp))
