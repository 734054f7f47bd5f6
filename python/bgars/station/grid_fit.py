"""A square grid fitted to points: pixel pitch, tilt and distortion, and what no square grid would leave."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.spatial import cKDTree

from bgars.errors import CalibrationError
from bgars.records.remark import Remark
from bgars.records.scale import Scale

__all__ = ["LEAST_POINTS", "UNKNOWN_PITCH_U", "fit_grid"]

Array = NDArray[np.float64]

LEAST_POINTS = 12
UNKNOWN_PITCH_U = 1e-4
"""Relative standard uncertainty of a grid's pitch where none is stated: etched glass is better, print worse."""
ON_GRID = 0.25
"""Distance of a point from its place, of the pitch, at most."""
OUTLIER_SIGMAS = 5.0
SEEN_SIGMAS = 3.0
"""Tilt and distortion are kept where they are so many standard deviations from 0."""
LEAST_SHARE = 0.7
"""Of the points found, those that one square grid holds: what is missing lies at borders and under dirt."""
ROUGH_PX = 0.5
"""Residual from which on the points are no square grid: another pitch across than down, or a bent sheet. Square ones,
drawn with noise of up to 8 grey levels and blur of up to 2 px, leave 0.01 to 0.09 px."""


def fit_grid(
    places_px: Array,
    pitch_um: float,
    u_pitch_um: float | None,
    *,
    size_px: tuple[int, int],
    name: str = "grid",
    distance_mm: float | None = None,
) -> tuple[Scale, tuple[Remark, ...]]:
    """Fit a square grid, seen by a lens with radial distortion at a tilt, to points (N, 2) from the image centre.

    `distance_mm` of the camera, where it is known, turns the change of scale across the image into a tilt.

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
    misfit, misfits = _misfit(values, jacobian, places_px[use], residuals, half, name)
    known = math.hypot(u_px / step_px, u_grid / pitch_um)
    u = pitch * math.hypot(known, misfit)
    tilted = math.hypot(px, py) > SEEN_SIGMAS * math.sqrt(float(covariance[4, 4] + covariance[5, 5]))
    bent = abs(k) > SEEN_SIGMAS * math.sqrt(float(covariance[6, 6]))
    words = f"{name}: {count} of {len(places_px)} points on the grid, residual {rms:.3f} px"
    findings = [Remark("note", words, "grid", rms, ROUGH_PX, "px")]
    if count < LEAST_SHARE * len(places_px):
        words += f", less than {100 * LEAST_SHARE:.0f} %: a staggered grid, or another one beside it?"
        findings = [Remark("doubt", words, "grid", count / len(places_px), LEAST_SHARE)]
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
    findings += misfits if misfit > known else []
    tilt_deg = _tilt_deg(math.hypot(px, py) / half, pitch, distance_mm) if tilted else 0.0
    if tilted:
        by = "" if math.isnan(tilt_deg) else f", by {tilt_deg:.2f} deg"
        findings.append(
            Remark(
                "note",
                f"{name}: the scale changes by {200 * math.hypot(px, py):.2f} % across the image: the grid is "
                f"tilted against the camera{by}",
                "tilt",
                2.0 * math.hypot(px, py),
            )
        )
    return Scale(
        float(pitch),
        float(u),
        tilt_deg=math.nan if distance_mm is None or math.isinf(distance_mm) else tilt_deg,
        rotation_deg=_turn(float(a), float(b)),
        distortion=float(k) if bent else 0.0,
        residual_px=rms,
        points=count,
    ), tuple(findings)


def _misfit(
    values: Array, jacobian: Array, places: Array, residuals: Array, half: float, name: str
) -> tuple[float, list[Remark]]:
    """What the model leaves out: by how much, relative, the pitch is unsure by it, and a word on each part.

    Residuals are fitted again with two terms more of a grid that is not square and one of a lens that bends with the
    fourth power of the distance from the image centre; those seen change the pitch.
    """
    x, y = places.T / half
    fourth = np.square(np.square(x) + np.square(y))
    trial = np.stack([[x, -y], [y, x], [x * fourth, y * fourth]], axis=-1).transpose(1, 0, 2).reshape(-1, 3)
    system = np.column_stack([-jacobian, trial])
    size = np.maximum(np.linalg.norm(system, axis=0), 1e-12)
    inverse = np.linalg.pinv((system / size).T @ (system / size)) / np.outer(size, size)
    change = inverse @ system.T @ residuals.ravel()
    left = residuals.ravel() - system @ change
    sigma = np.sqrt(np.diag(inverse) * np.square(left).sum() / max(len(left) - len(change), 1))
    step = math.hypot(values[0], values[1])
    oblong = math.hypot(change[-3], change[-2]) / half
    found: list[Remark] = []
    unsure = 0.0
    if oblong * half > SEEN_SIGMAS * math.hypot(sigma[-3], sigma[-2]):
        unsure = oblong
        tilt_deg = math.degrees(math.acos(max(1.0 - 2.0 * oblong, 0.0)))
        words = (
            f"{name}: the grid is {200 * oblong:.3f} % longer one way than across: it or the pixels are not square, or "
            f"it is tilted by {tilt_deg:.1f} deg; the pitch is unsure by {100 * oblong:.3f} %"
        )
        found.append(Remark("doubt", words, "oblong", 2.0 * oblong))
    if abs(change[-1]) > SEEN_SIGMAS * sigma[-1]:
        by_bend = abs(float(values[0] * change[0] + values[1] * change[1])) / step**2
        unsure = math.hypot(unsure, by_bend)
        words = (
            f"{name}: the lens bends otherwise than with the square of the distance from the image centre: the pitch "
            f"is unsure by {100 * by_bend:.3f} %"
        )
        found.append(Remark("note", words, "distortion-form", by_bend))
    return unsure, found


def _tilt_deg(change_per_px: float, pitch_um: float, distance_mm: float | None) -> float:
    """Tilt of a plane whose scale changes so much: sine over the distance in pixels; NaN where that is not known."""
    if distance_mm is None or math.isinf(distance_mm):
        return math.nan
    return math.degrees(math.asin(min(change_per_px * 1000.0 * distance_mm / pitch_um, 1.0)))


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
