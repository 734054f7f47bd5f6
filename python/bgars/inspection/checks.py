"""Whether images, lights and shadows belong together: repeated, swapped and shifted images, lights in wrong places."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bgars.errors import CalibrationError
from bgars.files.light_names import light_name, numbered
from bgars.inspection.board import Board
from bgars.inspection.image_shifts import MIN_STRETCHES
from bgars.inspection.in_view import fitting_stretches
from bgars.inspection.shadow_model import Balls, Lights
from bgars.inspection.start import edge_steps

if TYPE_CHECKING:
    from bgars.inspection.problem import Problem
    from bgars.inspection.shadow_edges import Edges

__all__ = [
    "Complaint",
    "explain_dark_steps",
    "refuse_misfits",
]

Array = NDArray[np.float64]

GOOD_STEP = 0.5
"""Mean step of brightness over predicted edges, relative to the board, that needs no explanation."""
MUCH_BETTER = 0.2  # of the same: what another explanation must gain
FITTING_SHARE = 0.7
"""A light is fine when this share of its stretches of edge fit, where it stands at most `FAR_DEG` from the rig."""
FAR_DEG = 5.0  # from the rig: a light that is wrong
MIN_WITNESSES = 3
"""Balls that must agree before an image is refused."""
MOST_BALLS = 12
TURNS_DEG = np.arange(-180.0, 180.0, 7.5)
RAISES_DEG = np.arange(-15.0, 16.0, 5.0)
SHIFTS = np.arange(-0.9, 0.91, 0.15)
"""Shifts that are tried, in radii."""
SAME_LIGHT_DEG = 12.0  # directions closer than this are the same light
NEAR_DEG = 7.5
"""Lights this far off are still found by the fit, and measured there."""
OUTLINE_BESIDE = 0.1  # of the radius: how far in and out of an outline contrast is taken
SHARPER = 1.15  # ratio of contrasts of outlines that confirms a shift
LOWEST_DEG, HIGHEST_DEG = 5.0, 88.0  # elevations within which lights are looked for


class Complaint(NamedTuple):
    """What is wrong with the image of a light, or seems so; `serious` when another explanation is much better."""

    light: int
    text: str
    serious: bool


def explain_dark_steps(
    problem: Problem, table: Array, steps: Array, in_view: NDArray[np.bool_]
) -> tuple[Complaint, ...]:
    """Explain images whose predicted shadow edges are no edges.

    Parameters
    ----------
    problem : Problem
    table : (N, 5) float64
        Balls with first heights.
    steps : (N, L) float64
        Step of brightness at each ball's predicted edge under each light.
    in_view : (L,) bool
        Lights whose shadows lie in the image: of others a first look can say nothing (`in_view.py`).

    Returns
    -------
    tuple of Complaint
        Not the last word: where shadows merge (low lights, dense balls) a first look sees little. See `refuse_misfits`.
    """
    known = np.isfinite(steps)
    mean = np.where(known, steps, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
    doubtful = np.flatnonzero((mean < GOOD_STEP) & in_view)
    if not doubtful.size or not known.any():
        return ()
    chosen = np.sort(np.argsort(np.hypot(table[:, 0], table[:, 1]))[:MOST_BALLS])
    complaints: list[Complaint] = []
    answers: dict[int, Array] = {}
    files = problem.radiance.capture.files
    for light in (int(each) for each in doubtful):
        turned, direction = _best_direction(problem, table, chosen, light)
        moved, dx, dy = _best_shift(problem, table, chosen, light)
        needed = max(GOOD_STEP, mean[light] + MUCH_BETTER)
        if moved >= needed and moved > turned - MUCH_BETTER and _balls_moved(problem, chosen, light, dx, dy):
            name = light_name(light, files, what="image")
            text = f"{name} is shifted by about ({dx:+.0f}, {dy:+.0f}) pixels (x right, y up)"
            complaints.append(Complaint(light, text, serious=True))
        elif turned >= needed:
            answers[light] = direction
        else:
            name = light_name(light, files, what="image")
            text = f"{name}: its shadows are not where light {light} of the rig casts them"
            complaints.append(Complaint(light, text, serious=False))
    return tuple(complaints + _name_lights(problem, answers))


def refuse_misfits(
    complaints: tuple[Complaint, ...], edges: Edges, weight: Array | None, moved_deg: Array
) -> tuple[str, ...]:
    """Confront complaints with the fit: a light whose shadows fit after all is none.

    Parameters
    ----------
    complaints : tuple of Complaint
    edges : Edges
        Of the balls in the fit.
    weight : (N, L, S) float64 or None
        Weights of the stretches of edge in the fit; None without a fit.
    moved_deg : (L,) float64
        How far the fit moved each light.

    Returns
    -------
    tuple of str
        Complaints that are left and not serious.

    Raises
    ------
    CalibrationError
        Complaints that are left and serious.
    """
    if weight is not None:
        looked_at, fitting = fitting_stretches(edges, weight)
        fine = (fitting >= FITTING_SHARE * looked_at) & (looked_at >= MIN_STRETCHES) & (moved_deg < FAR_DEG)
        complaints = tuple(complaint for complaint in complaints if not fine[complaint.light])
    serious = [complaint.text for complaint in complaints if complaint.serious]
    few = weight is None or len(weight) < MIN_WITNESSES
    if serious and not few:
        raise CalibrationError("images and lights do not belong together: " + "; ".join(serious))
    return tuple(complaint.text for complaint in complaints)


def _balls_moved(problem: Problem, chosen: NDArray[np.intp], light: int, dx: float, dy: float) -> bool:
    """Whether the outlines of the balls in one image are sharper where a shift puts them."""
    x, y, _, radius, _ = problem.table[chosen].T[:, :, None]
    azimuth = np.arctan2(problem.vectors[light, 1], problem.vectors[light, 0])
    angle = azimuth + np.radians(np.linspace(-60.0, 60.0, 15))
    radiance, contrast = problem.radiance, []
    for right, up in ((0.0, 0.0), (dx, dy)):
        sides = []
        for reach in (radius * (1.0 - OUTLINE_BESIDE), radius * (1.0 + OUTLINE_BESIDE)):
            row = np.rint(radiance.row(y + up + reach * np.sin(angle))).astype(np.intp)
            col = np.rint(radiance.col(x + right + reach * np.cos(angle))).astype(np.intp)
            row, col = np.clip(row, 0, radiance.height - 1), np.clip(col, 0, radiance.width - 1)
            images = np.full(row.shape, light)
            values = radiance.under(images, row * radiance.width + col).astype(np.float64)
            sides.append(np.where(np.isfinite(values), values, problem.radiance.capture.full_scale))
        contrast.append(float(np.median(np.abs(sides[0] - sides[1]))))
    return contrast[1] > SHARPER * contrast[0]


def _name_lights(problem: Problem, answers: dict[int, Array]) -> list[Complaint]:
    """Say what directions mean: swapped images, another light, a wrong rig."""
    unit = problem.vectors / np.linalg.norm(problem.vectors, axis=1, keepdims=True)
    turns = [_turn_deg(unit[light], direction) for light, direction in answers.items()]
    if len(answers) == len(unit) and np.ptp(turns) < SAME_LIGHT_DEG and abs(np.mean(turns)) > SAME_LIGHT_DEG:
        text = f"all lights are turned by {np.mean(turns):+.0f} degrees (counter-clockwise) against the rig"
        return [Complaint(light, text, serious=True) for light in (0,)]
    like: dict[int, int] = {}
    for light, direction in answers.items():
        angles = np.degrees(np.arccos(np.clip(unit @ direction, -1.0, 1.0)))
        nearest = int(np.argmin(angles))
        if nearest != light and angles[nearest] < SAME_LIGHT_DEG:
            like[light] = nearest
    complaints = []
    files = problem.radiance.capture.files
    for light, direction in answers.items():
        other = like.get(light)
        if other is None:
            azimuth = np.degrees(np.arctan2(direction[1], direction[0])) % 360.0
            elevation = np.degrees(np.arcsin(direction[2]))
            off = np.degrees(np.arccos(np.clip(unit[light] @ direction, -1.0, 1.0)))
            text = (
                f"{light_name(light, files)} stands about {off:.0f} degrees off its direction in the rig: its shadows "
                f"point to azimuth {azimuth:.0f}, elevation {elevation:.0f} degrees"
            )
            complaints.append(Complaint(light, text, serious=bool(off > NEAR_DEG)))
        elif like.get(other) != light:
            text = f"{light_name(light, files, what='image')} has the shadows of light {numbered(other, files)}"
            complaints.append(Complaint(light, text, serious=True))
        elif light < other:
            text = f"images {numbered(light, files)} and {numbered(other, files)} are swapped"
            complaints.append(Complaint(light, text, serious=True))
    return complaints


def _turn_deg(first: Array, second: Array) -> float:
    """Turn of the azimuth, counter-clockwise, in (-180, 180] degrees."""
    turn = np.degrees(np.arctan2(second[1], second[0]) - np.arctan2(first[1], first[0]))
    return float((turn + 180.0) % 360.0 - 180.0)


def _steps(problem: Problem, balls: Array, chosen: NDArray[np.intp], vectors: Array, light: int) -> Array:
    """(C,) mean steps of one image under C candidates: balls (C, n, 5) and lights (C, 3)."""
    table = Balls(*np.moveaxis(balls, -1, 0))
    lights = Lights.from_table(vectors, problem.near).spread(0, 1)
    silhouettes = np.concatenate([problem.table, problem.extra])
    hidden = Balls.from_table(silhouettes)
    images = np.full((1, 1), light)
    steps = edge_steps(
        problem.radiance, table, lights, images, hidden, Board(), problem.irradiance[chosen].mean(axis=0)
    )
    known = np.isfinite(steps)
    mean: Array = np.where(known, steps, 0.0).sum(axis=1) / np.maximum(known.sum(axis=1), 2.0)
    return mean


def _best_direction(problem: Problem, table: Array, chosen: NDArray[np.intp], light: int) -> tuple[float, Array]:
    """Best mean step over many directions, and that direction."""
    vector = problem.vectors[light]
    length = float(np.linalg.norm(vector))
    azimuth, elevation = np.arctan2(vector[1], vector[0]), np.arcsin(vector[2] / length)
    turns, raises = (part.ravel() for part in np.meshgrid(np.radians(TURNS_DEG), np.radians(RAISES_DEG)))
    height = np.clip(elevation + raises, np.radians(LOWEST_DEG), np.radians(HIGHEST_DEG))
    tried = length * np.column_stack(
        [np.cos(height) * np.cos(azimuth + turns), np.cos(height) * np.sin(azimuth + turns), np.sin(height)]
    )
    steps = _steps(problem, np.repeat(table[chosen][None], len(tried), axis=0), chosen, tried, light)
    away = np.degrees(np.arccos(np.clip(tried @ vector / length**2, -1.0, 1.0)))
    best = int(np.argmax(steps - 1e-4 * away))
    return float(steps[best]), tried[best] / length


def _best_shift(problem: Problem, table: Array, chosen: NDArray[np.intp], light: int) -> tuple[float, float, float]:
    """Best mean step over shifts of the image, and that shift in pixels."""
    radius = float(np.median(table[:, 3]))
    dx, dy = (part.ravel() * radius for part in np.meshgrid(SHIFTS, SHIFTS))
    balls = np.repeat(table[chosen][None], len(dx), axis=0)
    balls[:, :, 0] += dx[:, None]
    balls[:, :, 1] += dy[:, None]
    steps = _steps(problem, balls, chosen, np.repeat(problem.vectors[light][None], len(dx), axis=0), light)
    # Of equal steps the smallest shift: the flat top around the right one is wide.
    best = int(np.argmax(steps - 1e-3 * np.hypot(dx, dy) / radius))
    return float(steps[best]), float(dx[best]), float(dy[best])
