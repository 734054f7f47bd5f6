"""Which ball belongs to which place: present, missing, extra, bridged."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from bgars.errors import InputError
from bgars.records.ball_names import ball_name
from bgars.records.part_recipe import layout_places

if TYPE_CHECKING:
    from bgars.records.found_balls import BallKind, FoundBalls
    from bgars.records.measured_balls import BallMeasurement, MeasuredBall
    from bgars.records.part_recipe import PartRecipe

__all__ = ["Slot", "match_balls"]


@dataclass(frozen=True)
class Slot:
    """A place and the ball that is there, or a ball without a place.

    Attributes
    ----------
    name : str
        In the image.
    row, col : int or None
        From 0 at the top left of the image.
    nominal : (float, float) or None
        Its place in the ideal grid: um with a recipe, pitches without; None off the layout.
    found : bool
        True when a ball is there.
    unclear : bool
        True when none was found, and the place is not seen to be empty either.
    kind : {"ball", "extra", "bridged"}
    measured : MeasuredBall or None
        None also for a ball that was found, but not measured.
    """

    name: str
    row: int | None
    col: int | None
    nominal: tuple[float, float] | None
    found: bool
    kind: BallKind
    measured: MeasuredBall | None
    unclear: bool = False


def match_balls(found: FoundBalls, measurement: BallMeasurement, recipe: PartRecipe | None) -> tuple[Slot, ...]:
    """Match balls with places, in reading order; balls without a place come last.

    The recipe decides, not the finder: a place of its layout without a ball of that name is missing, and a ball whose
    name it does not have is extra. Without a recipe the places are those of the lattice that was found.

    Raises
    ------
    InputError
        A name twice, or a measurement of a ball that was not found: both records must come from the same part.
    """
    balls = {ball.name: ball for ball in found.balls}
    measured = {ball.name: ball for ball in measurement.balls}
    for records, rows, what in ((balls, found.balls, "found"), (measured, measurement.balls, "measurement")):
        if len(records) < len(rows):
            names = [ball.name for ball in rows]
            twice = next(name for index, name in enumerate(names) if name in names[:index])
            msg = f"{what}.balls: must have different names, got {twice!r} twice"
            raise InputError(msg)
    unknown = sorted(set(measured) - set(balls))
    if unknown:
        msg = f"measurement.balls: must be balls of found, got {unknown[0]!r}"
        raise InputError(msg)
    joined = {name for pair in found.bridges for name in pair}
    slots = []
    for name, row, col, nominal in _places(found, recipe):
        ball = balls.get(name)
        if ball is None or ball.kind == "extra":
            slots.append(Slot(name, row, col, nominal, False, "ball", None, unclear=name in found.unclear))
            continue
        reading = measured.get(name)
        is_joined = name in joined or (reading is not None and reading.kind == "bridged")
        kind: BallKind = "bridged" if is_joined else ball.kind
        slots.append(Slot(name, row, col, nominal, True, kind, reading))
    taken = {slot.name for slot in slots if slot.found}
    for ball in found.balls:
        if ball.name not in taken:
            slots.append(Slot(ball.name, ball.row, ball.col, None, True, "extra", measured.get(ball.name)))
    return tuple(slots)


Place = tuple[str, int | None, int | None, tuple[float, float]]


def _places(found: FoundBalls, recipe: PartRecipe | None) -> list[Place]:
    if recipe is not None:
        return [(at.name, at.row, at.col, (at.x_um, at.y_um)) for at in layout_places(recipe.image_layout)]
    on_lattice = [(ball.name, ball.row, ball.col) for ball in found.balls if ball.kind != "extra"]
    places = [
        (name or ball_name(row, col), row, col)
        for name, row, col in [*on_lattice, *found.missing]
        if row is not None and col is not None
    ]
    places.sort(key=lambda place: place[1:])
    return [(name, row, col, (float(col), float(-row))) for name, row, col in places]
