"""How far single images are shifted against the others, by the outlines of the balls."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bgars.errors import CalibrationError
from bgars.files.light_names import light_name

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from bgars.inspection.outline import Outlines

__all__ = [
    "MIN_STRETCHES",
    "SHIFT_SIGMAS",
    "SHIFT_WARNING_PX",
    "ImageShifts",
    "agreed_shifts",
    "check_shifts",
    "displaced_images",
    "image_shifts",
    "with_texture",
]

Array = NDArray[np.float64]

SHIFT_WARNING_PX, SHIFT_ERROR_PX = 0.4, 1.0
"""Shifts that are told, and that refuse a capture."""
SHIFT_SIGMAS = 6.0
"""Standard uncertainties that a shift must have to be one."""
CERTAIN_SIGMAS = 2.0
"""Standard uncertainties by which a shift must be beyond the reach of a fine look."""
AGREEING = 0.5
"""Share of a coarse shift that a fine look must see, along it."""
MIN_STRETCHES = 20
"""Stretches of edge that a judgement of an image rests on."""
FEW_OUTLINES = 0.25
"""An image that shows less than this share of the outlines that the others show, where they show them, is displaced."""


class ImageShifts(NamedTuple):
    """(L, 2) how far each image is shifted against the others, px, and its standard uncertainty (L,); inf: unknown."""

    move_px: Array
    u_px: Array


def image_shifts(outlines: Outlines) -> ImageShifts:
    """Shifts of images from the outlines of the balls in each.

    Under one light an outline is seen on one side only, and how its shading moves the edge is the same under every
    light: what differs between lights is a shift.
    """
    lights = len(outlines.azimuths_rad)
    shifts = ImageShifts(np.zeros((lights, 2)), np.full(lights, np.inf))
    weight = np.where(np.isfinite(outlines.u_shift_px), 1.0, 0.0)
    shift = np.where(weight > 0, outlines.shift_px, np.nan)
    if weight.sum() < MIN_STRETCHES * lights:
        return shifts
    # A place of the outline that no light shows has no usual shift.
    shown: NDArray[np.bool_] = np.asarray(np.isfinite(shift).any(axis=(0, 1)))
    usual = np.full(len(shown), np.nan)
    usual[shown] = np.nanmedian(shift[:, :, shown], axis=(0, 1))
    for light, azimuth in enumerate(outlines.azimuths_rad):
        off = shift[:, light] - usual[None, :]
        known = np.isfinite(off)
        if known.sum() < MIN_STRETCHES:
            continue
        angle = np.broadcast_to(azimuth + outlines.offset_rad[None, :], off.shape)[known]
        system, found = np.column_stack([np.cos(angle), np.sin(angle)]), off[known]
        spread = max(1.4826 * float(np.median(np.abs(found - np.median(found)))), 1e-3)
        keep = np.abs(found - np.median(found)) < 4.0 * spread
        shifts.move_px[light] = np.linalg.lstsq(system[keep], found[keep], rcond=None)[0]
        shifts.u_px[light] = spread / np.sqrt(max(int(keep.sum()), 1) / 2.0)
    return shifts


def agreed_shifts(coarse: ImageShifts, fine: ImageShifts) -> ImageShifts:
    """Coarse shifts that the outlines' shape confirms, and that are large enough to be none of shading.

    By area alone, a shadow beside the rim looks like a shift.
    """
    size = np.hypot(*coarse.move_px.T)
    along = (coarse.move_px * fine.move_px).sum(axis=1)
    # The fine look knows the shape of an edge that lies within its spread: a pixel at most, as far as one can tell.
    near = size - CERTAIN_SIGMAS * coarse.u_px < SHIFT_ERROR_PX
    denied = np.isfinite(fine.u_px) & near & (along < AGREEING * size**2)
    denied |= size < SHIFT_WARNING_PX
    return ImageShifts(np.where(denied[:, None], 0.0, coarse.move_px), coarse.u_px)


def with_texture(by_outlines: ImageShifts, by_texture: ImageShifts) -> ImageShifts:
    """Shifts by the board's texture where it is seen, but for those that are too large for it, as outlines tell."""
    size = np.hypot(*by_outlines.move_px.T), np.hypot(*by_texture.move_px.T)
    if np.max(size) >= SHIFT_ERROR_PX or not np.isfinite(by_texture.u_px).all():
        return by_outlines
    return by_texture


def check_shifts(shifts: ImageShifts, files: Sequence[Path] = ()) -> tuple[str, ...]:
    """Name images that are shifted by little.

    Raises
    ------
    CalibrationError
        A shift of a pixel or more.
    """
    warnings = []
    for light, (move, u_move) in enumerate(zip(shifts.move_px, shifts.u_px, strict=True)):
        size = float(np.hypot(*move))
        if not np.isfinite(u_move) or size < max(SHIFT_WARNING_PX, SHIFT_SIGMAS * u_move):
            continue
        name = light_name(light, files, what="image")
        text = f"{name} is shifted by ({move[0]:+.1f}, {move[1]:+.1f}) pixels (x right, y up) against the others"
        if size >= SHIFT_ERROR_PX:
            raise CalibrationError(text)
        warnings.append(text)
    return tuple(warnings)


def displaced_images(outlines: Outlines, files: Sequence[Path] = ()) -> tuple[str, ...]:
    """Name images whose balls have no outline where the others have one.

    A shift of some pixels along the light's azimuth is taken for another elevation by the fit, and is too far for
    `check_shifts`: then outlines are not merely moved, they are not found.
    """
    known = np.isfinite(outlines.u_shift_px).sum(axis=(0, 2))
    usual = float(np.median(known))
    if usual < MIN_STRETCHES:
        return ()
    return tuple(
        f"{light_name(light, files, what='image')} shows {known[light]} stretches of outline where other images show "
        f"{usual:.0f}: it is shifted, or shows something else"
        for light in map(int, np.flatnonzero(known < FEW_OUTLINES * usual))
    )
