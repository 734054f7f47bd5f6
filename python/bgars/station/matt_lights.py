"""Lights from the shading of a matt ball: Lambert's law with attached shadow, light of the room and of the board."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.special import ndtr

from bgars.errors import CalibrationError
from bgars.files.light_names import light_name
from bgars.records.remark import Remark
from bgars.station.board_light import board_light
from bgars.station.lamp_distance import TILT
from bgars.station.mirror import reflected, sphere_of_outline
from bgars.station.monotone_law import monotone_law

if TYPE_CHECKING:
    from bgars.records.capture import Capture
    from bgars.station.levels import Levels
    from bgars.station.outline import Outline

__all__ = ["Near", "SeenShading", "shading_misfit", "shading_on"]

Array = NDArray[np.float64]

INNER = 0.97
"""Share of the radius that is used: the rim is blurred, and steep."""
PIXELS = 6000
"""Pixels of a ball that are fitted."""
SECTORS = 8
"""Parts of a ball that are left out in turn (jackknife): what the model misses is alike within each."""
NOT_LAMBERT = 0.06
"""Root mean square residual, of the brightest level, from which on a general monotone law is fitted, too."""
EXPLAINED, MISSED = 2.0, 1.1
"""Residual, of the noise, up to which Lambert's law explains a ball wholly; of what a general law leaves, from which on
it misses something: 6000 pixels tell residuals to 1 %, their noise is known to 5 %."""
NOT_LINEAR = -0.01
"""Radius over distance, of all lamps, from which on the light does not fall off but grows: no lamp stands there, and
levels are no measure of light. It tilts lights by a degree; a gamma of 1.2 gives -0.06 to distant lamps."""
SATURATED_SHARE = 0.2
"""Share of the lit pixels that are clipped from which on an image is overexposed."""
LEAST_LEVEL = 12.0
"""Grey levels of 255 of the brightest point from which on there is shading."""
BOARD_SHARE = 0.5
"""Spread of what the board reflects, of the ball's level, before it is measured in the attached shadow."""
NEAR_RADII = 0.02
"""Spread of a ball's radius over the distance of a lamp: 10 mm at 500 mm; a ball of 2 mm has a tenth of it."""
ALIKE = 0.2
"""Spread of the distances of a rig's lamps, over their middle."""
FEW_LIGHTS = 3
"""Up to so many show no scatter to rely on."""
LEAST_NEAR = 1e-4
"""And of that ratio at least: it tilts a light by 0.01 degrees."""
UNEVEN = 0.05
"""Part of the board's light that one side has more of than its shadow says: the ball shines on the board, too."""
LEAST_SHADOW, CUT_SHARE = 30, 0.02
"""Pixels of an attached shadow, and their share at the least grey level, from which on noise is cut there: fewer move
its mean by less than a hundredth of the noise."""
STEP_RAD = 1e-4


class Near(NamedTuple):
    """What is known of the ball's radius over the distance of a lamp: mean, its error, and spread around it."""

    mean: float = 0.0
    error: float = 0.0
    spread: float = NEAR_RADII


NOT_KNOWN = Near()


class _Fit(NamedTuple):
    """Strength times direction, level of the board's light, root mean square residual, radius over distance."""

    vector: Array
    board: float
    residual: float
    near: float


class SeenShading(NamedTuple):
    """Lights on one ball: unit vectors, covariances of two turns by the outline's errors and by the rest, strengths."""

    directions: Array
    own_covariances: Array
    outline_jacobians: Array
    strengths: Array
    u_strengths: Array
    near: Near
    """Common to all lights; what each is uncertain by beside it is in its own covariance."""
    findings: list[Remark]


def shading_on(capture: Capture, levels: Levels, outline: Outline, camera_px: float = math.inf) -> SeenShading:
    """Fit each light on one ball, which a camera at that distance sees (infinite: telecentric).

    Raises
    ------
    CalibrationError
        An image that is too dark or overexposed on the ball.
    """
    findings: list[Remark] = []
    count = len(levels.images)
    directions, strengths, u_strengths = np.zeros((count, 3)), np.zeros(count), np.zeros(count)
    own, jacobians = np.zeros((count, 2, 2)), np.zeros((count, 3, 3))
    points, index = _pixels(levels.images.shape[1:], outline)
    normals = _normals(points, outline.circle_px, camera_px)
    for light, image in enumerate(levels.images):
        _need_shading(f"{capture.name}: {light_name(light, capture.files)}", image.ravel()[index], levels.clip)
    near, is_linear = _nearness(normals, levels, index)
    if not is_linear:
        cure = "calibrate the response first" if capture.response is None else "calibrate the response again"
        message = (
            f"{capture.name}: the ball is shaded more flatly than matt ones are: the images are not linear ({cure}), "
            "or the ball is not matt; a general monotone law is taken"
        )
        findings.append(Remark("doubt", message, "not-linear"))
    for light, image in enumerate(levels.images):
        name = light_name(light, capture.files)
        values = image.ravel()[index]
        used = values < levels.clip
        peak = float(np.percentile(values, 99.0))
        vector, board, residual, _ = _fit(normals, values, used, levels.noise, near)
        strength = float(np.linalg.norm(vector))
        if vector[2] <= 0:
            msg = (
                f"{capture.name}: {name}: no light from above: the fit points to "
                f"({', '.join(f'{v:.2f}' for v in vector / strength)})"
            )
            raise CalibrationError(msg)
        direction = vector / strength
        own[light], jacobians[light] = _spread(points, values, used, outline, levels.noise, direction, camera_px, near)
        # Of a lamp's own distance the shading is tilted, and the parallax from the ball's middle to the board is wrong.
        tilt = (TILT + math.hypot(*direction[:2])) * near.spread
        own[light] += (UNEVEN * board / strength) ** 2 * np.eye(2) + np.diag([0.0, tilt**2])
        is_noise = residual <= MISSED * levels.noise
        general, left = (direction, residual) if is_noise else monotone_law(normals, values, used, direction)
        if residual > min(MISSED * max(left, levels.noise), EXPLAINED * levels.noise):
            # Two laws that explain the ball as badly: the truth is as likely nearer to either of them.
            half = 0.5 * _across(direction) @ (general - direction)
            own[light] += np.outer(half, half)
            if residual > NOT_LAMBERT * peak:
                findings.append(
                    Remark(
                        "note",
                        f"{capture.name}: {name}: the ball does not follow Lambert's law ({100 * residual / peak:.1f} "
                        "% off): "
                        f"a general monotone law is taken ({100 * left / peak:.1f} % off)",
                        "not-lambert",
                        residual / peak,
                        NOT_LAMBERT,
                        "",
                        light,
                    )
                )
                direction = general
            elif not is_linear:
                direction = general
            elif residual > EXPLAINED * levels.noise:
                direction = (direction + general) / np.linalg.norm(direction + general)
        directions[light], strengths[light] = direction, strength
        u_strengths[light] = residual / math.sqrt(max(int(used.sum()) / 50.0, 1.0))
    return SeenShading(directions, own, jacobians, strengths, u_strengths, near, findings)


def shading_misfit(levels: Levels, outline: Outline) -> float:
    """Root mean square residual of the first lights on a circle, of its levels: small where it is the ball."""
    points, index = _pixels(levels.images.shape[1:], outline)
    if len(index) < 100:  # noqa: PLR2004 - too few to say
        return math.inf
    left = 0.0
    for image in levels.images[:3]:
        values = image.ravel()[index]
        fit = _fit(_normals(points, outline.circle_px), values, values < levels.clip, levels.noise)
        left = max(left, fit.residual / max(float(np.percentile(values, 99.0)), 1.0))
    return left


def _pixels(shape: tuple[int, ...], outline: Outline) -> tuple[Array, NDArray[np.intp]]:
    """(N, 2) places on the ball and their index in the image."""
    height, width = shape
    rows, cols = np.mgrid[:height, :width]
    x, y = cols + 0.5 - width / 2.0, height / 2.0 - rows - 0.5
    use = np.flatnonzero(np.hypot(x - outline.x_px, y - outline.y_px).ravel() < INNER * outline.radius_px - 1.0)
    use = use[:: max(1, len(use) // PIXELS)]
    return np.column_stack([x.ravel()[use], y.ravel()[use]]), use


def _normals(points: Array, circle: Array, camera_px: float = math.inf) -> Array:
    """(N, 3) normals where the rays of the camera meet the ball of an outline."""
    sphere = sphere_of_outline(circle, camera_px)
    normals: Array = (reflected(points, sphere, camera_px)[0] - sphere.centre_px) / sphere.radius_px
    return normals


def _need_shading(name: str, values: Array, clip: float) -> None:
    """Refuse an image that shows no shading on the ball."""
    peak = float(np.percentile(values, 99.0))
    if peak < LEAST_LEVEL:
        msg = f"{name}: too dark on the ball ({peak:.1f} of 255 at its brightest, {LEAST_LEVEL:g} is least)"
        raise CalibrationError(msg)
    clipped = float((values >= clip).mean())
    if clipped > SATURATED_SHARE:
        msg = f"{name}: overexposed: {100 * clipped:.0f} % of the ball is clipped; expose shorter"
        raise CalibrationError(msg)


def _nearness(normals: Array, levels: Levels, index: NDArray[np.intp]) -> tuple[Near, bool]:
    """What the lights together tell of their distance, and whether they can be linear.

    One alone mistakes for distance what is not Lambert's law.
    """
    seen = [image.ravel()[index] for image in levels.images]
    ratios = np.array([_fit(normals, values, values < levels.clip, levels.noise).near for values in seen])
    middle = max(float(np.median(ratios)), 0.0)
    # Standard error of a median, from the median absolute deviation.
    error = 1.2533 * 1.4826 * float(np.median(np.abs(ratios - np.median(ratios)))) / math.sqrt(len(ratios))
    spread = max(ALIKE * middle, LEAST_NEAR)
    # By what the ratios do not scatter no lamp differs from the others: that part of it is an error of all of them.
    own = float(np.clip(ratios.std(ddof=1), LEAST_NEAR, spread)) if len(ratios) > FEW_LIGHTS else spread
    is_linear = float(np.median(ratios)) + 2.0 * error > NOT_LINEAR
    return Near(middle, math.sqrt(error**2 + spread**2 - own**2), own), is_linear


def _fit(normals: Array, values: Array, used: NDArray[np.bool_], noise: float, prior: Near = NOT_KNOWN) -> _Fit:
    """Fit a light to the shading.

    The board reflects onto a ball what an endless plane does on which the ball rests, and throws its shadow.
    A lamp stands at some distance, 1 / q radii: what the ball turns to it is nearer to it, and the rest sees less of
    it. Left out, that tilts all lights of a ball by 120 degrees times q toward the board.
    """
    normals, values = normals[used], values[used]
    scale = max(float(values.max()), 1.0)
    spread = math.hypot(noise, 0.01 * scale)

    lit = values > np.percentile(values, 40.0)
    first, *_ = np.linalg.lstsq(normals[lit], values[lit], rcond=None)
    toward = first / np.linalg.norm(first)
    below = board_light(normals, toward)
    floor = float(values.min())
    cut = _noise_at(floor, values[normals @ toward < 0.0], noise)

    def lit_by(p: Array) -> tuple[Array, Array]:
        """The lamp's light, and its slopes by its strength times direction and by the radius over its distance."""
        strength = float(np.linalg.norm(p[:3]))
        toward, near = p[:3] / strength, p[5]
        cosine = normals @ toward
        # Toward the lamp are l - q n, in units of its distance: Lambert's cosine over the square of its length.
        square = 1.0 - 2.0 * near * cosine + near**2
        turned = np.maximum(cosine - near, 0.0)
        law = turned / square**1.5
        by_cosine = (turned > 0.0) / square**1.5 + 3.0 * near * turned / square**2.5
        by_near = strength * (3.0 * turned**2 / square**2.5 - (turned > 0.0) / square**1.5)
        by_vector = law[:, None] * toward + by_cosine[:, None] * (normals - cosine[:, None] * toward)
        return strength * law, np.column_stack([by_vector, by_near])

    def residuals(p: Array) -> Array:
        level = lit_by(p)[0] + p[3] + p[4] * below
        if cut > 0.0:
            level = floor + _mean_of_cut(level - floor, cut)
        return np.append((values - level) / spread, [p[4] / (BOARD_SHARE * scale), (p[5] - prior.mean) / prior.spread])

    def slopes(p: Array) -> Array:
        light, by_lamp = lit_by(p)
        rows = np.column_stack([by_lamp[:, :3], np.ones(len(values)), below, by_lamp[:, 3]])
        if cut > 0.0:  # the mean of what noise cuts rises with the level by the share that is not cut
            rows *= ndtr((light + p[3] + p[4] * below - floor) / cut)[:, None]
        priors = np.zeros((2, 6))
        priors[0, 4], priors[1, 5] = 1.0 / (BOARD_SHARE * scale), 1.0 / prior.spread
        return np.vstack([rows / -spread, priors])

    start = np.array([*first, 0.0, 0.0, prior.mean])
    fit = least_squares(residuals, start, slopes, loss="soft_l1", max_nfev=60)
    off = np.abs(fit.fun[:-2]) * spread
    residual = float(np.sqrt(np.mean(np.minimum(off, 4.0 * np.median(off) + noise) ** 2)))
    return _Fit(fit.x[:3], abs(float(fit.x[4])), residual, float(fit.x[5]))


def _noise_at(floor: float, shadow: Array, noise: float) -> float:
    """Noise where the attached shadow lies on the least grey level, which cuts it; 0 where it lies above."""
    if len(shadow) < LEAST_SHADOW or (shadow <= floor).mean() < CUT_SHARE:
        return 0.0
    # Half of the noise at least is seen: photons make that of lit pixels larger, but not that of dark ones.
    return min(noise, math.sqrt(2.0 * float(np.square(shadow - floor).mean())))


def _mean_of_cut(level: Array, noise: float) -> Array:
    """Mean of levels with normal noise, of which what is below 0 was set to 0."""
    share = level / noise
    mean: Array = level * ndtr(share) + noise * np.exp(-0.5 * share**2) / math.sqrt(2.0 * math.pi)
    return mean


def _spread(
    points: Array,
    values: Array,
    used: NDArray[np.bool_],
    outline: Outline,
    noise: float,
    direction: Array,
    camera_px: float,
    near: Near,
) -> tuple[Array, Array]:
    """Covariance (2, 2) of two turns by leaving out sectors; change (3, 3) of the direction by the outline, per px."""
    circle = outline.circle_px
    normals = _normals(points, circle, camera_px)
    sector = ((np.arctan2(*(points - circle[:2]).T[::-1]) / (2 * math.pi) + 0.5) * SECTORS).astype(int) % SECTORS
    tries = []
    for part in range(SECTORS):
        vector = _fit(normals, values, used & (sector != part), noise, near).vector
        tries.append(vector / np.linalg.norm(vector))
    off = np.array(tries) - np.mean(tries, axis=0)
    covariance = (SECTORS - 1) / SECTORS * off.T @ off
    across = _across(direction)
    columns = []
    step = 0.5
    for axis in np.eye(3):
        ahead = _fit(_normals(points, circle + step * axis, camera_px), values, used, noise, near).vector
        behind = _fit(_normals(points, circle - step * axis, camera_px), values, used, noise, near).vector
        columns.append((ahead / np.linalg.norm(ahead) - behind / np.linalg.norm(behind)) / (2 * step))
    return across @ covariance @ across.T + STEP_RAD**2 * np.eye(2), np.column_stack(columns)


def _across(direction: Array) -> Array:
    """(2, 3) unit vectors across a direction: one level, one upward."""
    level = np.cross([0.0, 0.0, 1.0], direction)
    level = np.array([1.0, 0.0, 0.0]) if np.linalg.norm(level) < 1e-9 else level / np.linalg.norm(level)  # noqa: PLR2004
    return np.stack([level, np.cross(direction, level)])
