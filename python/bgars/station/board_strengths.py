"""How strong each light is, by the matt board that the balls rest on: its lit pixels, no ball and no shadow."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bgars.station.balls_seen import disc_of_mask

if TYPE_CHECKING:
    from bgars.records.capture import Capture
    from bgars.station.levels import Levels
    from bgars.station.light_bundle import LightSolution

__all__ = ["BoardStrengths", "board_strengths"]

Array = NDArray[np.float64]

BESIDE, BESIDE_PX = 0.1, 3.0
"""Around the ball and its shadow, of the radius and in pixels, blur and light that the ball throws are left out."""
PENUMBRA = math.tan(math.radians(2.5))
"""Half the width of the edge of a shadow, of its length: a lamp of 5 degrees, or a direction that is off by 2.5."""
SECTORS = 8
LEAST_PIXELS, LEAST_SECTORS = 200, 2
"""Board that must be left under every light: for its level, and to see how it differs from place to place."""
LEAST_LEVEL = 10.0
"""Grey levels of 255 of a board from which on it is lit, and no dark ground with stray light."""
SAMPLE = 40_000
ROUNDS = 30
MATT = 0.03
"""Real boards reflect lights of different elevation by so much otherwise than Lambert's law says."""


class BoardStrengths(NamedTuple):
    """Irradiance of each light on a plane that faces it, in grey levels of the board; None with a reason."""

    levels: Array | None
    u: Array | None
    """Relative standard uncertainties: how the lights differ from place to place on the board."""
    reason: str = ""


def board_strengths(capture: Capture, levels: Levels, circles_px: Array, solution: LightSolution) -> BoardStrengths:
    """Strengths by the board of one capture, with the outlines (B, 3) of its balls, x, y, radius from the centre.

    A pixel counts under each light whose shadows do not reach it. What all lights see alike of it (texture,
    vignetting) is one unknown a pixel, so that lights may be seen by different pixels.
    """
    height, width = levels.images.shape[1:]
    # A mask that is a disc marks the ball; any other marks what counts.
    board = capture.mask.copy() if disc_of_mask(capture) is None else np.ones((height, width), np.bool_)
    x, y = np.arange(width) + 0.5 - width / 2.0, height / 2.0 - 0.5 - np.arange(height)
    for cx, cy, radius in circles_px:
        board &= np.hypot(x[None, :] - cx, y[:, None] - cy) > (1.0 + BESIDE) * radius + BESIDE_PX
    rows, cols = np.nonzero(board)
    few = f"the board beside the ball and its shadows is less than {LEAST_PIXELS} pixels under a light"
    if len(rows) < LEAST_PIXELS:
        return BoardStrengths(None, None, few)
    step = math.ceil(len(rows) / SAMPLE)
    rows, cols = rows[::step], cols[::step]
    seen = levels.images[:, rows, cols]
    places = np.column_stack([x[cols], y[rows], np.zeros(len(rows))])
    ways, falls = _ways(places, solution)
    lit = np.array([_lit(places, way, circles_px) for way in ways])
    lit &= lit.sum(axis=0) > 1  # one light alone is compared with none
    # A pixel that is clipped under one light says nothing of it, and would favour the others.
    clipped = (lit & (seen >= levels.clip)).any(axis=0)
    counts = (lit & ~clipped).sum(axis=1) * step
    if counts.min() < LEAST_PIXELS:
        share = float(clipped.mean())
        return BoardStrengths(None, None, f"{100 * share:.0f} % of the board is clipped" if share > 0.5 else few)  # noqa: PLR2004
    lit &= ~clipped
    if min(float(np.median(image[use])) for image, use in zip(seen, lit, strict=True)) < LEAST_LEVEL:
        return BoardStrengths(None, None, "the board is dark")
    logs = np.log(np.maximum(seen, 0.5 * levels.noise + 1e-3) / falls)
    strengths = np.array([np.median(one[use]) for one, use in zip(logs, lit, strict=True)])
    for _ in range(ROUNDS):
        pattern = np.where(lit, logs - strengths[:, None], 0.0).sum(axis=0) / np.maximum(lit.sum(axis=0), 1)
        off = logs - pattern - strengths[:, None]
        strengths = strengths + np.array([np.median(one[use]) for one, use in zip(off, lit, strict=True)])
    # A factor may be that of all lights or that of all pixels: that of the usual pixel is 1.
    strengths = strengths + float(np.median(pattern[lit.any(axis=0)]))
    around = np.arctan2(places[:, 1] - circles_px[0, 1], places[:, 0] - circles_px[0, 0])
    u = _spread(off, lit, ((around / (2.0 * math.pi) + 0.5) * SECTORS).astype(int) % SECTORS)
    if u is None:
        return BoardStrengths(None, None, few)
    # What tilts all lights alike leaves their ratios.
    tilt = np.radians(solution.u_at_ball_deg) * np.hypot(*solution.directions[:, :2].T) / solution.directions[:, 2]
    return BoardStrengths(np.exp(strengths), np.sqrt(u**2 + tilt**2 + MATT**2))


def _ways(places: Array, solution: LightSolution) -> tuple[list[Array], Array]:
    """Unit vectors from the board to each light, and what Lambert's and the inverse square law leave of it there."""
    ways, falls = [], []
    for direction, nearness in zip(solution.directions, solution.nearness, strict=True):
        way = direction - nearness * places
        size = np.linalg.norm(way, axis=1)
        way = way / size[:, None]
        ways.append(way)
        falls.append(np.maximum(way[:, 2], 0.05) / size**2)
    return ways, np.array(falls)


def _lit(places: Array, way: Array, circles_px: Array) -> NDArray[np.bool_]:
    """Where no ball that rests on the board, nor the edge of its shadow, is between board and light."""
    lit = np.ones(len(places), np.bool_)
    for cx, cy, radius in circles_px:
        off = np.array([cx, cy, radius]) - places
        toward = np.sum(off * way, axis=1)
        miss = np.linalg.norm(off - toward[:, None] * way, axis=1)
        reach = (1.0 + BESIDE) * radius + BESIDE_PX + PENUMBRA * np.maximum(toward, 0.0)
        lit &= (toward < -radius) | (miss > reach)
    return lit


def _spread(off: Array, lit: NDArray[np.bool_], sector: NDArray[np.intp]) -> Array | None:
    """How much each light differs from the others from one side of the ball to another; None seen from one side."""
    found = []
    for one, use in zip(off, lit, strict=True):
        parts = [use & (sector == index) for index in range(SECTORS)]
        middles = [float(np.median(one[part])) for part in parts if part.sum() >= LEAST_PIXELS / (2 * SECTORS)]
        if len(middles) < LEAST_SECTORS:
            return None
        found.append(float(np.std(middles, ddof=1)))
    return np.array(found)
