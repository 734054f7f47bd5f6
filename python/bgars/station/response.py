"""The camera's response: what light a grey level stands for, and whether that is a straight line."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares, nnls

from bgars.errors import CalibrationError, InputError
from bgars.records.remark import Remark
from bgars.records.response_curve import ResponseCurve, srgb_light

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["response_from_bracket", "response_from_sums", "srgb_response"]

Array = NDArray[np.float64]

KNOTS = 65
"""Knots of the curve, dense near black."""
LOW, HIGH = 0.02, 0.98
"""Grey levels between which pixels say something."""
EDGES = np.append(np.geomspace(LOW, 0.35, 8), np.linspace(0.4, 1.0, 13))
"""Levels between which the curve is a power law: even in the logarithm near black, and in level where a camera's
shoulder or knee is, of which a segment from 0.6 to 1 left 4 % of full scale."""
SEGMENTS = len(EDGES) - 1
SAMPLES = 12_000
SMOOTH, STIFF = 0.003, 0.03
"""Weights of a change of exponent between segments, of that of all equations: of a curve that follows what it can, and
of one that is kept where it explains the levels as well."""
ASKED = 10.0
"""Fall of chi square for each segment from which on the levels ask for the former: 4, and pairs share images."""
LINEAR = 0.01
"""Largest distance from a straight line of a camera that counts as linear, of full scale."""
NONSENSE = 0.2  # of full scale, of levels from their curve: as far off as a camera's gamma is from a straight line
LEAST_PIXELS = 200
SURE = 2.0
"""Times the least level, from which on noise of 8 bits moves no pixel across it."""
BINS = 24
"""Parts of the range of light in which residuals have a mean, each of LEAST_PIXELS / 10 or more."""
PEDESTAL, PEDESTAL_LEVEL = 1.5, 0.3
"""Exponent of the darkest levels, of that of the others, from which on a black level is in them: cameras bend toward 1
in the dark, but a level d above black makes it L / (L - d). Levels that are dark are below the second number."""


def response_from_bracket(
    images: Sequence[NDArray[np.generic]],
    exposures: ArrayLike,
    full_scale: float,
    *,
    dark: float = 0.0,
) -> tuple[ResponseCurve, tuple[Remark, ...]]:
    """Find the inverse response from one scene at several exposure times.

    The logarithm of light grows by that of the exposure: the equations of Debevec & Malik (1997), over a curve that
    is a power law in each of a few segments, with exponents that cannot be negative.

    Parameters
    ----------
    images : sequence of (H, W)
        The same scene, nothing moved.
    exposures : (N,) array_like
        Exposure times, any unit.
    full_scale : float
        Grey level of full scale.
    dark : float
        Grey level without light: the median of a dark frame, whose pixels are noise. The curve is one of levels as the
        camera gives them, this included: what it becomes on the curve is subtracted after it.

    Raises
    ------
    InputError
        Fewer than two images, or exposures that are not above 0, or all alike.
    CalibrationError
        Too few pixels that two exposures show well, images that do not get brighter with the exposure, or no curve that
        explains the levels.

    References
    ----------
    Debevec, P. E. & Malik, J. (1997). Recovering high dynamic range radiance maps from photographs. SIGGRAPH.

    Examples
    --------
    >>> light = np.linspace(0.01, 1.0, 5000).reshape(50, 100)
    >>> shots = [np.rint(255 * np.clip(light * t, 0, 1) ** (1 / 2.2)) for t in (0.25, 0.5, 1.0)]
    >>> curve, findings = response_from_bracket(shots, [0.25, 0.5, 1.0], 255.0)
    >>> round(curve.gamma, 1), findings[0].code
    (2.2, 'not-linear')
    """
    times = np.asarray(exposures, dtype=np.float64)
    if times.ndim != 1 or len(times) != len(images) or len(times) < 2 or not (np.isfinite(times) & (times > 0)).all():  # noqa: PLR2004
        msg = (
            f"exposures: must be finite and above 0, one per image, two or more, got {times.tolist()} for "
            f"{len(images)} images"
        )
        raise InputError(msg)
    levels, black = _above(images, dark, full_scale)
    if times.min() == times.max():
        msg = f"exposures: must be two different times or more, got {times.tolist()}"
        raise InputError(msg)
    good = ((levels > LOW) & (levels < HIGH)).sum(axis=1) >= 2  # noqa: PLR2004 - two exposures
    if int(good.sum()) < LEAST_PIXELS:
        msg = f"exposures: only {int(good.sum())} pixels are well exposed in two images, {LEAST_PIXELS} are needed"
        raise CalibrationError(msg)
    levels = _spread_sample(levels[good])
    use = (levels > LOW) & (levels < HIGH)
    _need_brighter(levels, use, times)
    tops, lows, right, weight = _pairs(levels, use, times)

    def solved(smooth: float) -> Array:
        bend = _bend(smooth * math.sqrt(float(np.square(weight).sum())))
        rows = np.vstack([(tops - lows) * weight[:, None], bend])
        return np.asarray(nnls(rows, np.append(right * weight, np.zeros(len(bend))))[0])

    soft, stiff = solved(SMOOTH), solved(STIFF)
    # Near the least level noise lets those pairs pass that are too bright: the longer exposure says which are near.
    whole = tops @ stiff - right > _ramps(np.array([SURE * LOW])) @ stiff

    def misfit(slopes: Array) -> float:
        return float(np.square(weight * ((tops - lows) @ slopes - right))[whole].sum())

    slopes = soft if _is_asked(misfit(soft), misfit(stiff), int(whole.sum())) else stiff
    tops, lows, right, weight = tops[whole], lows[whole], right[whole], weight[whole]
    off = (tops - lows) @ slopes - right
    light = np.exp(tops @ slopes)
    # A pair of exposures shows the error of a step of light; steps of a factor of two add up to half as much again.
    left = _structure(light, 0.5 * math.log(2.0) * light * off / right, np.square(weight * right / light))
    noise = 0.5 * 1.4826 * float(np.median(np.abs(off * weight)))
    u = math.hypot(noise, left, _stiffness(soft, stiff))
    curve, found = _curve(slopes, u, f"exposure bracket of {len(times)}", black)
    return curve, (*found, *_doubts(slopes, levels, left, black))


def _pairs(levels: Array, use: NDArray[np.bool_], times: Array) -> tuple[Array, Array, Array, Array]:
    """Ramps of the longer and the shorter exposure, the logarithm of the ratio of their times, and weights.

    Of all pairs of exposures that a pixel is well exposed in.
    """
    tops, lows, steps, weights = [], [], [], []
    for first, second in itertools.combinations(np.argsort(times), 2):
        if times[first] == times[second]:
            continue
        both = use[:, first] & use[:, second]
        short, long = levels[both, first], levels[both, second]
        tops.append(_ramps(long))
        lows.append(_ramps(short))
        steps.append(np.full(len(short), math.log(times[second] / times[first])))
        weights.append(np.minimum(short, long))  # noise of a logarithm goes by one over the level
    return np.concatenate(tops), np.concatenate(lows), np.concatenate(steps), np.concatenate(weights)


def _need_brighter(levels: Array, use: NDArray[np.bool_], times: Array) -> None:
    """Refuse images that do not get brighter with their exposure times: no curve explains them, but one of zeros."""
    order = np.argsort(times)
    for first, second in itertools.pairwise(order):
        both = use[:, first] & use[:, second]
        longer = times[second] > times[first]
        if longer and both.any() and np.median(levels[both, second] - levels[both, first]) <= 0:
            msg = (
                f"exposures: image {second} ({times[second]:g}) is no brighter than image {first} ({times[first]:g}), "
                "counted from 0: give the exposure times in the order of the images"
            )
            raise CalibrationError(msg)


def response_from_sums(
    first: NDArray[np.generic],
    second: NDArray[np.generic],
    both: NDArray[np.generic],
    full_scale: float,
    *,
    dark: float = 0.0,
) -> tuple[ResponseCurve, tuple[Remark, ...]]:
    """Find the inverse response from light a, light b, and both together: their light adds up.

    Parameters
    ----------
    first, second, both : (..., H, W)
        Images under either light and under both, nothing moved.
    full_scale : float
        Grey level of full scale.
    dark : float
        Grey level without light; see :func:`response_from_bracket`.

    Raises
    ------
    CalibrationError
        Too few pixels between black and clipped, images in another order, or no curve that explains the levels.
    """
    levels, black = _above((first, second, both), dark, full_scale)
    a, b, c = levels.T
    good = (a > LOW) & (b > LOW) & (c > LOW) & (c < HIGH)
    if int(good.sum()) < LEAST_PIXELS:
        msg = f"only {int(good.sum())} pixels are well exposed in all three images, {LEAST_PIXELS} are needed"
        raise CalibrationError(msg)
    for name, alone in (("a", a), ("b", b)):
        if np.median((c - alone)[good]) <= 0:
            msg = f"the image of both lights is no brighter than that of light {name}: give them as a, b, both"
            raise CalibrationError(msg)
    levels = _spread_sample(np.column_stack([c, a, b])[good])
    ramps = [_ramps(levels[:, index]) for index in range(3)]
    weight = levels[:, 1:].min(axis=1)
    size = math.sqrt(float(np.square(weight).sum()))

    def solved(smooth: float) -> tuple[Array, Array]:
        bend = _bend(smooth * size)

        def residuals(slopes: Array) -> Array:
            f_both, f_first, f_second = (np.exp(ramp @ slopes) for ramp in ramps)
            rows: Array = np.append(weight * np.log((f_first + f_second) / f_both), bend @ slopes)
            return rows

        fit = least_squares(residuals, np.ones(SEGMENTS), bounds=(0.05, 10.0))
        return fit.x, fit.fun[: len(weight)]

    (soft, rest), (stiff, rest_of_stiff) = solved(SMOOTH), solved(STIFF)
    slopes = soft
    if not _is_asked(float(rest @ rest), float(rest_of_stiff @ rest_of_stiff), len(rest)):
        slopes, rest = stiff, rest_of_stiff
    light = np.exp(ramps[0] @ slopes)
    whole = weight > SURE * LOW
    left = _structure(light[whole], (light * rest / weight)[whole], np.square(weight / light)[whole])
    u = math.hypot(1.4826 * float(np.median(np.abs(rest))), left, _stiffness(soft, stiff))
    curve, found = _curve(slopes, u, "sums of lights", black)
    return curve, (*found, *_doubts(slopes, levels, left, black))


def srgb_response() -> ResponseCurve:
    """Return the inverse response of sRGB (IEC 61966-2-1).

    Examples
    --------
    >>> round(float(np.interp(0.5, srgb_response().levels, srgb_response().radiances)), 3)
    0.214
    """
    levels = np.linspace(0.0, 1.0, 257)
    return ResponseCurve(levels, srgb_light(levels), 0.0, "sRGB")


def _ramps(levels: Array) -> Array:
    """(N, SEGMENTS) logarithm of the level, cut into segments that end at full scale."""
    edges = np.log(EDGES)
    logs = np.log(np.maximum(levels, 1e-9))[:, None]
    ramps: Array = np.clip(logs, edges[:-1], edges[1:]) - edges[1:]
    ramps[:, 0] += np.minimum(logs[:, 0] - edges[0], 0.0)
    return ramps


def _bend(weight: float) -> Array:
    """Rows that ask for equal slopes of neighbouring segments: a power law."""
    rows: Array = weight * (np.eye(SEGMENTS)[1:] - np.eye(SEGMENTS)[:-1])
    return rows


def _spread_sample(levels: Array) -> Array:
    """Rows spread evenly over the first column's levels."""
    order = np.argsort(levels.mean(axis=1))
    spread = np.linspace(levels.mean(axis=1).min(), levels.mean(axis=1).max(), SAMPLES // 2)
    even = np.searchsorted(levels.mean(axis=1)[order], spread).clip(0, len(order) - 1)
    also = np.linspace(0, len(order) - 1, SAMPLES // 2).astype(int)
    rows: Array = levels[order[np.unique(np.concatenate([even, also]))]]
    return rows


def _above(images: Sequence[NDArray[np.generic]], dark: float, full_scale: float) -> tuple[Array, float]:
    """(N, images) levels above black, 1 = full scale; and black itself, of full scale."""
    black = dark / full_scale
    if not 0.0 <= black < 1.0:
        msg = f"dark: must be below full scale ({full_scale:g}), got {dark:g}"
        raise InputError(msg)
    levels = np.stack([np.asarray(image, dtype=np.float64).ravel() for image in images], axis=1) - dark
    return levels / (full_scale - dark), black


def _structure(light: Array, errors: Array, weights: Array) -> float:
    """Largest mean error, 1 = full scale, of a part of the range of light: what the form of the curve leaves."""
    part = np.minimum((light * BINS).astype(int), BINS - 1)
    found = [0.0]
    for index in np.flatnonzero(np.bincount(part, minlength=1) >= LEAST_PIXELS / 10):
        error, weight = errors[part == index], weights[part == index]
        mean = float(np.average(error, weights=weight))
        u = math.sqrt(float(np.square(weight * (error - mean)).sum())) / float(weight.sum())
        found.append(math.sqrt(max(mean**2 - u**2, 0.0)))
    return max(found)


def _is_asked(soft: float, stiff: float, count: int) -> bool:
    """Whether sums of squares of `count` residuals tell a curve that follows them from a stiffer one."""
    return count * (stiff - soft) > ASKED * SEGMENTS * soft


def _stiffness(slopes: Array, stiff: Array) -> float:
    """Half of what a smoother curve would be off, 1 = full scale: what smoothing may have cost, or noise have added."""
    levels = np.linspace(LOW, 1.0, KNOTS)
    one, other = (np.exp(_ramps(levels) @ each) for each in (slopes, stiff))
    return 0.5 * float(np.abs(one - other * (one @ one) / (one @ other)).max())


def _doubts(slopes: Array, levels: Array, left: float, black: float) -> list[Remark]:
    """What does not look like a camera's curve, or like no curve at all."""
    found = []
    if left > LINEAR:
        message = (
            f"no curve explains the levels: up to {100 * left:.1f} % of full scale are left, by level: something "
            "moved, the light or an exposure time is not as stated, or there is a black level"
        )
        if left > NONSENSE:
            raise CalibrationError(message)
        found.append(Remark("doubt", message, "response-structure", left, LINEAR))
    inside = [((levels > low) & (levels < high)).sum() for low, high in itertools.pairwise(EDGES)]
    seen = np.flatnonzero(np.array(inside) > LEAST_PIXELS)
    dark, others = seen[EDGES[seen + 1] < PEDESTAL_LEVEL], seen[EDGES[seen] >= PEDESTAL_LEVEL]
    if black == 0.0 and len(dark) and len(others):
        ratio = float(slopes[dark[0]] / max(float(np.median(slopes[others])), 1e-6))
        if ratio > PEDESTAL:
            message = (
                "the darkest levels change less with light than any camera's: a black level, or stray light, is in "
                "them; photograph dark.png with all lamps off, or state black_level in capture.toml"
            )
            found.append(Remark("doubt", message, "black-level", ratio, PEDESTAL))
    return found


def _curve(slopes: Array, u: float, source: str, black: float) -> tuple[ResponseCurve, tuple[Remark, ...]]:
    """The curve over levels that hold `black`, and whether it is a straight line."""
    knots = np.linspace(0.0, 1.0, KNOTS) ** 2
    curve = np.append(0.0, np.exp(_ramps(knots[1:]) @ slopes))
    curve = np.maximum.accumulate(curve + 1e-9 * np.arange(KNOTS))
    if black > 0:  # below it noise goes on as the curve begins: what black becomes is subtracted from all
        per_level = float(np.interp(LOW, knots, curve)) / LOW / (1.0 - black)
        curve = np.append(0.0, per_level * black + curve)
        knots = np.append(0.0, black + (1.0 - black) * knots)
    found = ResponseCurve(knots, curve / curve[-1], u, source)
    if found.nonlinearity > max(LINEAR, 3.0 * u):
        message = (
            f"the camera is not linear: up to {100 * found.nonlinearity:.1f} % of full scale off a straight "
            f"line, about gamma {found.gamma:.2f}"
        )
        return found, (Remark("doubt", message, "not-linear", found.nonlinearity, LINEAR),)
    most = 100 * max(found.nonlinearity, u)
    if u > SURE * LINEAR:
        words = f"whether the camera is linear is known to {most:.1f} % of full scale only"
        return found, (Remark("doubt", words, "linear", found.nonlinearity, LINEAR),)
    message = f"the camera is linear within {most:.1f} % of full scale"
    return found, (Remark("note", message, "linear", found.nonlinearity, LINEAR),)
