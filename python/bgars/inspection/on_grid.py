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

__all__ = ["finite_centres", "is_seen", "lay_grid", "like_turn_deg", "true_positions"]

SEEN_SHARE = 0.5
"""Of the places of a part: with fewer balls than that the finder, or the set-up, has failed."""
NEARLY_AS_FAR_DEG = 10.0
"""A turn that is as likely as one larger by this: parts lie in their trays, or before a camera, to a few degrees."""
SAME_PLACE = 0.05
"""Of the usual distance of places: a layout whose places are off by less after a turn looks the same."""
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


def like_turn_deg(recipe: PartRecipe, turn_deg: float) -> float | None:
    """Another turn (degrees) by which the balls are on their places, nearly as small as the one that names them.

    Examples
    --------
    >>> from bgars import BallLayout, PartRecipe
    >>> recipe = PartRecipe("demo", BallLayout(rows=4, cols=4, pitch_um=800.0))
    >>> like_turn_deg(recipe, 44.0), like_turn_deg(recipe, 30.0)
    (-46.0, None)
    """
    places = np.array([place.x_um + 1j * place.y_um for place in recipe.image_layout.places()])
    places -= (places.real.min() + places.real.max() + 1j * (places.imag.min() + places.imag.max())) / 2.0
    for quarters in (1, 2, 3):
        other_deg = (turn_deg + 90.0 * quarters + 180.0) % 360.0 - 180.0
        if abs(other_deg) < abs(turn_deg) + NEARLY_AS_FAR_DEG and _looks_the_same(places, 1j**quarters):
            return other_deg
    return None


def _looks_the_same(places: NDArray[np.complex128], turn: complex) -> bool:
    """Whether a turn puts places, which are around 0, on places."""
    reach = SAME_PLACE * max(float(np.ptp(places.real)), float(np.ptp(places.imag))) / math.sqrt(len(places))
    return all(float(np.abs(places - place * turn).min()) <= reach for place in places)


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
