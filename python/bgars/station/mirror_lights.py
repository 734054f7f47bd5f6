"""Highlights of every light on the mirror balls of a capture, and what is wrong with them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bgars.errors import CalibrationError
from bgars.files.light_names import light_name
from bgars.records.remark import Remark
from bgars.station.highlights import REACH, find_spot, fit_highlight, glare, middle_of
from bgars.station.mirror import sphere_of_outline
from bgars.station.small_spots import SMALL_PX, place_small_spots
from bgars.station.spot_fit import fit_spots

if TYPE_CHECKING:
    from bgars.records.capture import Capture
    from bgars.station.highlights import Spot
    from bgars.station.levels import Levels
    from bgars.station.mirror import Sphere
    from bgars.station.outline import Outline
    from bgars.station.small_spots import SmallSpot

__all__ = ["SeenHighlights", "highlights_on", "together"]

Array = NDArray[np.float64]

SECOND_SHARE = 0.35
"""Area of a second spot, of the first one's, from which on it is unclear which is the lamp."""
WIDE_DEG, TOO_WIDE_DEG = 8.0, 25.0
"""Angle of a lamp from which on its middle is doubted, and refused: an overexposed image, or no mirror."""
POOR_FIT, FAR_SHARE = 3.0, 0.3
"""Misfit of a disc, and distance of its middle from that of the bright pixels, of its radius, that make it none."""
MOVED_PX = 1.0
"""Small spots lie so near to the middle of their clipped pixels."""
ROUGH_SHARE = 0.15
"""Uncertainty of the middle of a highlight of any shape, of its radius."""
ALIKE = {
    "wide-highlight": "wide highlights: broad lamps, a rough ball, or overexposed",
    "two-highlights": "two highlights on the ball, the larger is taken, and u holds both; area of the second, of the "
    "first one's",
    "unsure": "directions are known to some degrees only",
    "no-disc": "the highlight is no disc; the middle of its bright pixels is taken",
}
FEW = 3


class SeenHighlights(NamedTuple):
    """Highlights on one ball."""

    places_px: Array
    covariances_px2: Array
    lamp_deg: Array
    flux: Array
    findings: list[Remark]


def highlights_on(capture: Capture, levels: Levels, outline: Outline, camera_px: float) -> SeenHighlights:
    """Find and place the highlight of each light on one ball; NaN where there is none.

    Raises
    ------
    CalibrationError
        An image that is overexposed on the ball.
    """
    count = len(levels.images)
    still, usable = glare(levels.images, outline.circle_px)
    sphere = sphere_of_outline(outline.circle_px, camera_px)
    places = np.full((count, 2), np.nan)
    covariances = np.full((count, 2, 2), np.nan)
    lamp_deg, flux = np.full(count, np.nan), np.full(count, np.nan)
    findings: list[Remark] = []
    spots: dict[int, Spot] = {}
    for index, image in enumerate(levels.images):
        name = light_name(index, capture.files)
        spot = find_spot(image, still, usable, levels.clip, levels.noise)
        if spot is None:
            message = f"{capture.name}: {name}: its highlight is not on the ball (within {REACH:g} of the radius)"
            findings.append(Remark("doubt", message, "no-highlight", light=index))
            continue
        wide_deg = math.degrees(4.0 * math.sqrt(spot.area_px / math.pi) / outline.radius_px)
        if wide_deg > TOO_WIDE_DEG:
            msg = (
                f"{capture.name}: {name}: overexposed or out of focus: its highlight covers {wide_deg:.0f} deg of "
                f"directions, at most {TOO_WIDE_DEG:g} can be one lamp on a mirror; expose shorter, or sphere 'matt'"
            )
            raise CalibrationError(msg)
        if wide_deg > WIDE_DEG:
            message = (
                f"{capture.name}: {name}: its highlight is {wide_deg:.0f} deg wide: a broad lamp, a rough "
                "ball, or overexposed"
            )
            findings.append(Remark("doubt", message, "wide-highlight", wide_deg, WIDE_DEG, "deg", index))
        if spot.second_share > SECOND_SHARE:
            share, limit = 100 * spot.second_share, 100 * SECOND_SHARE
            message = (
                f"{capture.name}: {name}: two highlights on the ball (the second has {share:.0f} % of the first one's "
                "area); the larger is taken, and u holds both"
            )
            findings.append(Remark("doubt", message, "two-highlights", share, limit, "%", index))
        spots[index] = spot
    small = [index for index, spot in spots.items() if spot.extent_px <= SMALL_PX and _saturated(levels, index, spot)]
    if small:
        placed = _place_small([levels.images[index] for index in small], still, [spots[index] for index in small],
                              sphere, levels, camera_px)  # fmt: skip
        for index, one in zip(small, placed, strict=True):
            places[index], covariances[index], lamp_deg[index] = one.place_px, one.covariance_px2, one.lamp_deg
    for index in sorted(set(spots) - set(small)):
        fit = fit_highlight(levels.images[index], still, spots[index], sphere, levels.clip, levels.noise, camera_px)
        name = light_name(index, capture.files)
        middle = middle_of(spots[index], still.shape, sphere, camera_px)
        radius = math.sqrt(spots[index].area_px / math.pi)
        off = math.inf if fit is None else math.hypot(fit.x_px - middle[0], fit.y_px - middle[1])
        unsure = fit is not None and float(np.linalg.eigvalsh(fit.covariance_px2)[-1]) > (FAR_SHARE * radius) ** 2
        if fit is None or (fit.saturated and (unsure or fit.misfit > POOR_FIT or off > FAR_SHARE * radius)):
            # A star, a streak, a bloom: its middle is that of its bright pixels, to a share of its size.
            places[index] = middle
            covariances[index] = (ROUGH_SHARE * radius) ** 2 * np.eye(2)
            message = f"{capture.name}: {name}: its highlight is no disc; the middle of its bright pixels is taken"
            findings.append(Remark("note", message, "no-disc", light=index))
            continue
        places[index], covariances[index] = (fit.x_px, fit.y_px), fit.covariance_px2
        lamp_deg[index], flux[index] = fit.lamp_deg, fit.flux
    covariances[np.isfinite(flux)] += _drawn_to_pixels(places[np.isfinite(flux)], still.shape) * np.eye(2)
    for index, spot in spots.items():
        if spot.second_share > SECOND_SHARE:
            # Either may be the lamp.
            apart = np.array([spot.second_place[1] - spot.col, spot.row - spot.second_place[0]])
            covariances[index] += np.outer(apart, apart)
    return SeenHighlights(places, covariances, lamp_deg, flux, together(findings, capture.name, count))


def _place_small(
    images: list[Array], still: Array, spots: list[Spot], sphere: Sphere, levels: Levels, camera_px: float
) -> list[SmallSpot]:
    """Places of clipped highlights of a few pixels."""
    placed = place_small_spots(images, still, spots, sphere, levels.clip, levels.noise, camera_px)
    starts = np.array([one.place_px for one in placed])
    extent_px = math.radians(placed[0].lamp_deg) * sphere.radius_px / 4.0
    fitted = fit_spots(images, still, spots, starts, sphere, levels.clip, levels.noise, camera_px, extent_px)
    # Where no lens and no disc explain the pixels, all of them that come near are weighed instead.
    explained = (fitted.misfits < POOR_FIT) & (np.hypot(*(fitted.places_px - starts).T) < MOVED_PX)
    return [
        _weighed(one, place, covariance) if good else one
        for one, place, covariance, good in zip(
            placed, fitted.places_px, fitted.covariances_px2, explained, strict=True
        )
    ]


def _weighed(one: SmallSpot, place: Array, covariance: Array) -> SmallSpot:
    """Mean and covariance of a place that is either that of the best fit or that of all discs, by their precision.

    A fit that hardly tells the size of the disc from the blur takes its covariance at one of many places that explain
    the pixels: far too large where nothing holds it, too small where another minimum is as deep.
    """
    share = np.trace(one.covariance_px2) / (np.trace(covariance) + np.trace(one.covariance_px2))
    apart = place - one.place_px
    return one._replace(
        place_px=share * place + (1.0 - share) * one.place_px,
        covariance_px2=share * covariance
        + (1.0 - share) * one.covariance_px2
        + share * (1.0 - share) * np.outer(apart, apart),
    )


def _drawn_to_pixels(places_px: Array, shape: tuple[int, int]) -> float:
    """Variance (px^2) of centroids of spots that are too small for the pixels, where their own places show it.

    A spot of which the pixels see the share P at one cycle a pixel has its centroid drawn toward the middle of its
    pixel by P / pi sin(2 pi x), x from there; P is then the mean of cos(2 pi x) over highlights, which lie anywhere.
    """
    middles = places_px + np.array([shape[1] / 2.0 - 0.5, shape[0] / 2.0 - 0.5])
    share = max(float(np.mean(np.cos(2.0 * np.pi * middles))), 0.0) if middles.size else 0.0
    return share**2 / (2.0 * np.pi**2)


def together(findings: list[Remark], name: str, count: int) -> list[Remark]:
    """Say once what is true of many lights: of `count`, in the capture that is named."""
    kept = []
    for code, words in ALIKE.items():
        alike = [one for one in findings if one.code == code]
        if len(alike) <= FEW:
            continue
        findings = [one for one in findings if one.code != code]
        sizes = [one.value for one in alike if one.value is not None]
        span = f" ({min(sizes):.0f} to {max(sizes):.0f} {alike[0].unit})" if sizes else ""
        lights = "all lights" if len(alike) == count else f"{len(alike)} of {count} lights"
        first = alike[0]
        top = max(sizes) if sizes else None
        kept.append(Remark(first.severity, f"{name}: {lights}: {words}{span}", code, top, first.limit, first.unit))
    return [*findings, *kept]


def _saturated(levels: Levels, index: int, spot: Spot) -> bool:
    row, col = round(spot.row), round(spot.col)
    part = levels.images[index, max(row - 2, 0) : row + 3, max(col - 2, 0) : col + 3]
    return bool((part >= levels.clip).any())
