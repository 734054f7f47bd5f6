"""The part recipe ``part.toml``: what it may hold, and clear words for what it may not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from pydantic import ConfigDict, Field, model_validator

from bgars.errors import FileFormatError, InputError
from bgars.io.positions import read_positions
from bgars.io.strict_toml import Strict, checked, read_values
from bgars.records.ball_layout import BallLayout
from bgars.records.ball_names import ball_name, ball_place
from bgars.records.part_recipe import Limits, PartRecipe, View
from bgars.records.strip_layout import StripLayout

if TYPE_CHECKING:
    from collections.abc import Iterator
    from os import PathLike

__all__ = ["LimitsTable", "PartTable", "read_part_recipe", "recipe_keys"]

MAX_BALLS = 32_767
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Number = Annotated[float, Field(allow_inf_nan=False)]
Range = tuple[NotNegative, NotNegative]


class StrictNumbers(Strict):
    """A table that takes neither text nor true for a number."""

    model_config = ConfigDict(strict=True)


class LimitsTable(StrictNumbers):
    """The ``[limits]`` table."""

    old_names: ClassVar = {"q": "aspect_ratio", "flat_um": "flat_top_depth_um"}

    true_position_um: Positive | None = Field(
        None, description="largest distance of a ball from its grid place; half of a diametral tolerance"
    )
    diameter_um: Range | None = Field(None, description="lowest and highest horizontal diameter")
    height_um: Range | None = Field(None, description="lowest and highest top above the local board")
    aspect_ratio: Range | None = Field(None, description="lowest and highest vertical over horizontal radius")
    flat_top_depth_um: Positive | None = Field(None, description="largest missing height of a flat top")
    pitch_um: Range | None = Field(None, description="lowest and highest pitch of the best-fitting grid")
    seating_coplanarity_um: Positive | None = Field(None, description="largest apex distance from the seating plane")
    regression_coplanarity_um: Positive | None = Field(
        None, description="largest apex distance from the regression plane"
    )
    warpage_um: Positive | None = Field(None, description="largest warpage of the board under the balls")

    @model_validator(mode="before")
    @classmethod
    def _in_order(cls, values: Any) -> Any:  # noqa: ANN401 - whatever the file holds
        if not isinstance(values, dict):
            return values
        for name, limit in values.items():
            if isinstance(limit, list):
                numbers = [number for number in limit if isinstance(number, int | float)]
                pair = 2
                if len(numbers) == len(limit) == pair and not limit[0] < limit[1]:
                    msg = f"{name}: must be [lowest, highest] with lowest < highest, got {limit}"
                    raise ValueError(msg)
                # TOML has arrays only; strict mode wants a tuple for a pair.
                values = {**values, name: tuple(limit)}
        return values


class MaterialTable(StrictNumbers):
    """The ``[material]`` table."""

    file: str = Field(description="material fitted on an earlier capture of the same part and rig")


class StripTable(StrictNumbers):
    """The ``[strip]`` table."""

    rows: Annotated[int, Field(ge=1)] = Field(description="rows of parts in the image")
    cols: Annotated[int, Field(ge=1)] = Field(description="columns of parts in the image")
    pitch_x_um: Positive = Field(description="distance of neighbouring columns of parts")
    pitch_y_um: Positive = Field(description="distance of neighbouring rows of parts")
    offset_um: list[Number] | None = Field(
        None, description="[x, y] of the array's middle against the image's middle (x right, y up); [0, 0] by default"
    )
    window_um: list[Positive] | None = Field(
        None, description="[width, height] around a place that belong to its part alone; the pitches by default"
    )
    empty: list[str] | None = Field(None, description='places without a part, such as ["R1C3"]')

    @model_validator(mode="after")
    def _pairs(self) -> StripTable:
        for name in ("offset_um", "window_um"):
            value = getattr(self, name)
            if value is not None and len(value) != len("xy"):
                msg = f"{name}: must be two numbers, got {value}"
                raise ValueError(msg)
        return self

    def layout(self) -> StripLayout:
        """Return the record."""
        given = self.model_dump(exclude_none=True)
        values: dict[str, Any] = {
            name: tuple(value) if isinstance(value, list) else value for name, value in given.items()
        }
        return StripLayout(**values)


class PartTable(StrictNumbers):
    """The whole of ``part.toml``; file names are relative to its folder."""

    old_names: ClassVar = {"q": "aspect_ratio", "u_q": "u_aspect_ratio"}

    name: Annotated[str, Field(min_length=1)] = Field(description="name of the part")
    view: View = Field("bottom", description='side that names and positions refer to; "top" exchanges left and right')
    rows: Annotated[int, Field(ge=1, le=MAX_BALLS)] | None = Field(None, description="rows of the lattice")
    cols: Annotated[int, Field(ge=1, le=MAX_BALLS)] | None = Field(None, description="columns of the lattice")
    pitch_um: Positive | None = Field(None, description="distance of neighbours in the lattice")
    pitch_u_um: Positive | None = Field(
        None, description="standard uncertainty of pitch_um, of the whole lattice alike; not known by default"
    )
    depopulated: list[str] | None = Field(
        None, description='lattice places without a ball, by name or as ranges, such as ["C3", "F6:K10"]'
    )
    positions: str | None = Field(
        None,
        description="instead of the lattice: CSV file with the columns name, x_um, y_um, or X, Y, Diameter in mm "
        "(x right, y up)",
    )
    diameter_um: Positive | None = Field(None, description="nominal horizontal diameter")
    height_um: Positive | None = Field(None, description="nominal height of the tops above the board")
    aspect_ratio: Number | None = Field(
        None,
        description="vertical over horizontal radius that all balls share, 0.2 to 2; 1 with u_aspect_ratio alone",
    )
    u_aspect_ratio: Positive | None = Field(
        None, description="standard uncertainty of aspect_ratio, of all balls alike; 0.01 with aspect_ratio alone"
    )
    gravity_um: list[Number] | None = Field(
        None, description="[x, y] of the centre of gravity against the middle; the mean of the places by default"
    )
    limits: LimitsTable = Field(default_factory=lambda: LimitsTable.model_validate({}), description="what is judged")
    material: MaterialTable | None = Field(None, description="a known material")
    strip: StripTable | None = Field(None, description="one image shows many parts")

    @model_validator(mode="after")
    def _one_layout(self) -> PartTable:
        lattice = {"rows": self.rows, "cols": self.cols, "pitch_um": self.pitch_um}
        missing = [name for name, value in lattice.items() if value is None]
        if self.positions is not None:
            given = [*(name for name in lattice if name not in missing)]
            given += [] if self.depopulated is None else ["depopulated"]
            if given:
                msg = f"contradictory layout: positions excludes {', '.join(given)}"
                raise ValueError(msg)
        elif missing:
            msg = f"the layout needs rows, cols and pitch_um, or positions; missing: {', '.join(missing)}"
            raise ValueError(msg)
        return self


def read_part_recipe(path: str | PathLike[str]) -> PartRecipe:
    """Read and check a part recipe.

    Parameters
    ----------
    path : path
        A ``part.toml`` (docs/inspection.md lists its keys).

    Returns
    -------
    PartRecipe

    Raises
    ------
    FileFormatError
        The file, its CSV of positions or its material file is missing, or does not parse.
    InputError
        An unknown key (the nearest known one is named: limits carry their unit), a wrong type, a value out of range,
        or a layout that contradicts itself; file, key, rule and value are named.

    Examples
    --------
    >>> import bgars
    >>> recipe = bgars.read_part_recipe(bgars.sample_part_recipe())
    >>> recipe.layout.rows, recipe.limits.height_um
    (5, (460.0, 540.0))
    """
    path = Path(path)
    table = checked(PartTable, read_values(path), path)
    try:
        layout = _layout(table, path)
        recipe = PartRecipe(
            name=table.name,
            layout=layout,
            view=table.view,
            limits=Limits(**table.limits.model_dump()),
            diameter_um=table.diameter_um,
            height_um=table.height_um,
            aspect_ratio=table.aspect_ratio,
            u_aspect_ratio=table.u_aspect_ratio,
            pitch_u_um=table.pitch_u_um,
            strip=None if table.strip is None else table.strip.layout(),
            file=path,
        )
        _check_sizes(table, recipe.aspect_ratio)
    except InputError as error:
        msg = f"{path}: {error}"
        raise InputError(msg) from None
    gravity_um = None if table.gravity_um is None else (table.gravity_um[0], table.gravity_um[1])
    return replace(recipe, gravity_um=gravity_um, material_file=_material(table, path))


def recipe_keys() -> Iterator[tuple[str, str]]:
    """Yield each key of a part recipe and what it means, for the documentation."""
    for name, entry in PartTable.model_fields.items():
        if name == "limits":
            yield from ((f"limits.{key}", str(part.description)) for key, part in LimitsTable.model_fields.items())
        elif name == "material":
            yield from ((f"material.{key}", str(part.description)) for key, part in MaterialTable.model_fields.items())
        elif name == "strip":
            yield from ((f"strip.{key}", str(part.description)) for key, part in StripTable.model_fields.items())
        else:
            yield name, str(entry.description)


def _layout(table: PartTable, path: Path) -> BallLayout:
    if table.positions is not None:
        return BallLayout(positions=read_positions(path.parent / table.positions, table.diameter_um))
    rows, cols, pitch_um = table.rows or 0, table.cols or 0, table.pitch_um or 0.0
    if rows * cols > MAX_BALLS:
        msg = f"rows x cols: must be {MAX_BALLS} balls or fewer, got {rows} x {cols}"
        raise InputError(msg)
    seen: set[str] = set()
    empty = tuple(name for entry in table.depopulated or () for name in _places_of(entry))
    for name in empty:
        try:
            row, col = ball_place(name)
        except InputError as error:
            msg = f"depopulated: {error}"
            raise InputError(msg) from None
        if row >= rows or col >= cols:
            last = ball_name(rows - 1, cols - 1)
            msg = f"depopulated: must be on the {rows} x {cols} lattice (A1 to {last}), got {name!r}"
            raise InputError(msg)
        if name in seen:
            msg = f"depopulated: must name each place once, got {name!r} twice"
            raise InputError(msg)
        seen.add(name)
    if len(seen) == rows * cols:
        msg = f"depopulated: must leave a ball, got all {len(seen)} places of the {rows} x {cols} lattice"
        raise InputError(msg)
    return BallLayout(rows, cols, pitch_um, empty)


def _places_of(entry: str) -> tuple[str, ...]:
    """Names of a place, or of all places of a rectangle such as F6:K10."""
    if ":" not in entry:
        return (entry,)
    try:
        (top, left), (bottom, right) = (ball_place(name.strip()) for name in entry.split(":"))
    except (InputError, ValueError) as error:
        msg = f"depopulated: a range must be two names such as F6:K10, got {entry!r}"
        raise InputError(msg) from error
    if top > bottom or left > right or (bottom - top + 1) * (right - left + 1) > MAX_BALLS:
        msg = f"depopulated: a range goes from its first place to its last, down and to the right, got {entry!r}"
        raise InputError(msg)
    return tuple(ball_name(row, col) for row in range(top, bottom + 1) for col in range(left, right + 1))


def _check_sizes(table: PartTable, aspect_ratio: float | None) -> None:
    if table.gravity_um is not None and len(table.gravity_um) != len("xy"):
        msg = f"gravity_um: must be [x, y], got {table.gravity_um}"
        raise InputError(msg)
    limits = table.limits
    for name, nominal in (
        ("diameter_um", table.diameter_um),
        ("height_um", table.height_um),
        ("pitch_um", table.pitch_um),
        ("aspect_ratio", aspect_ratio),
    ):
        limit = getattr(limits, name)
        if nominal is not None and limit is not None and not limit[0] <= nominal <= limit[1]:
            span = f"{limit[0]:g} to {limit[1]:g}"
            msg = f"{name}: the nominal value must be within limits.{name} ({span}), got {nominal:g}"
            raise InputError(msg)
    if table.pitch_um is not None and table.diameter_um is not None and table.diameter_um >= table.pitch_um:
        msg = f"diameter_um: must be below pitch_um ({table.pitch_um:g}), or balls touch, got {table.diameter_um:g}"
        raise InputError(msg)
    if table.positions is not None and limits.pitch_um is not None:
        msg = "limits.pitch_um: goes with rows, cols and pitch_um; a list of positions has no pitch"
        raise InputError(msg)


def _material(table: PartTable, path: Path) -> Path | None:
    if table.material is None:
        return None
    file = path.parent / table.material.file
    if not file.is_file():
        msg = f"{path}: material.file: no such file: {file}"
        raise FileFormatError(msg)
    return file
