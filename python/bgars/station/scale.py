"""Pixel pitch, tilt and distortion from a grid: dots, crossings of a chessboard, or the balls of a known part."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.optimize import least_squares
from scipy.spatial import cKDTree

from bgars.errors import CalibrationError, InputError
from bgars.records.remark import Remark
from bgars.records.scale import Scale
from bgars.station.levels import linear_levels

if TYPE_CHECKING:
    from bgars.records.capture import Capture

__all__ = ["calibrate_scale", "fit_grid"]

Array = NDArray[np.float64]
Target = Literal["dots", "chessboard"]

LEAST_POINTS = 12
SHARP = 1.5
"""Width of the smoothing before corners are looked for, in pixels."""
SAME_SIZE = 0.5
"""Dots differ in area from their median by this share at most."""
ON_GRID = 0.25
"""Distance of a point from its place, of the pitch, at most."""
OUTLIER_SIGMAS = 5.0
SEEN_SIGMAS = 3.0
"""Tilt and distortion are kept where they are so many standard deviations from 0."""
ROUGH_PX = 0.5
"""Residual from which on the points are no square grid: another pitch across than down, or a bent sheet. Square ones,
drawn with noise of up to 8 grey levels and blur of up to 2 px, leave 0.01 to 0.09 px."""
UNKNOWN_PITCH_U = 1e-4
"""Relative standard uncertainty of a grid's pitch where none is stated: etched glass is better, print worse."""


def calibrate_scale(
    capture: Capture, pitch_um: float, *, target: Target = "dots", u_pitch_um: float | None = None
) -> tuple[Scale, tuple[Remark, ...]]:
    """Measure the pixel pitch on a grid of known pitch in the plane of the parts.

    Parameters
    ----------
    capture : Capture
        The grid under one or more lights; their mean is used.
    pitch_um : float
        Distance of neighbouring dots, or of neighbouring crossings.
    target : {"dots", "chessboard"}
        Dots on a plain background, or a chessboard.
    u_pitch_um : float, optional
        Standard uncertainty of the grid's pitch; 0.01 % of it by default.

    Returns
    -------
    scale : Scale
    findings : tuple of Remark

    Raises
    ------
    CalibrationError
        Fewer than 12 points on one grid.
    InputError
        A pitch that is not above 0, or an uncertainty that is negative or no smaller than it.
    """
    if not (math.isfinite(pitch_um) and pitch_um > 0):
        msg = f"pitch_um: must be finite and above 0, got {pitch_um:g}"
        raise InputError(msg)
    if u_pitch_um is not None and not (math.isfinite(u_pitch_um) and 0 <= u_pitch_um < pitch_um):
        msg = f"u_pitch_um: must be 0 or more, and below the pitch of {pitch_um:g}, got {u_pitch_um:g}"
        raise InputError(msg)
    picture = linear_levels(capture).images.mean(axis=0)
    points = _dots(picture) if target == "dots" else _crossings(picture)
    if len(points) < LEAST_POINTS:
        msg = f"{capture.name}: {len(points)} {target} found, {LEAST_POINTS} are needed"
        raise CalibrationError(msg)
    height, width = picture.shape
    places = np.column_stack([points[:, 1] + 0.5 - width / 2.0, height / 2.0 - points[:, 0] - 0.5])
    return fit_grid(places, pitch_um, u_pitch_um, size_px=(height, width), name=capture.name)


def fit_grid(
    places_px: Array, pitch_um: float, u_pitch_um: float | None, *, size_px: tuple[int, int], name: str = "grid"
) -> tuple[Scale, tuple[Remark, ...]]:
    """Fit a square grid, seen by a lens with radial distortion at a tilt, to points (N, 2) from the image centre.

    Examples
    --------
    >>> steps = np.stack(np.meshgrid(np.arange(10.0), np.arange(8.0)), axis=-1).reshape(-1, 2)
    >>> scale, _ = fit_grid(20.0 * (steps - 4.0), 250.0, None, size_px=(200, 240))
    >>> round(scale.pixel_pitch_um, 6), scale.points
    (12.5, 80)
    """
    index, use = _number(places_px)
    if int(use.sum()) < LEAST_POINTS:
        msg = f"{name}: only {int(use.sum())} points lie on one square grid, {LEAST_POINTS} are needed"
        raise CalibrationError(msg)
    half = 0.5 * math.hypot(*size_px)
    for _ in range(3):
        values, jacobian, residuals = _lens(index[use], places_px[use], half)
        size = np.linalg.norm(residuals, axis=1)
        limit = OUTLIER_SIGMAS * max(float(np.median(size)), 1e-3)
        if (size <= limit).all():
            break
        use[np.flatnonzero(use)[size > limit]] = False
    a, b, _, _, px, py, k = values
    count = int(use.sum())
    spare = max(2 * count - len(values), 1)
    rms = float(np.sqrt(np.square(residuals).sum() / spare))
    covariance = np.linalg.pinv(jacobian.T @ jacobian) * rms**2
    step_px = _step_at_centre(values, half)
    u_px = math.sqrt(float(covariance[0, 0] + covariance[1, 1]) / 2.0)
    u_grid = UNKNOWN_PITCH_U * pitch_um if u_pitch_um is None else u_pitch_um
    pitch = pitch_um / step_px
    u = pitch * math.hypot(u_px / step_px, u_grid / pitch_um)
    tilted = math.hypot(px, py) > SEEN_SIGMAS * math.sqrt(float(covariance[4, 4] + covariance[5, 5]))
    bent = abs(k) > SEEN_SIGMAS * math.sqrt(float(covariance[6, 6]))
    words = f"{name}: {count} of {len(places_px)} points on the grid, residual {rms:.3f} px"
    findings = [Remark("note", words, "grid", rms, ROUGH_PX, "px")]
    if rms > ROUGH_PX:
        words += ": no square grid, or not flat; the pitch is off by more than its uncertainty"
        findings = [Remark("doubt", words, "grid", rms, ROUGH_PX, "px")]
    if bent:
        findings.append(
            Remark(
                "note",
                f"{name}: the lens distorts by {100 * k:+.2f} % at the corners; places of balls there are off by "
                f"{abs(k) * half:.1f} px",
                "distortion",
                float(k),
            )
        )
    if tilted:
        findings.append(
            Remark(
                "note",
                f"{name}: the scale changes by {200 * math.hypot(px, py):.2f} % across the image: the grid is "
                "tilted against the camera",
                "tilt",
                2.0 * math.hypot(px, py),
            )
        )
    # A lens that is not known leaves the tilt in degrees open: only the change of scale is seen.
    return Scale(
        float(pitch),
        float(u),
        rotation_deg=_turn(float(a), float(b)),
        distortion=float(k) if bent else 0.0,
        residual_px=rms,
        points=count,
    ), tuple(findings)


def _lens(index: Array, places: Array, half: float) -> tuple[Array, Array, Array]:
    """Parameters, Jacobian and residuals of the grid as the lens shows it."""
    rows = np.zeros((2 * len(index), 4))
    rows[0::2] = np.column_stack([index[:, 0], -index[:, 1], np.ones(len(index)), np.zeros(len(index))])
    rows[1::2] = np.column_stack([index[:, 1], index[:, 0], np.zeros(len(index)), np.ones(len(index))])
    start, *_ = np.linalg.lstsq(rows, places.ravel(), rcond=None)

    def off(p: Array) -> Array:
        return places - _project(p, index, half)

    def residuals(p: Array) -> Array:
        return off(p).ravel()

    fit = least_squares(residuals, np.append(start, np.zeros(3)), x_scale=[1, 1, 1, 1, 1e-3, 1e-3, 1e-3])
    return fit.x, np.asarray(fit.jac, dtype=np.float64), off(fit.x)


def _project(p: Array, index: Array, half: float) -> Array:
    a, b, x0, y0, px, py, k = p
    x = a * index[:, 0] - b * index[:, 1] + x0
    y = b * index[:, 0] + a * index[:, 1] + y0
    away = 1.0 + (px * x + py * y) / half
    x, y = x / away, y / away
    bend = 1.0 + k * (x**2 + y**2) / half**2
    return np.column_stack([x * bend, y * bend])


def _step_at_centre(p: Array, half: float) -> float:
    """Pixels a step of the grid, at the image centre, both ways' geometric mean."""
    a, b, x0, y0, *_ = p
    norm = a**2 + b**2
    i, j = (-x0 * a - y0 * b) / norm, (x0 * b - y0 * a) / norm
    step = 0.01
    around = np.array([[i + step, j], [i - step, j], [i, j + step], [i, j - step]])
    seen = _project(p, around, half)
    one, two = (seen[0] - seen[1]) / (2 * step), (seen[2] - seen[3]) / (2 * step)
    return math.sqrt(abs(float(one[0] * two[1] - one[1] * two[0])))


def _turn(a: float, b: float) -> float:
    """Rotation of the grid's axes, in (-45, 45] degrees."""
    turn = math.degrees(math.atan2(b, a)) % 90.0
    return turn if turn <= 45.0 else turn - 90.0  # noqa: PLR2004 - a square grid looks the same after 90 degrees


def _number(places: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Column and row of each point, from neighbour to neighbour; False where it is not reached."""
    tree = cKDTree(places)
    distances = np.asarray(tree.query(places, k=2)[0], dtype=np.float64)
    pitch = float(np.median(distances[:, 1]))
    pairs = tree.query_pairs(1.3 * pitch, output_type="ndarray")
    steps = places[pairs[:, 1]] - places[pairs[:, 0]]
    angle = float(np.angle(np.mean(np.exp(4j * np.arctan2(steps[:, 1], steps[:, 0]))))) / 4.0
    turn = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
    index = np.zeros((len(places), 2))
    reached = np.zeros(len(places), np.bool_)
    start = int(np.argmin(np.linalg.norm(places - np.median(places, axis=0), axis=1)))
    reached[start] = True
    queue = [start]
    while queue:
        at = queue.pop(0)
        for other in tree.query_ball_point(places[at], 1.4 * pitch):
            if reached[other]:
                continue
            step = turn @ (places[other] - places[at]) / pitch
            whole = np.rint(step)
            if np.abs(whole).sum() == 1 and np.abs(step - whole).max() < ON_GRID:
                index[other] = index[at] + whole
                reached[other] = True
                queue.append(other)
    return index, reached


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
