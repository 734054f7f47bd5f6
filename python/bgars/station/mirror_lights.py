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

if TYPE_CHECKING:
    from bgars.records.capture import Capture
    from bgars.station.highlights import Spot
    from bgars.station.levels import Levels
    from bgars.station.outline import Outline

__all__ = ["SeenHighlights", "highlights_on"]

Array = NDArray[np.float64]

SECOND_SHARE = 0.35
"""Area of a second spot, of the first one's, from which on it is unclear which is the lamp."""
WIDE_DEG, TOO_WIDE_DEG = 8.0, 25.0
"""Angle of a lamp from which on its middle is doubted, and refused: a burnt-out image, or no mirror."""
POOR_FIT, FAR_SHARE = 3.0, 0.3
"""Misfit of a disc, and distance of its middle from that of the bright pixels, of its radius, that make it none."""
ROUGH_SHARE = 0.15
"""Uncertainty of the middle of a highlight of any shape, of its radius."""


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
        An image that is burnt out on the ball.
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
                f"{capture.name}: {name}: burnt out: its highlight covers {wide_deg:.0f} deg of directions, at most "
                f"{TOO_WIDE_DEG:g} can be one lamp on a mirror; expose shorter, or use sphere 'matt'"
            )
            raise CalibrationError(msg)
        if wide_deg > WIDE_DEG:
            message = (
                f"{capture.name}: {name}: its highlight is {wide_deg:.0f} deg wide: a broad lamp, a rough "
                "ball, or burnt out"
            )
            findings.append(Remark("doubt", message, "wide-highlight", wide_deg, WIDE_DEG, "deg", index))
        if spot.second_share > SECOND_SHARE:
            message = (
                f"{capture.name}: {name}: two highlights on the ball (the second has "
                f"{100 * spot.second_share:.0f} % of "
                "the first one's area); the larger is taken"
            )
            findings.append(Remark("doubt", message, "two-highlights", spot.second_share, SECOND_SHARE, "", index))
        spots[index] = spot
    small = [index for index, spot in spots.items() if spot.extent_px <= SMALL_PX and _saturated(levels, index, spot)]
    if small:
        placed = place_small_spots(
            [levels.images[index] for index in small],
            still,
            [spots[index] for index in small],
            sphere,
            levels.clip,
            levels.noise,
            camera_px,
        )
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
    return SeenHighlights(places, covariances, lamp_deg, flux, findings)


def _saturated(levels: Levels, index: int, spot: Spot) -> bool:
    row, col = round(spot.row), round(spot.col)
    part = levels.images[index, max(row - 2, 0) : row + 3, max(col - 2, 0) : col + 3]
    return bool((part >= levels.clip).any())
