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
SEGMENTS = 8
"""Segments of the curve in logarithms of level and light, each a power law."""
SAMPLES = 4000
SMOOTH = 0.01
"""Weight of a change of exponent between segments, of that of all equations."""
LOW, HIGH = 0.02, 0.98
"""Grey levels between which pixels say something."""
LINEAR = 0.01
"""Largest distance from a straight line of a camera that counts as linear, of full scale."""
LEAST_PIXELS = 200


def response_from_bracket(
    images: Sequence[NDArray[np.generic]], exposures: ArrayLike, full_scale: float
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

    Raises
    ------
    InputError
        Fewer than two images, or exposures that are not above 0, or all alike.
    CalibrationError
        Too few pixels that two exposures show well, or images that do not get brighter with the exposure.

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
    levels = np.stack([np.asarray(image, dtype=np.float64).ravel() for image in images], axis=1) / full_scale
    if times.min() == times.max():
        msg = f"exposures: must be two different times or more, got {times.tolist()}"
        raise InputError(msg)
    good = ((levels > LOW) & (levels < HIGH)).sum(axis=1) >= 2  # noqa: PLR2004 - two exposures
    if int(good.sum()) < LEAST_PIXELS:
        msg = f"exposures: only {int(good.sum())} pixels are well exposed in two images, {LEAST_PIXELS} are needed"
        raise CalibrationError(msg)
    levels = _spread_sample(levels[good])
    use = (levels > LOW) & (levels < HIGH)
    rows, steps, weights = [], [], []
    for first in range(len(times)):
        for second in range(first + 1, len(times)):
            both = use[:, first] & use[:, second]
            pair = levels[both][:, [first, second]]
            rows.append(_ramps(pair[:, 1]) - _ramps(pair[:, 0]))
            steps.append(np.full(len(pair), math.log(times[second] / times[first])))
            weights.append(pair.min(axis=1))  # noise of a logarithm goes by one over the level
    weight = np.concatenate(weights)
    _need_brighter(levels, use, times)
    matrix, right = np.concatenate(rows), np.concatenate(steps)
    bend = _bend(SMOOTH * math.sqrt(float(np.square(weight).sum())))
    slopes, _ = nnls(np.vstack([matrix * weight[:, None], bend]), np.append(right * weight, np.zeros(len(bend))))
    off = matrix @ slopes - right
    return _curve(slopes, 0.5 * 1.4826 * float(np.median(np.abs(off * weight))), f"exposure bracket of {len(times)}")


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
    first: NDArray[np.generic], second: NDArray[np.generic], both: NDArray[np.generic], full_scale: float
) -> tuple[ResponseCurve, tuple[Remark, ...]]:
    """Find the inverse response from light a, light b, and both together: their light adds up.

    Parameters
    ----------
    first, second, both : (..., H, W)
        Images under either light and under both, nothing moved.
    full_scale : float
        Grey level of full scale; without light it must be 0 (subtract a dark frame).

    Raises
    ------
    CalibrationError
        Too few pixels between black and clipped.
    """
    a, b, c = (np.asarray(image, dtype=np.float64).ravel() / full_scale for image in (first, second, both))
    good = (a > LOW) & (b > LOW) & (c > LOW) & (c < HIGH)
    if int(good.sum()) < LEAST_PIXELS:
        msg = f"only {int(good.sum())} pixels are well exposed in all three images, {LEAST_PIXELS} are needed"
        raise CalibrationError(msg)
    levels = _spread_sample(np.column_stack([c, a, b])[good])
    ramps = [_ramps(levels[:, index]) for index in range(3)]
    weight = levels[:, 1:].min(axis=1)
    bend = _bend(SMOOTH * math.sqrt(float(np.square(weight).sum())))

    def residuals(slopes: Array) -> Array:
        f_both, f_first, f_second = (np.exp(ramp @ slopes) for ramp in ramps)
        rows: Array = np.append(weight * np.log((f_first + f_second) / f_both), bend @ slopes)
        return rows

    fit = least_squares(residuals, np.ones(SEGMENTS), bounds=(0.05, 10.0))
    off = 1.4826 * float(np.median(np.abs(fit.fun[: len(weight)])))
    return _curve(fit.x, off, "sums of lights")


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
    edges = np.linspace(math.log(LOW), 0.0, SEGMENTS + 1)
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


def _curve(slopes: Array, u: float, source: str) -> tuple[ResponseCurve, tuple[Remark, ...]]:
    knots = np.linspace(0.0, 1.0, KNOTS) ** 2
    curve = np.append(0.0, np.exp(_ramps(knots[1:]) @ slopes))
    curve = np.maximum.accumulate(curve + 1e-9 * np.arange(KNOTS))
    found = ResponseCurve(knots, curve / curve[-1], u, source)
    if found.nonlinearity > max(LINEAR, 3.0 * u):
        message = (
            f"the camera is not linear: up to {100 * found.nonlinearity:.1f} % of full scale off a straight "
            f"line, about gamma {found.gamma:.2f}"
        )
        return found, (Remark("doubt", message, "not-linear", found.nonlinearity, LINEAR),)
    return found, (
        Remark(
            "note",
            f"the camera is linear within {100 * max(found.nonlinearity, u):.1f} % of full scale",
            "linear",
            found.nonlinearity,
            LINEAR,
        ),
    )
