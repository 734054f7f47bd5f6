"""What a part should be: its balls and its limits."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from bgars.errors import InputError
from bgars.records.ball_layout import BallLayout
from bgars.records.ball_names import ball_name, mirrored_name
from bgars.records.keys import Key
from bgars.records.renamed import renamed
from bgars.records.strip_layout import StripLayout

__all__ = ["BALL_LIMITS", "PART_LIMITS", "BallPlace", "Limits", "PartRecipe", "View", "layout_places"]

View = Literal["bottom", "top"]
Range = tuple[float, float]
BALL_LIMITS = ("true_position_um", "diameter_um", "height_um", "aspect_ratio", "flat_top_depth_um")
PART_LIMITS = ("pitch_um", "seating_coplanarity_um", "regression_coplanarity_um", "warpage_um")
ASPECT_RATIOS = (0.2, 2.0)
"""Nominal aspect ratio of what can be called a ball: from a low cap to an egg on end."""
DEFAULT_U_ASPECT_RATIO = 0.01
"""Where the aspect ratio alone is given: balls of one lot share their shape; package balls are round within 1 %."""


@renamed(q="aspect_ratio", flat_um="flat_top_depth_um")
@dataclass(frozen=True)
class Limits:
    """Limits; a pair is lowest and highest, a single number the highest, what has none is not judged.

    Attributes
    ----------
    true_position_um : float or None
        Distance of a ball from its place in the best-fitting grid: half of a diametral position tolerance.
    diameter_um, height_um : (float, float) or None
        Of each ball; height = top above the local board.
    aspect_ratio : (float, float) or None
        Vertical over horizontal radius.
    flat_top_depth_um : float or None
        Missing height of a flat top.
    pitch_um : (float, float) or None
        Of the best-fitting grid.
    seating_coplanarity_um, regression_coplanarity_um : float or None
        Largest distance of an apex from either plane.
    warpage_um : float or None
        Highest less lowest point of the board under the balls, against its least-squares plane.
    """

    true_position_um: Annotated[float | None, Key("of each ball, in um")] = None
    diameter_um: Annotated[Range | None, Key("of each ball, in um")] = None
    height_um: Annotated[Range | None, Key("of each ball's top_um, in um")] = None
    aspect_ratio: Annotated[Range | None, Key("of each ball", was="q")] = None
    flat_top_depth_um: Annotated[float | None, Key("of each ball, in um", was="flat_um")] = None
    pitch_um: Annotated[Range | None, Key("of the best-fitting grid, in um")] = None
    seating_coplanarity_um: Annotated[float | None, Key("of the part, in um")] = None
    regression_coplanarity_um: Annotated[float | None, Key("of the part, in um")] = None
    warpage_um: Annotated[float | None, Key("of the part, in um")] = None

    def __bool__(self) -> bool:
        """True when there is any limit."""
        return any(getattr(self, entry.name) is not None for entry in fields(self))

    def range_of(self, name: str) -> tuple[float | None, float | None] | None:
        """Lowest and highest allowed value of a quantity; None when it is not judged.

        Examples
        --------
        >>> Limits(flat_top_depth_um=5.0).range_of("flat_top_depth_um")
        (None, 5.0)
        """
        limit = getattr(self, name)
        return limit if limit is None or isinstance(limit, tuple) else (None, limit)


@dataclass(frozen=True)
class BallPlace:
    """A place that should hold a ball, as the image shows it.

    Attributes
    ----------
    name : str
        Name in the image: rows from the top, columns from the left.
    row, col : int or None
        From 0; None in a list of places.
    x_um, y_um : float
        Against the middle of the lattice, or the origin of the list: x right, y up.
    """

    name: str
    row: int | None
    col: int | None
    x_um: float
    y_um: float


def layout_places(layout: BallLayout) -> tuple[BallPlace, ...]:
    """Return the places of a layout that should hold a ball, in reading order.

    Examples
    --------
    >>> places = layout_places(BallLayout(rows=2, cols=2, pitch_um=1000.0, depopulated=("A2",)))
    >>> [(place.name, place.x_um, place.y_um) for place in places]
    [('A1', -500.0, 500.0), ('B1', -500.0, -500.0), ('B2', 500.0, -500.0)]
    """
    if layout.positions:
        return tuple(BallPlace(name, None, None, x_um, y_um) for name, x_um, y_um in layout.positions)
    rows, cols, pitch_um = layout.rows or 0, layout.cols or 0, layout.pitch_um or 0.0
    empty = set(layout.depopulated)
    return tuple(
        BallPlace(ball_name(row, col), row, col, (col - (cols - 1) / 2) * pitch_um, ((rows - 1) / 2 - row) * pitch_um)
        for row in range(rows)
        for col in range(cols)
        if ball_name(row, col) not in empty
    )


@renamed(q="aspect_ratio", u_q="u_aspect_ratio")
@dataclass(frozen=True)
class PartRecipe:
    """A part as it should be; read one with :func:`bgars.read_part_recipe`.

    Attributes
    ----------
    name : str
        Of the part.
    layout : BallLayout
        Where its balls should be, in `view`.
    view : {"bottom", "top"}
        Side that names and positions refer to. The camera sees the balls: the bottom. ``"top"``: they come from a
        drawing of the other side, and left and right are exchanged.
    limits : Limits
        What is judged.
    diameter_um, height_um : float or None
        Of a nominal ball, for pictures and for plausibility.
    gravity_um : (float, float) or None
        Centre of gravity against the middle of the lattice (the origin of a list), in `view`; the mean of the places
        by default.
    material_file : Path or None
        Material fitted on an earlier capture.
    file : Path or None
        Where the recipe was read from.
    aspect_ratio, u_aspect_ratio : float or None
        Vertical over horizontal radius that the part's balls have in common, and its standard uncertainty: 0.01 where
        the ratio alone is given; the uncertainty alone means a ratio of 1. Both None: not stated.
    pitch_u_um : float or None
        Standard uncertainty of the lattice's pitch.
    strip : StripLayout or None
        Where the parts are, if one image shows many.

    Raises
    ------
    InputError
        An aspect ratio outside 0.2 to 2, an uncertainty that is not above 0, or one of the pitch with a list of
        positions.

    Examples
    --------
    >>> PartRecipe("coined", BallLayout(rows=2, cols=3, pitch_um=800.0), aspect_ratio=0.9).u_aspect_ratio
    0.01
    """

    name: Annotated[str, Key("name of the part")]
    layout: Annotated[BallLayout, Key("where its balls should be, in `view`")]
    view: Annotated[View, Key("side that names and positions refer to")] = "bottom"
    limits: Annotated[Limits, Key("what was judged")] = field(default_factory=Limits)
    diameter_um: Annotated[float | None, Key("nominal horizontal diameter, in um")] = None
    height_um: Annotated[float | None, Key("nominal height of the tops, in um")] = None
    gravity_um: Annotated[
        tuple[float, float] | None, Key("centre of gravity, in um; null = the mean of the places")
    ] = None
    material_file: Annotated[Path | None, Key("file of a material fitted earlier")] = None
    file: Annotated[Path | None, Key("file that the recipe was read from")] = None
    aspect_ratio: Annotated[
        float | None,
        Key("vertical over horizontal radius that all balls share; null = not stated", is_late=True, was="q"),
    ] = None
    u_aspect_ratio: Annotated[
        float | None, Key("standard uncertainty (k = 1) of aspect_ratio; null = not stated", is_late=True, was="u_q")
    ] = None
    pitch_u_um: Annotated[
        float | None, Key("standard uncertainty (k = 1) of the grid's pitch, in um; null = not stated", is_late=True)
    ] = None
    strip: Annotated[
        StripLayout | None, Key("where the parts of one image are; null = it shows one part", is_late=True)
    ] = None

    def __post_init__(self) -> None:
        """Complete the aspect ratio by its uncertainty or the other way round, and check them."""
        if self.aspect_ratio is None and self.u_aspect_ratio is not None:
            object.__setattr__(self, "aspect_ratio", 1.0)
        if self.u_aspect_ratio is None and self.aspect_ratio is not None:
            object.__setattr__(self, "u_aspect_ratio", DEFAULT_U_ASPECT_RATIO)
        lowest, highest = ASPECT_RATIOS
        if self.aspect_ratio is not None and not lowest <= self.aspect_ratio <= highest:
            msg = f"aspect_ratio: must be from {lowest:g} to {highest:g}, got {self.aspect_ratio:g}"
            raise InputError(msg)
        for name, value in (("u_aspect_ratio", self.u_aspect_ratio), ("pitch_u_um", self.pitch_u_um)):
            if value is not None and not (math.isfinite(value) and value > 0):
                msg = f"{name}: must be finite and above 0, got {value:g}"
                raise InputError(msg)
        if self.pitch_u_um is not None and self.layout.positions:
            msg = f"pitch_u_um: goes with rows, cols and pitch_um; a list has no pitch, got {self.pitch_u_um:g}"
            raise InputError(msg)

    @property
    def image_layout(self) -> BallLayout:
        """The layout as the camera sees it: what the finder takes.

        Examples
        --------
        >>> layout = BallLayout(rows=2, cols=3, pitch_um=800.0, depopulated=("A1",))
        >>> PartRecipe("demo", layout, view="top").image_layout.depopulated
        ('A3',)
        """
        if self.view == "bottom":
            return self.layout
        return replace(
            self.layout,
            depopulated=tuple(mirrored_name(name, self.layout.cols or 0) for name in self.layout.depopulated),
            positions=tuple((name, -x_um, y_um) for name, x_um, y_um in self.layout.positions),
        )

    def name_of(self, image_name: str, row: int | None, col: int | None) -> str:
        """The recipe's name of a ball that has `image_name` in the image.

        Examples
        --------
        >>> PartRecipe("demo", BallLayout(rows=2, cols=3, pitch_um=800.0), view="top").name_of("A1", 0, 0)
        'A3'
        """
        cols = self.layout.cols or 0
        if self.view == "bottom" or row is None or col is None or not 0 <= col < cols:
            return image_name
        return ball_name(row, cols - 1 - col)

    def to_dict(self) -> dict[str, Any]:
        """Return the recipe as plain Python values."""
        values = asdict(self)
        for name in ("material_file", "file"):
            values[name] = None if values[name] is None else str(values[name])
        return values
