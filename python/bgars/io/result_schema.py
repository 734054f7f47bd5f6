"""What ``result.json`` holds: every key, its unit and its meaning; the published JSON Schema is made from this."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, Strict, model_validator

from bgars.records.ball_result import Verdict
from bgars.records.found_balls import BallKind
from bgars.records.part_recipe import View
from bgars.records.part_result import FORMAT, FORMAT_VERSION

__all__ = ["ResultTable", "result_schema"]

SCHEMA_DIALECT = "https://json-schema.org/draft/2020-12/schema"
Number = Annotated[float, Field(allow_inf_nan=False)]
Reading = Number | None
"""null = not measured, or not known."""
Pair = Annotated[list[Number], Field(min_length=2, max_length=2)]
Vector = Annotated[list[Number], Field(min_length=3, max_length=3)]
Count = Annotated[int, Field(ge=0)]
Causes = dict[str, Annotated[float, Field(allow_inf_nan=False, ge=0)]]
"""Standard uncertainty (k = 1) by cause, in um."""
Checksum = Annotated[str, Field(pattern="^[0-9a-f]{64}$")]


class Table(BaseModel):
    """An object whose keys are all known and all there."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class BallTable(Table):
    """A ball, or a place that should have one; null = not measured."""

    name: str = Field(description="name of the ball in the recipe's view, such as B7")
    row: int | None = Field(description="row from 0 at the top of the image; null off the lattice")
    col: int | None = Field(description="column from 0 at the left of the image; null off the lattice")
    present: bool = Field(description="false: a ball is missing here")
    verdict: Verdict = Field(description="of this ball")
    reasons: list[str] = Field(description="why the verdict is not pass")
    kind: BallKind = Field(description="ball; extra: where none should be; bridged: joined to a neighbour")
    x_um: Reading = Field(description="centre, to the right of the image's centre, in um")
    u_x_um: Reading = Field(description="standard uncertainty (k = 1) of x_um, in um")
    y_um: Reading = Field(description="centre, above the image's centre, in um")
    u_y_um: Reading = Field(description="standard uncertainty (k = 1) of y_um, in um")
    x_nominal_um: Reading = Field(description="its place in the best-fitting grid, in um")
    y_nominal_um: Reading = Field(description="its place in the best-fitting grid, in um")
    true_position_um: Reading = Field(description="distance of the centre from that place (a radius), in um")
    u_true_position_um: Reading = Field(description="standard uncertainty (k = 1) of true_position_um, in um")
    diameter_um: Reading = Field(description="horizontal diameter, in um")
    u_diameter_um: Reading = Field(description="standard uncertainty (k = 1) of diameter_um, in um")
    centre_z_um: Reading = Field(description="height of the centre above the local board, in um")
    u_centre_z_um: Reading = Field(description="standard uncertainty (k = 1) of centre_z_um, in um")
    top_um: Reading = Field(description="height of the top above the local board, in um")
    u_top_um: Reading = Field(description="standard uncertainty (k = 1) of top_um, in um")
    q: Reading = Field(description="vertical over horizontal radius, a ratio; 1 = sphere")
    u_q: Reading = Field(description="standard uncertainty (k = 1) of q, a ratio")
    flat_um: Reading = Field(description="height that a flat top lacks, in um")
    u_flat_um: Reading = Field(description="standard uncertainty (k = 1) of flat_um, in um")
    seating_deviation_um: Reading = Field(description="distance of the top below the seating plane, in um")
    regression_deviation_um: Reading = Field(description="distance of the top below the regression plane, in um")
    lights_used: Count = Field(description="lights whose shadow of this ball was usable")
    budget: dict[Literal["x_um", "y_um", "diameter_um", "top_um"], Causes] = Field(
        description="standard uncertainty (k = 1) of readings by cause, in um, largest first"
    )

    @model_validator(mode="before")
    @classmethod
    def _earlier(cls, values: Any) -> Any:  # noqa: ANN401 - whatever the file holds
        """Results of version 2 had no budgets."""
        return {"budget": {}} | values if isinstance(values, dict) else values


class CheckTable(Table):
    """A quantity of the whole part, and how it was judged."""

    name: str = Field(description="quantity, with its unit, such as seating_coplanarity_um")
    value_um: Reading = Field(description="reading, in um")
    u_um: Reading = Field(description="standard uncertainty (k = 1) of the reading, in um")
    bias_um: Reading = Field(description="by how much noise makes the reading too large on average, in um")
    lowest_um: Reading = Field(description="lowest allowed value, in um; null = no limit")
    highest_um: Reading = Field(description="highest allowed value, in um; null = no limit")
    verdict: Verdict | None = Field(description="null: there is no limit")
    reason: str = Field(description="the verdict in words")


class SeatingTable(Table):
    """A plane on which the part comes to rest: z = slope_x x + slope_y y + offset_um, in the image's axes."""

    balls: list[str] = Field(description="balls that touch it")
    coplanarity_um: Reading = Field(description="largest distance of a top below it, in um")
    slope_x: Reading = Field(description="rise to the right, um a um")
    slope_y: Reading = Field(description="rise upward in the image, um a um")
    offset_um: Reading = Field(description="height at the image's centre, in um")


class LayoutTable(Table):
    """Where balls should be: a square grid, or a list of places."""

    rows: int | None = Field(description="rows of the grid; null with a list of positions")
    cols: int | None = Field(description="columns of the grid; null with a list of positions")
    pitch_um: Reading = Field(description="distance of neighbours, in um; null with a list of positions")
    depopulated: list[str] = Field(description="names of places without a ball")
    positions: list[Annotated[tuple[str, Number, Number], Strict(strict=False)]] = Field(
        description="name, x and y in um of each place, or empty"
    )


class LimitTable(Table):
    """Limits; a pair is lowest and highest, a single number the highest, null = not judged."""

    true_position_um: Reading = Field(description="of each ball, in um")
    diameter_um: Pair | None = Field(description="of each ball, in um")
    height_um: Pair | None = Field(description="of each ball's top_um, in um")
    q: Pair | None = Field(description="of each ball, a ratio")
    flat_um: Reading = Field(description="of each ball, in um")
    pitch_um: Pair | None = Field(description="of the best-fitting grid, in um")
    seating_coplanarity_um: Reading = Field(description="of the part, in um")
    regression_coplanarity_um: Reading = Field(description="of the part, in um")
    warpage_um: Reading = Field(description="of the part, in um")


class RecipeTable(Table):
    """The part as it should be."""

    name: str = Field(description="name of the part")
    layout: LayoutTable = Field(description="where its balls should be, in `view`")
    view: View = Field(description="side that names and positions refer to")
    limits: LimitTable = Field(description="what was judged")
    diameter_um: Reading = Field(description="nominal horizontal diameter, in um")
    height_um: Reading = Field(description="nominal height of the tops, in um")
    gravity_um: Pair | None = Field(description="centre of gravity, in um; null = the mean of the places")
    material_file: str | None = Field(description="file of a material fitted earlier")
    file: str | None = Field(description="file that the recipe was read from")
    q: Reading = Field(description="vertical over horizontal radius that all balls share, a ratio; null = not stated")
    u_q: Reading = Field(description="standard uncertainty (k = 1) of q, a ratio; null = not stated")
    pitch_u_um: Reading = Field(
        description="standard uncertainty (k = 1) of the grid's pitch, in um; null = not stated"
    )

    @model_validator(mode="before")
    @classmethod
    def _earlier(cls, values: Any) -> Any:  # noqa: ANN401 - whatever the file holds
        """Recipes of results written before these keys existed could not state them."""
        return {"q": None, "u_q": None, "pitch_u_um": None} | values if isinstance(values, dict) else values


class ParameterTable(Table):
    """A number of the material."""

    name: str = Field(description="as in a material file: diffuse_level, roughness_1, gain_0, ...")
    value: Reading = Field(description="the number, in `unit`")
    standard_error: Reading = Field(description="standard error (k = 1) in `unit`; null = the number was not fitted")
    unit: Literal["grey levels of 255", "ratio"] = Field(description="unit of value and standard error")


class MaterialTable(Table):
    """What the balls do with light, as the estimator of the normals fitted it."""

    parameters: list[ParameterTable] = Field(description="diffuse light, one or two lobes, brightness of each light")
    masking: Literal["smith", "cook-torrance"] = Field(description="attenuation of the lobes that explains more")
    loss: Reading = Field(
        description="mean of log(1 + (r / 3)^2) over pixels and lights, r in grey levels: below 0.1 explained very "
        "well, above 2 not at all"
    )
    accepted: bool = Field(description="false: the fit was too bad, normals are another estimator's")
    from_file: bool = Field(description="true: the recipe brought the material, nothing was fitted")
    own_material_balls: Count = Field(description="balls that were given a material of their own")
    residuals_learnt: bool = Field(description="whether balls were corrected by what the others show beyond it")


class IdentityTable(Table):
    """What tells the part from the next one; empty = not known."""

    lot: str = Field(description="lot or order")
    substrate: str = Field(description="strip, tray or panel that carries the part")
    position: str = Field(description="place on the substrate")
    station: str = Field(description="machine that took the images")
    operator: str = Field(description="who ran the machine")
    captured_utc: str = Field(description="when the last image was written: ISO 8601, UTC")


class FileTable(Table):
    """A file that the result was made from."""

    name: str = Field(description="file name without its folder")
    sha256: Checksum = Field(description="SHA-256 of its bytes, in hexadecimal")


class ResultTable(Table):
    """The result of one inspection; lengths in um, angles in degrees, null = not measured."""

    format: Literal["bgars-result"] = Field(description="says that this file is a result of bgars")
    format_version: Literal[2, 3, 4] = Field(description="rises with every change of the keys or their meaning")
    name: str = Field(description="name of the part (recipe), else of the capture")
    balls: list[BallTable] = Field(description="places in reading order, missing ones too; balls off the layout last")
    verdict: Verdict = Field(
        description="fail if anything fails, else undecided if anything is undecided or unmeasured"
    )
    reasons: list[str] = Field(description="why the verdict is not pass, the worst first")
    pitch_um: Reading = Field(description="pitch of the best-fitting grid, in um; null for a list of positions")
    u_pitch_um: Reading = Field(description="standard uncertainty (k = 1) of pitch_um, in um")
    grid_angle_deg: Reading = Field(description="turn of the grid against the image, counter-clockwise, in degrees")
    seating_coplanarity_um: Reading = Field(description="by seating plane (JESD22-B108), the worst of them, in um")
    u_seating_coplanarity_um: Reading = Field(description="standard uncertainty (k = 1), in um")
    seating_noise_bias_um: Reading = Field(description="by how much noise makes it too large on average, in um")
    regression_coplanarity_um: Reading = Field(description="by regression plane, in um")
    u_regression_coplanarity_um: Reading = Field(description="standard uncertainty (k = 1), in um")
    regression_noise_bias_um: Reading = Field(description="by how much noise makes it too large on average, in um")
    warpage_um: Reading = Field(description="of the board under the balls, in um")
    u_warpage_um: Reading = Field(description="standard uncertainty (k = 1) of warpage_um, in um")
    seatings: list[SeatingTable] = Field(description="planes on which the part comes to rest, the worst first")
    checks: list[CheckTable] = Field(description="quantities of the whole part")
    bridges: list[Annotated[list[str], Field(min_length=2, max_length=2)]] = Field(
        description="pairs of balls that are joined"
    )
    light_directions: list[Vector] = Field(description="refined unit vectors from the board to each light: x, y, z")
    light_change_deg: list[Number] = Field(description="how far each light was moved from the rig's, in degrees")
    board_coefficients_um: list[Reading] = Field(
        description="z = c0 + c1 x + c2 y + c3 x^2 + c4 x y + c5 y^2 of the board, everything in um",
        min_length=6,
        max_length=6,
    )
    shadow_residual_rms: Reading = Field(description="of the fit of the shadows, over their contrast (a ratio)")
    warnings: list[str] = Field(description="what to look at although the numbers are right")
    recipe: RecipeTable | None = Field(description="null: inspected without a recipe")
    pixel_pitch_um: Number = Field(description="size of a pixel on the board, in um", gt=0)
    files: list[FileTable] = Field(description="every input file")
    version: str = Field(description="version of bgars")
    method: str = Field(description="estimator of the normals, which show flat tops")
    normals_choice: str = Field(
        description="what the estimator did, and how well one material explains the balls; empty = no ball looked at"
    )
    material: MaterialTable | None = Field(description="null: another estimator, or no ball was looked at")
    capture: str = Field(description="name of the capture folder")
    serial: str = Field(description="serial number of the part; empty = not given")
    inspected_utc: str = Field(
        description="when the command inspected it: ISO 8601, UTC, such as 2026-01-31T12:00:00Z; empty = not stamped",
        pattern=r"^(\d{4}-\d{2}-\d{2}T\d{2}:\d{2}:\d{2}Z)?$",
    )
    seating_budget: Causes = Field(
        description="what u_seating_coplanarity_um is made of: standard uncertainty (k = 1) by cause, in um"
    )
    identity: IdentityTable = Field(description="lot, place, station, operator: what tells the part from the next")

    @model_validator(mode="before")
    @classmethod
    def _earlier(cls, values: Any) -> Any:  # noqa: ANN401 - whatever the file holds
        """Results of version 2 had no budgets, those before version 4 no identity beside the serial number."""
        earlier = {"seating_budget": {}, "identity": dict.fromkeys(IdentityTable.model_fields, "")}
        return earlier | values if isinstance(values, dict) else values


def result_schema() -> dict[str, Any]:
    """Return the JSON Schema of ``result.json``; ``docs/result.schema.json`` holds it.

    Examples
    --------
    >>> schema = result_schema()
    >>> schema["properties"]["pixel_pitch_um"]["description"]
    'size of a pixel on the board, in um'
    """
    schema = ResultTable.model_json_schema(mode="validation")
    heading = {"$schema": SCHEMA_DIALECT, "title": f"{FORMAT} {FORMAT_VERSION}"}
    return heading | {key: value for key, value in schema.items() if key != "title"}
