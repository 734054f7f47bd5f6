"""Readings multiplied by what the recipe's grid says of pixel pitch and lens, and their uncertainty with it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bgars.inspection.lens_scale import LensScale, fit_lens_scale

if TYPE_CHECKING:
    from bgars.inspection.places import Slot
    from bgars.records.measured_balls import BallMeasurement, MeasuredBall
    from bgars.records.part_recipe import PartRecipe

__all__ = ["SCALE", "lens_scale", "to_scale"]

Array = NDArray[np.float64]
SCALE = "pixel pitch and lens"
LENGTHS = ("diameter_um", "centre_z_um", "top_um")


def lens_scale(slots: tuple[Slot, ...], measurement: BallMeasurement, recipe: PartRecipe | None) -> LensScale | None:
    """Scale and distortion of the image; None where the size of the image is unknown."""
    if not np.isfinite(measurement.corner_um):
        return None
    whole = [
        (slot.nominal, slot.measured)
        for slot in slots
        if recipe is not None and slot.nominal is not None and slot.measured is not None and slot.kind == "ball"
    ]
    nominal = np.array([place for place, _ in whole], dtype=np.float64).reshape(-1, 2)
    centres = np.array([(ball.x_um, ball.y_um) for _, ball in whole], dtype=np.float64).reshape(-1, 2)
    u_centres = np.array([(ball.u_x_um, ball.u_y_um) for _, ball in whole], dtype=np.float64).reshape(-1, 2)
    known = np.isfinite(np.column_stack([centres, u_centres])).all(axis=1)
    u_recipe = None
    if recipe is not None and recipe.pitch_u_um is not None and recipe.layout.pitch_um is not None:
        u_recipe = recipe.pitch_u_um / recipe.layout.pitch_um
    return fit_lens_scale(
        nominal[known], centres[known], u_centres[known], measurement.corner_um, measurement.u_pixel_pitch, u_recipe
    )


def to_scale(measurement: BallMeasurement, lens: LensScale) -> BallMeasurement:
    """All lengths as they are, not as the image has them."""
    centres = np.array([(ball.x_um, ball.y_um) for ball in measurement.balls], dtype=np.float64).reshape(-1, 2)
    x_um, y_um = centres[:, 0], centres[:, 1]
    tops = np.array([ball.top_um for ball in measurement.balls], dtype=np.float64)
    by_place, by_length = lens.u_share(x_um, y_um), lens.u_share(x_um, y_um, turns=2.0)
    shared = {}
    for name, part in measurement.shared_um.items():
        value = {"x_um": x_um, "y_um": y_um, "top_um": tops}[name]
        share = by_length if name == "top_um" else by_place
        shared[name] = np.column_stack([part, np.nan_to_num(value)[:, None] * share])
    coefficients = measurement.board_coefficients_um.copy()
    coefficients[3:] *= 1.0 + lens.scale
    return replace(
        measurement,
        balls=tuple(_ball_to_scale(ball, lens) for ball in measurement.balls),
        board_coefficients_um=coefficients,
        shared_um=shared,
        causes=(*measurement.causes, SCALE, SCALE) if measurement.causes else (),
    )


def _ball_to_scale(ball: MeasuredBall, lens: LensScale) -> MeasuredBall:
    x_um, y_um = np.array(ball.x_um), np.array(ball.y_um)
    place, length = float(lens.factor(x_um, y_um)), float(lens.length_factor(x_um, y_um))
    by_place = float(np.linalg.norm(lens.u_share(x_um, y_um)))
    by_length = float(np.linalg.norm(lens.u_share(x_um, y_um, turns=2.0)))
    values: dict[str, Any] = {}
    budget = {name: dict(causes) for name, causes in ball.budget.items()}
    for name in ("x_um", "y_um", *LENGTHS):
        factor, share = (length, by_length) if name in LENGTHS else (place, by_place)
        value, by_scale = getattr(ball, name) * factor, abs(getattr(ball, name)) * share
        values[name] = value
        values[f"u_{name}"] = float(np.hypot(getattr(ball, f"u_{name}") * factor, by_scale))
        if name in budget:
            causes = {cause: part * factor for cause, part in budget[name].items()} | {SCALE: by_scale}
            budget[name] = dict(sorted(causes.items(), key=lambda pair: -pair[1]))
    return replace(
        ball,
        **values,
        flat_top_depth_um=ball.flat_top_depth_um * length,
        u_flat_top_depth_um=ball.u_flat_top_depth_um * length,
        budget=budget,
    )
