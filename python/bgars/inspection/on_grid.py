"""Balls against their grid: where it lies, how far each ball is from its place, and whether enough are there."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from bgars.inspection.judge_ball import Position, true_position
from bgars.inspection.position import GridFit, fit_grid

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bgars.inspection.places import Slot
    from bgars.records.measured_balls import BallMeasurement
    from bgars.records.part_recipe import PartRecipe

    Array = NDArray[np.float64]

__all__ = ["finite_centres", "is_seen", "lay_grid", "true_positions"]

SEEN_SHARE = 0.5
"""Of the places of a part: with fewer balls than that the finder, or the set-up, has failed."""
MIN_GRID = 3
"""Balls that fix a grid's shift and turn and leave something."""


def finite_centres(slots: tuple[Slot, ...]) -> Array:
    """(n, 2) centres that were measured, um."""
    centres_um = [(slot.measured.x_um, slot.measured.y_um) for slot in slots if slot.measured is not None]
    array_um = np.array(centres_um, dtype=np.float64).reshape(-1, 2)
    return array_um[np.isfinite(array_um).all(axis=1)]


def lay_grid(slots: tuple[Slot, ...], recipe: PartRecipe | None) -> tuple[GridFit | None, Array]:
    """The grid through all whole balls, and (n, 2) places of all slots in the image (NaN where there is none)."""
    whole = [
        (slot.nominal, slot.measured)
        for slot in slots
        if slot.nominal is not None and slot.measured is not None and slot.kind == "ball"
    ]
    centres_um = np.array([(ball.x_um, ball.y_um) for _, ball in whole], dtype=np.float64).reshape(-1, 2)
    known = np.isfinite(centres_um).all(axis=1)
    nominal = np.array([place for place, _ in whole], dtype=np.float64).reshape(-1, 2)
    u_um = np.array([(ball.u_x_um, ball.u_y_um) for _, ball in whole], dtype=np.float64).reshape(-1, 2)
    fit = fit_grid(nominal[known], centres_um[known], u_um[known], free_scale=recipe is None)
    places_um = np.full((len(slots), 2), math.nan)
    if fit is not None:
        for index, slot in enumerate(slots):
            if slot.nominal is not None:
                places_um[index] = fit.place(np.array(slot.nominal))
    return fit, places_um


def is_seen(slots: tuple[Slot, ...]) -> bool:
    """Whether most places show a ball: where they do not, the set-up is to be looked at, not the part."""
    wanted = [slot for slot in slots if slot.kind != "extra"]
    return bool(wanted) and sum(slot.found for slot in wanted) > SEEN_SHARE * len(wanted)


def true_positions(slots: tuple[Slot, ...], nominal_um: Array, measurement: BallMeasurement) -> list[Position]:
    """True positions; what shifts or turns all balls together moves the grid with them, and is in none."""
    places = {ball.name: place for place, ball in enumerate(measurement.balls)}
    positions = []
    shared = {name: measurement.shared_um.get(name) for name in ("x_um", "y_um")}
    left = {name: None if part is None else _off_grid(part, measurement, name) for name, part in shared.items()}
    for slot, place_um in zip(slots, nominal_um, strict=True):
        ball = slot.measured
        if ball is None or slot.nominal is None:
            positions.append(Position(math.nan, math.nan))
            continue
        u_um = [ball.u_x_um, ball.u_y_um]
        for axis, name in enumerate(("x_um", "y_um")):
            part, rest = shared[name], left[name]
            if part is not None and rest is not None:
                row = places[ball.name]
                alone = max(u_um[axis] ** 2 - float(np.square(part[row]).sum()), 0.0)
                u_um[axis] = math.sqrt(alone + float(np.square(rest[row]).sum()))
        positions.append(true_position(np.array([ball.x_um, ball.y_um]) - place_um, np.array(u_um)))
    return positions


def _off_grid(shared_um: Array, measurement: BallMeasurement, name: str) -> Array:
    """(N, M) errors that balls share, less the shift along this axis and the turn that a grid follows."""
    across = np.array([ball.y_um if name == "x_um" else ball.x_um for ball in measurement.balls], dtype=np.float64)
    seen = np.square(shared_um).sum(axis=1) > 0
    if seen.sum() < MIN_GRID:
        return shared_um
    design = np.column_stack([np.ones(len(across)), across / max(float(np.abs(across[seen]).max()), 1e-9)])
    fitted = np.linalg.lstsq(design[seen], shared_um[seen], rcond=None)[0]
    off: Array = np.where(seen[:, None], shared_um - design @ fitted, 0.0)
    return off
