"""The result of an inspection: every ball, the part, and a verdict with its reasons."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from bgars.records.ball_result import BallResult, Verdict
from bgars.records.input_file import InputFile
from bgars.records.keys import Key, as_plain
from bgars.records.part_check import PartCheck
from bgars.records.part_identity import PartIdentity
from bgars.records.part_material import PartMaterial
from bgars.records.part_recipe import PartRecipe
from bgars.records.part_surface import PartSurface
from bgars.records.renamed import renamed
from bgars.records.result_text import csv_text, log_line, table_text
from bgars.records.seating_result import SeatingResult
from bgars.records.shown import ShownPart

__all__ = ["FORMAT", "FORMAT_VERSION", "OLDEST_VERSION", "PartResult"]

FORMAT = "bgars-result"
FORMAT_VERSION = 5
"""Rises with every change of the keys of result.json, or of their meaning (docs/result.schema.json)."""
OLDEST_VERSION = 1
"""That :func:`bgars.read_result` reads."""


@renamed(normals_choice="method_reason")
@dataclass(frozen=True, eq=False, repr=False)
class PartResult(ShownPart):
    """What an inspection found.

    NaN = not measured; ``u_..`` are standard uncertainties (k = 1).

    Attributes
    ----------
    name : str
        Of the part (recipe) or the capture.
    balls : tuple of BallResult
        Places in reading order, missing ones too; balls off the layout last.
    verdict : {"pass", "fail", "undecided"}
        "fail" if anything fails, else "undecided" if anything is undecided or was not measured.
    reasons : tuple of str
        Why it is not "pass".
    pitch_um, u_pitch_um : float
        Pitch of the best-fitting grid; NaN for a list of positions or a single ball.
    grid_angle_deg : float
        Turn of the grid against the image, counter-clockwise.
    seating_coplanarity_um, u_seating_coplanarity_um, seating_noise_bias_um : float
        Worst of `seatings`; its bias is not subtracted.
    regression_coplanarity_um, u_regression_coplanarity_um, regression_noise_bias_um : float
        By regression plane.
    warpage_um, u_warpage_um : float
        Of the board under the balls.
    seatings : tuple of SeatingResult
        Every plane on which the part comes to rest, the worst first; more than one: the part can rock.
    checks : tuple of PartCheck
        Quantities of the whole part.
    bridges : tuple of (str, str)
        Balls that are joined.
    light_directions : (L, 3) float64
        Refined directions to the lights.
    light_change_deg : (L,) float64
        How far each light was moved from the rig's.
    board_coefficients_um : (6,) float64
        Shape of the board, see :class:`bgars.records.measured_balls.BallMeasurement`.
    shadow_residual_rms : float
        Of the shadow fit, over the contrast.
    seating_budget : dict of float
        What `u_seating_coplanarity_um` is made of: standard uncertainty by cause, um, largest first.
    warnings : tuple of str
        What to check although the numbers are right.
    recipe : PartRecipe or None
    pixel_pitch_um : float
    files : tuple of InputFile
        Name and SHA-256 of every input file.
    version : str
        Of bgars.
    method : str
        Estimator of the normals, which show flat tops.
    method_reason : str
        What it did, and how well one material explains the balls; empty: no ball was examined.
    material : PartMaterial or None
        What the estimator fitted to the balls; None: another estimator, or no ball was examined.
    capture : str
        Name of the capture.
    serial : str
        Serial number of the part; empty: not given.
    inspected_utc : str
        When the command inspected it, ISO 8601, UTC; empty: not stamped, so that equal input gives an equal result.
    surface : PartSurface or None
        Integrated heights for the page, where they were asked for; not part of result.json.
    """

    name: Annotated[str, Key("name of the part (recipe), else of the capture")]
    balls: Annotated[
        tuple[BallResult, ...], Key("places in reading order, missing ones too; balls off the layout last")
    ]
    verdict: Annotated[Verdict, Key("fail if anything fails, else undecided if anything is undecided or unmeasured")]
    reasons: Annotated[tuple[str, ...], Key("why the verdict is not pass, the worst first")]
    pitch_um: Annotated[float, Key("pitch of the best-fitting grid, in um; null for a list of positions")]
    u_pitch_um: Annotated[float, Key("standard uncertainty (k = 1) of pitch_um, in um")]
    grid_angle_deg: Annotated[float, Key("turn of the grid against the image, counter-clockwise, in degrees")]
    seating_coplanarity_um: Annotated[float, Key("by seating plane (JESD22-B108), the worst of them, in um")]
    u_seating_coplanarity_um: Annotated[float, Key("standard uncertainty (k = 1), in um")]
    seating_noise_bias_um: Annotated[float, Key("by how much noise makes it too large on average, in um")]
    regression_coplanarity_um: Annotated[float, Key("by regression plane, in um")]
    u_regression_coplanarity_um: Annotated[float, Key("standard uncertainty (k = 1), in um")]
    regression_noise_bias_um: Annotated[float, Key("by how much noise makes it too large on average, in um")]
    warpage_um: Annotated[float, Key("of the board under the balls, in um")]
    u_warpage_um: Annotated[float, Key("standard uncertainty (k = 1) of warpage_um, in um")]
    seatings: Annotated[tuple[SeatingResult, ...], Key("planes on which the part comes to rest, the worst first")]
    checks: Annotated[tuple[PartCheck, ...], Key("quantities of the whole part")]
    bridges: Annotated[tuple[tuple[str, str], ...], Key("pairs of balls that are joined")]
    light_directions: Annotated[
        NDArray[np.float64], Key("refined unit vectors from the board to each light: x, y, z", shape=(None, 3))
    ]
    light_change_deg: Annotated[
        NDArray[np.float64], Key("how far each light was moved from the rig's, in degrees", shape=(None,))
    ]
    board_coefficients_um: Annotated[
        NDArray[np.float64],
        Key(
            "z = c0 + c1 x + c2 y + c3 x^2 + c4 x y + c5 y^2 of the board, everything in um", shape=(6,), is_exact=True
        ),
    ]
    shadow_residual_rms: Annotated[float, Key("of the fit of the shadows, over their contrast (a ratio)")]
    warnings: Annotated[tuple[str, ...], Key("what to look at although the numbers are right")]
    recipe: Annotated[PartRecipe | None, Key("null: inspected without a recipe")]
    pixel_pitch_um: Annotated[float, Key("size of a pixel on the board, in um", gt=0)]
    files: Annotated[tuple[InputFile, ...], Key("every input file")] = ()
    version: Annotated[str, Key("version of bgars")] = ""
    method: Annotated[str, Key("estimator of the normals, which show flat tops")] = ""
    method_reason: Annotated[
        str,
        Key(
            "what the estimator did, and how well one material explains the balls; empty = no ball examined",
            is_late=True,
            was="normals_choice",
        ),
    ] = ""
    material: Annotated[PartMaterial | None, Key("null: another estimator, or no ball was examined", is_late=True)] = (
        None
    )
    capture: Annotated[str, Key("name of the capture folder")] = ""
    serial: Annotated[str, Key("serial number of the part; empty = not given")] = ""
    inspected_utc: Annotated[
        str,
        Key(
            "when the command inspected it: ISO 8601, UTC, such as 2026-01-31T12:00:00Z; empty = not stamped",
            pattern=r"^(\d{4}-\d{2}-\d{2}T\d{2}:\d{2}:\d{2}Z)?$",
        ),
    ] = ""
    seating_budget: Annotated[
        dict[str, float],
        Key("what u_seating_coplanarity_um is made of: standard uncertainty (k = 1) by cause, in um", is_late=True),
    ] = field(default_factory=dict)
    surface: PartSurface | None = field(default=None, repr=False)
    identity: Annotated[
        PartIdentity, Key("lot, place, station, operator: what tells the part from the next", is_late=True)
    ] = field(default_factory=PartIdentity)

    def __post_init__(self) -> None:
        """Name what was given as pairs."""
        object.__setattr__(self, "files", tuple(InputFile(*file) for file in self.files))

    def to_dict(self) -> dict[str, Any]:
        """Return everything but the surface as plain Python values; None where something was not measured."""
        return {"format": FORMAT, "format_version": FORMAT_VERSION, **as_plain(self)}

    def to_json(self) -> str:
        """Return :meth:`to_dict` as JSON text."""
        return json.dumps(self.to_dict(), indent=2, ensure_ascii=False, allow_nan=False) + "\n"

    def to_csv(self) -> str:
        """Return the balls as CSV text, one line per ball; empty cells where something was not measured.

        The last columns say which part it is: serial number, lot, capture, time, round.
        Text that a spreadsheet would run as a formula begins with an apostrophe.
        """
        return csv_text(self)

    def to_table(self) -> str:
        """Return the balls as a table for people; "-" where something was not measured."""
        return table_text(self)

    def summary_line(self) -> str:
        """Return one line for a log: key=value pairs, always these keys, in this order.

        Numbers in the unit of their key, null = not measured; text with spaces, quotes or control characters is quoted
        as in JSON, so that a line stays a line.
        """
        return log_line(self)
