"""Images shifted against the others."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bgars.checks.evidence import critical_t
from bgars.checks.shifts import image_shifts
from bgars.records.findings import Finding

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from bgars.checks.shifts import ImageShifts
    from bgars.records.capture import Capture

__all__ = ["check_motion", "find_move", "moves", "registered", "told_move"]

Array = NDArray[np.float64]
Images = NDArray[np.intp]

MOVED_PX = 0.3
"""Shift that is told: a third of a pixel is what edges of albedo turn into false slopes of some degrees."""
OF_OTHERS = 6.0
"""Times the usual shift that is left of the other images, which the shape of highlights and edges makes."""
EQUAL_PX = 0.02
"""To which images lie alike, at best."""
AGREES = 0.8
"""Of the usual agreement of edges, from which on an image has those of the others, which lie elsewhere only where it
moved. Under a light much lower than the others most edges are its own, of highlights and shadows, ..."""
TOWARDS_DEG = 45.0
"""... and lie towards it: nearer to its azimuth than this such a shift is none."""
MIN_LIGHTS = 6
"""Of fewer, what is left over does not tell which image has moved."""


class Move(NamedTuple):
    """Images that moved together: their shift (x right, y up), its standard error, the usual one that is left."""

    images: Images
    shift_px: Array
    u_px: float
    usual_px: float

    @property
    def size_px(self) -> float:
        """Length of the shift."""
        return float(np.hypot(*self.shift_px))


def moves(found: ImageShifts, lights: Array) -> Iterator[Move]:
    """Each image, and all from each image on, as if these had moved and nothing else.

    Gradients of shading are not where those of albedo are: that shifts all images in proportion to their lights. Of an
    image whose light stands apart from the others this is known worse: what is usual is that of a light of the ring
    (whose leverage is 3 / L), and grows with the standard error of the shift.
    """
    count = len(lights)
    usual_model = np.column_stack([np.ones(count), lights[:, :2]])
    tiles = len(found.without_px)
    groups = [np.array([index]) for index in range(count)]
    groups += [np.arange(first, count) for first in range(2, count - 1)]
    for images in groups:
        moved = np.zeros(count)
        moved[images] = 1.0
        solve = np.linalg.pinv(np.column_stack([usual_model, moved]))
        shift = solve[-1] @ found.place_px
        spread = np.square(found.without_px.transpose(0, 2, 1) @ solve[-1] - shift).sum(axis=1)
        error = float(np.sqrt((tiles - 1) / tiles * spread.sum()))
        left = found.place_px - usual_model @ (solve[:3] @ found.place_px) - moved[:, None] * shift
        alone = len(images) == 1
        free = np.delete(left, images, axis=0) if alone else left
        apart = float(np.linalg.norm(solve[-1])) * (1.0 - 3.0 / count) ** 0.5 if alone else 1.0
        yield Move(images, shift, error, apart * float(np.median(np.hypot(*free.T))))


def find_move(capture: Capture, kept: Images, lights: Array) -> Move | None:
    """Return the images, of the kept ones, that moved, and by how much; None where none did for certain.

    Parameters
    ----------
    capture : Capture
    kept : (K,) intp
        Images with light of their own.
    lights : (K, 3) float64
        Of these.
    """
    if len(lights) < MIN_LIGHTS:
        return None
    found = image_shifts(capture, kept)
    if found is None:
        return None
    candidates = list(moves(found, lights))
    critical = critical_t(len(found.without_px), len(candidates))
    certain = [
        move
        for move in candidates
        if move.size_px > max(MOVED_PX, critical * move.u_px, OF_OTHERS * max(move.usual_px, EQUAL_PX))
        and not _follows(move, found.agreement, lights)
    ]
    # A shift that is put where it is not leaves more over.
    return min(certain, key=lambda move: move.usual_px / move.size_px, default=None)


def _follows(move: Move, agreement: Array, lights: Array) -> bool:
    """Whether one image's edges lie towards its light, and are not those of the others."""
    light = lights[move.images[0], :2]
    towards = float(move.shift_px @ light) > np.cos(np.radians(TOWARDS_DEG)) * move.size_px * float(np.hypot(*light))
    return len(move.images) == 1 and bool(agreement[move.images[0]] < AGREES) and towards


def registered(capture: Capture, kept: Images, move: Move) -> Capture:
    """The capture with a move undone, to whole pixels; the margin that came in is outside the mask."""
    right, up = (round(float(each)) for each in move.shift_px)
    images, mask = capture.images.copy(), capture.mask.copy()
    for index in kept[move.images]:
        images[index] = np.roll(images[index], (up, -right), axis=(0, 1))
    rows, cols = mask.shape
    mask[: max(up, 0)] = mask[rows - max(-up, 0) :] = False
    mask[:, cols - max(right, 0) :] = mask[:, : max(-right, 0)] = False
    return replace(capture, images=images, mask=mask)


def check_motion(capture: Capture, kept: Images, lights: Array, names: Sequence[str]) -> list[Finding]:
    """Find an image that moved, or the moment from which on the images lie elsewhere.

    Parameters
    ----------
    capture : Capture
    kept : (K,) intp
        Images with light of their own.
    lights, names
        Of these.
    """
    best = find_move(capture, kept, lights)
    return [] if best is None else [told_move(best, names)]


def told_move(best: Move, names: Sequence[str]) -> Finding:
    """Tell of images that moved."""
    right, up = best.shift_px
    first = int(best.images[0])
    which = names[first] if len(best.images) == 1 else f"each image from {names[first]} on"
    return Finding(
        "motion",
        "warning",
        f"{which} is shifted by {best.size_px:.1f} pixels against the others ({right:+.1f} right, {up:+.1f} up)",
        "fix part and camera, wait until everything stands still, and take the images again",
        image=first,
        value=best.size_px,
        limit=MOVED_PX,
        unit="px",
    )
