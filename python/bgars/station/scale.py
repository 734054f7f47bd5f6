"""Pixel pitch, tilt and distortion from a grid: dots, crossings of a chessboard, or the balls of a known part."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from bgars.errors import CalibrationError, InputError
from bgars.records.capture import Capture
from bgars.records.same_images import refuse_shared
from bgars.station.camera_distance import checked_heights, with_distance
from bgars.station.grid_fit import LEAST_POINTS, UNKNOWN_PITCH_U, fit_grid
from bgars.station.levels import linear_levels

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bgars.records.remark import Remark
    from bgars.records.scale import Scale

__all__ = ["calibrate_scale"]

Array = NDArray[np.float64]
Target = Literal["dots", "chessboard"]

GRID_AGAIN = "photograph the grid once at each of its heights"
SHARP = 1.5
"""Width of the smoothing before corners are looked for, in pixels."""
SAME_SIZE = 0.5
"""Dots differ in area from their median by this share at most."""


def calibrate_scale(
    capture: Capture | Sequence[Capture],
    pitch_um: float,
    *,
    target: Target = "dots",
    u_pitch_um: float | None = None,
    heights_um: ArrayLike | None = None,
) -> tuple[Scale, tuple[Remark, ...]]:
    """Measure the pixel pitch on a grid of known pitch in the plane of the parts, and the camera's distance from it.

    Parameters
    ----------
    capture : Capture or sequence of Capture
        The grid under one or more lights; their mean is used. Several: the same grid at different heights.
    pitch_um : float
        Distance of neighbouring dots, or of neighbouring crossings.
    target : {"dots", "chessboard"}
        Dots on a plain background, or a chessboard.
    u_pitch_um : float, optional
        Standard uncertainty of the grid's pitch; 0.01 % of it by default.
    heights_um : (K,) array_like, optional
        Height of the grid in each capture above the plane of the parts, toward the camera, known to 1 % of their
        range: two heights or more tell the distance of the camera, or that the lens is telecentric.

    Returns
    -------
    scale : Scale
    findings : tuple of Remark

    Raises
    ------
    CalibrationError
        Fewer than 12 points on one grid.
    InputError
        A pitch that is not above 0, an uncertainty that is negative or no smaller than it, or heights that do not
        fit the captures.
    """
    captures = [capture] if isinstance(capture, Capture) else list(capture)
    heights = checked_heights(heights_um, len(captures))
    refuse_shared(captures, GRID_AGAIN)
    if not (math.isfinite(pitch_um) and pitch_um > 0):
        msg = f"pitch_um: must be finite and above 0, got {pitch_um:g}"
        raise InputError(msg)
    if u_pitch_um is not None and not (math.isfinite(u_pitch_um) and 0 <= u_pitch_um < pitch_um):
        msg = f"u_pitch_um: must be 0 or more, and below the pitch of {pitch_um:g}, got {u_pitch_um:g}"
        raise InputError(msg)
    grids = [_grid_of(each, target) for each in captures]
    size_px, names = grids[0][1], [each.name for each in captures]
    fits = [
        fit_grid(places, pitch_um, u_pitch_um, size_px=size, name=each.name, distance_mm=each.camera_distance_mm)
        for each, (places, size) in zip(captures, grids, strict=True)
    ]
    if heights is None:
        return replace(fits[0][0], size_px=size_px), fits[0][1]
    if any(size != size_px for _, size in grids):
        msg = f"{', '.join(names)}: images of different sizes, so not of one camera"
        raise InputError(msg)
    u_grid = UNKNOWN_PITCH_U if u_pitch_um is None else u_pitch_um / pitch_um
    scale, said = with_distance([fit for fit, _ in fits], heights, u_grid, names[0])
    lowest = int(np.argmin(np.abs(heights)))
    again, tilts = fit_grid(
        grids[lowest][0],
        pitch_um,
        u_pitch_um,
        size_px=size_px,
        name=names[lowest],
        distance_mm=scale.camera_distance_mm,
    )
    findings = [remark for _, found in fits for remark in found if remark.code != "tilt"]
    findings += [*said, *(remark for remark in tilts if remark.code == "tilt")]
    return replace(scale, tilt_deg=again.tilt_deg, size_px=size_px), tuple(findings)


def _grid_of(capture: Capture, target: Target) -> tuple[Array, tuple[int, int]]:
    """(N, 2) points of the grid from the image centre, y up, and the image's size."""
    picture = linear_levels(capture).images.mean(axis=0)
    points = _dots(picture) if target == "dots" else _crossings(picture)
    if len(points) < LEAST_POINTS:
        msg = f"{capture.name}: {len(points)} {target} found, {LEAST_POINTS} are needed"
        raise CalibrationError(msg)
    height, width = picture.shape
    return np.column_stack([points[:, 1] + 0.5 - width / 2.0, height / 2.0 - points[:, 0] - 0.5]), (height, width)


def _dots(picture: Array) -> Array:
    """(N, 2) row and column of dots: weighted centres of what differs from the ground."""
    coarse = ndimage.median_filter(picture[::4, ::4], size=max(3, min(picture.shape) // 40 * 2 + 1))
    ground = np.kron(np.asarray(coarse, dtype=np.float64), np.ones((4, 4)))[: picture.shape[0], : picture.shape[1]]
    ground = np.pad(
        ground, [(0, picture.shape[0] - ground.shape[0]), (0, picture.shape[1] - ground.shape[1])], mode="edge"
    )
    middle = 0.5 * (np.percentile(picture, 2) + np.percentile(picture, 98))
    bright_ground = np.median(picture) > middle
    change = middle - picture if bright_ground else picture - middle
    labels, count = ndimage.label(change > 0)
    if count == 0:
        return np.zeros((0, 2))
    which = np.arange(1, count + 1)
    areas = ndimage.sum(change > 0, labels, which)
    boxes = ndimage.find_objects(labels)
    usual = float(np.median(areas[areas > 6])) if (areas > 6).any() else 0.0  # noqa: PLR2004 - more than noise
    found = []
    height, width = picture.shape
    for number, area, box in zip(which, areas, boxes, strict=True):
        rows, cols = box
        inside = rows.start > 1 and cols.start > 1 and rows.stop < height - 1 and cols.stop < width - 1
        if not inside or abs(area - usual) > SAME_SIZE * usual:
            continue
        around = (slice(rows.start - 2, rows.stop + 2), slice(cols.start - 2, cols.stop + 2))
        level = np.abs(picture[around] - np.median(np.concatenate([picture[around][0], picture[around][-1]])))
        level = np.where((labels[around] == number) | (labels[around] == 0), level, 0.0)
        level = np.maximum(level - 0.1 * level.max(), 0.0)
        row, col = ndimage.center_of_mass(level)
        found.append((row + around[0].start, col + around[1].start))
    return np.array(found).reshape(-1, 2)


def _crossings(picture: Array) -> Array:
    """(N, 2) row and column of saddle points: where the determinant of the Hessian is most negative."""
    smooth = ndimage.gaussian_filter(picture, SHARP)
    rr: Array = ndimage.gaussian_filter(picture, SHARP, order=(2, 0))
    cc: Array = ndimage.gaussian_filter(picture, SHARP, order=(0, 2))
    rc: Array = ndimage.gaussian_filter(picture, SHARP, order=(1, 1))
    saddle: Array = rc**2 - rr * cc
    peak = (saddle == ndimage.maximum_filter(saddle, size=9)) & (saddle > 0.3 * np.percentile(saddle, 99.9))
    rows, cols = np.nonzero(peak)
    found = []
    slopes = [np.asarray(slope, dtype=np.float64) for slope in np.gradient(smooth)]
    for row, col in zip(rows, cols, strict=True):
        # The saddle of the quadratic through the neighbourhood: where its gradient is 0.
        hessian = np.array([[rr[row, col], rc[row, col]], [rc[row, col], cc[row, col]]])
        step = -np.linalg.solve(hessian, np.array([slope[row, col] for slope in slopes]))
        if np.abs(step).max() < 1.5 and 2 < row < picture.shape[0] - 3 and 2 < col < picture.shape[1] - 3:  # noqa: PLR2004
            found.append((row + step[0], col + step[1]))
    return np.array(found).reshape(-1, 2)
