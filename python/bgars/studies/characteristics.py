"""What a study looks at: readings of each ball, and of the part."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from bgars.records.part_recipe import PartRecipe
    from bgars.records.part_result import PartResult

__all__ = ["CHARACTERISTICS", "TITLES", "Characteristic", "part_readings"]


@dataclass(frozen=True)
class Characteristic:
    """A quantity of a result.

    Attributes
    ----------
    name : str
        Its field, with its unit.
    title : str
        In words.
    of : {"ball", "part"}
        Read for each ball, or once a part.
    limit : str
        Field of :class:`bgars.Limits` that judges it.
    """

    name: str
    title: str
    of: Literal["ball", "part"]
    limit: str

    @property
    def unit(self) -> str:
        """µm, or nothing for a ratio."""
        return "µm" if self.name.endswith("_um") else ""

    def limits(self, recipe: PartRecipe | None) -> tuple[float | None, float | None]:
        """Lowest and highest allowed value; None = no limit."""
        return (None, None) if recipe is None else recipe.limits.range_of(self.limit) or (None, None)

    def tolerance(self, recipe: PartRecipe | None) -> float | None:
        """Width of the limits; for a distance that has only a highest value, that value: its natural lowest is 0.

        Examples
        --------
        >>> from bgars import BallLayout, Limits, PartRecipe
        >>> recipe = PartRecipe("demo", BallLayout(2, 2, 1000.0), limits=Limits(height_um=(460.0, 540.0)))
        >>> [each.tolerance(recipe) for each in CHARACTERISTICS if each.name in {"top_um", "diameter_um"}]
        [None, 80.0]
        """
        lowest, highest = self.limits(recipe)
        return None if highest is None else highest - (lowest or 0.0)


CHARACTERISTICS = (
    Characteristic("diameter_um", "diameter", "ball", "diameter_um"),
    Characteristic("top_um", "height of the top", "ball", "height_um"),
    Characteristic("true_position_um", "true position", "ball", "true_position_um"),
    Characteristic("aspect_ratio", "aspect ratio", "ball", "aspect_ratio"),
    Characteristic("seating_coplanarity_um", "seating coplanarity", "part", "seating_coplanarity_um"),
    Characteristic("regression_coplanarity_um", "regression coplanarity", "part", "regression_coplanarity_um"),
    Characteristic("pitch_um", "pitch", "part", "pitch_um"),
    Characteristic("warpage_um", "warpage", "part", "warpage_um"),
)
TITLES = {each.name: each.title for each in CHARACTERISTICS}


def part_readings(result: PartResult, characteristic: Characteristic) -> dict[str, float]:
    """Return the readings of a result by ball name ("" for the part); NaN = not measured.

    Balls where none should be are left out.

    Examples
    --------
    >>> import bgars
    >>> scene = bgars.Scene.plane(size_um=(2000.0, 2000.0))
    >>> capture, _ = bgars.simulate(scene, bgars.LightRig.ring(4), bgars.Material(), bgars.Camera(pixel_pitch_um=50.0))
    >>> part_readings(bgars.inspect(capture), CHARACTERISTICS[-1])
    {'': nan}
    """
    if characteristic.of == "part":
        return {"": getattr(result, characteristic.name)}
    return {ball.name: getattr(ball, characteristic.name) for ball in result.balls if ball.kind != "extra"}
