"""The result of an inspection: every ball, the part, and a verdict with its reasons."""

from __future__ import annotations

import csv
import io
import json
import math
from dataclasses import dataclass, field, fields
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from bgars.files.csv_cells import harmless
from bgars.records.ball_result import BallResult, Verdict
from bgars.records.part_check import PartCheck
from bgars.records.part_identity import PartIdentity
from bgars.records.part_material import PartMaterial
from bgars.records.part_recipe import PartRecipe
from bgars.records.part_surface import PartSurface
from bgars.records.plain_values import DIGITS, _plain
from bgars.records.seating_result import SeatingResult
from bgars.records.shown import ShownPart

__all__ = ["FORMAT", "FORMAT_VERSION", "PartResult"]

FORMAT = "bgars-result"
FORMAT_VERSION = 4
"""Rises with every change of the keys of result.json, or of their meaning (docs/result.schema.json)."""
CSV_DIGITS = 3
CSV_PART = ("part_serial", "part_lot", "part_capture", "part_inspected_utc")
TABLE = (
    ("ball", "name", ""),
    ("x um", "x_um", ".1f"),
    ("y um", "y_um", ".1f"),
    ("position um", "true_position_um", ".1f"),
    ("diameter um", "diameter_um", ".1f"),
    ("height um", "top_um", ".1f"),
    ("seating um", "seating_deviation_um", ".1f"),
    ("q", "q", ".3f"),
    ("flat um", "flat_um", ".1f"),
    ("verdict", "verdict", ""),
)
LINE_READINGS = (
    "pitch_um",
    "seating_coplanarity_um",
    "u_seating_coplanarity_um",
    "regression_coplanarity_um",
    "u_regression_coplanarity_um",
    "warpage_um",
)


@dataclass(frozen=True, eq=False, repr=False)
class PartResult(ShownPart):
    """What an inspection found. NaN = not measured; ``u_..`` are standard uncertainties (k = 1).

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
        What to look at although numbers are right.
    recipe : PartRecipe or None
    pixel_pitch_um : float
    files : tuple of (str, str)
        Name and SHA-256 of every input file.
    version : str
        Of bgars.
    method : str
        Estimator of the normals, which show flat tops.
    normals_choice : str
        What it did, and how well one material explains the balls; empty: no ball was looked at.
    material : PartMaterial or None
        What the estimator fitted to the balls; None: another estimator, or no ball was looked at.
    capture : str
        Name of the capture.
    serial : str
        Serial number of the part; empty: not given.
    inspected_utc : str
        When the command inspected it, ISO 8601, UTC; empty: not stamped, so that equal input gives an equal result.
    surface : PartSurface or None
        Integrated heights for the page, where they were asked for; not part of result.json.
    """

    name: str
    balls: tuple[BallResult, ...]
    verdict: Verdict
    reasons: tuple[str, ...]
    pitch_um: float
    u_pitch_um: float
    grid_angle_deg: float
    seating_coplanarity_um: float
    u_seating_coplanarity_um: float
    seating_noise_bias_um: float
    regression_coplanarity_um: float
    u_regression_coplanarity_um: float
    regression_noise_bias_um: float
    warpage_um: float
    u_warpage_um: float
    seatings: tuple[SeatingResult, ...]
    checks: tuple[PartCheck, ...]
    bridges: tuple[tuple[str, str], ...]
    light_directions: NDArray[np.float64]
    light_change_deg: NDArray[np.float64]
    board_coefficients_um: NDArray[np.float64]
    shadow_residual_rms: float
    warnings: tuple[str, ...]
    recipe: PartRecipe | None
    pixel_pitch_um: float
    files: tuple[tuple[str, str], ...] = ()
    version: str = ""
    method: str = ""
    normals_choice: str = ""
    material: PartMaterial | None = None
    capture: str = ""
    serial: str = ""
    inspected_utc: str = ""
    seating_budget: dict[str, float] = field(default_factory=dict)
    surface: PartSurface | None = field(default=None, repr=False)
    identity: PartIdentity = field(default_factory=PartIdentity)

    def to_dict(self) -> dict[str, Any]:
        """Return everything but the surface as plain Python values; None where something was not measured."""
        values = {entry.name: getattr(self, entry.name) for entry in fields(self) if entry.name != "surface"}
        values["balls"] = [ball.to_dict() for ball in self.balls]
        values["recipe"] = None if self.recipe is None else self.recipe.to_dict()
        values["material"] = None if self.material is None else _material_dict(self.material)
        values["identity"] = dict(vars(self.identity))
        values["files"] = [{"name": name, "sha256": digest} for name, digest in self.files]
        for name in ("seatings", "checks"):
            values[name] = [{key: _plain(value, DIGITS) for key, value in vars(row).items()} for row in values[name]]
        # Slopes and curvatures are small numbers: they keep all digits.
        exact = {"board_coefficients_um": [None if math.isnan(c) else float(c) for c in self.board_coefficients_um]}
        heading = {"format": FORMAT, "format_version": FORMAT_VERSION}
        return heading | {name: _plain(value, DIGITS) for name, value in values.items()} | exact

    def to_json(self) -> str:
        """Return :meth:`to_dict` as JSON text."""
        return json.dumps(self.to_dict(), indent=2, ensure_ascii=False, allow_nan=False) + "\n"

    def to_csv(self) -> str:
        """Return the balls as CSV text, one line per ball; empty cells where something was not measured.

        The last columns say which part it is: serial number, lot, capture, time.
        Text that a spreadsheet would run as a formula begins with an apostrophe.
        """
        text = io.StringIO()
        names = [entry.name for entry in fields(BallResult) if entry.name != "budget"]
        writer = csv.writer(text, lineterminator="\n")
        part = [self.serial, self.identity.lot, self.capture, self.inspected_utc]
        writer.writerow([*names, *CSV_PART])
        for ball in self.balls:
            cells = [_csv_cell(name, getattr(ball, name)) for name in names]
            told = ["; ".join(cell) if isinstance(cell, list) else cell for cell in cells]
            writer.writerow([harmless(cell) if isinstance(cell, str) else cell for cell in (*told, *part)])
        return text.getvalue()

    def to_table(self) -> str:
        """Return the balls as a table for people; "-" where something was not measured."""
        rows = [[title for title, _, _ in TABLE]]
        rows += [[_cell(getattr(ball, name), form) for _, name, form in TABLE] for ball in self.balls]
        widths = [max(len(row[at]) for row in rows) for at in range(len(TABLE))]
        last = len(TABLE) - 1
        lines = []
        for row in rows:
            cells = [
                f"{cell:<{w}}" if at in {0, last} else f"{cell:>{w}}"
                for at, (cell, w) in enumerate(zip(row, widths, strict=True))
            ]
            lines.append("  ".join(cells).rstrip())
        return "\n".join(lines)

    def summary_line(self) -> str:
        """Return one line for a log: key=value pairs, always these keys, in this order.

        Numbers in the unit of their key, null = not measured; text with spaces, quotes or control characters is quoted
        as in JSON, so that a line stays a line.
        """
        balls = {verdict: sum(ball.verdict == verdict for ball in self.balls) for verdict in get_args(Verdict)}
        pairs = {
            "time": self.inspected_utc or None,
            "part": self.name,
            "serial": self.serial,
            "capture": self.capture,
            "verdict": self.verdict,
            "balls": len(self.balls),
            **{f"balls_{verdict}": count for verdict, count in balls.items()},
            "balls_missing": sum(not ball.present and ball.verdict == "fail" for ball in self.balls),
            "bridges": len(self.bridges),
            **{name: getattr(self, name) for name in LINE_READINGS},
            "reason": self.reasons[0] if self.reasons else "",
            "warnings": len(self.warnings),
            "version": self.version,
        }
        return " ".join(f"{key}={_log_value(value)}" for key, value in pairs.items())


def _material_dict(material: PartMaterial) -> dict[str, Any]:
    return vars(material) | {"parameters": [dict(vars(row)) for row in material.parameters]}


def _csv_cell(name: str, value: Any) -> Any:  # noqa: ANN401 - a field of a record
    """Lengths to a nanometre, ratios and small uncertainties to as many decimals as tell them from 0."""
    return _plain(value, CSV_DIGITS if name.endswith("_um") and not _is_tiny(value) else DIGITS)


def _is_tiny(value: Any) -> bool:  # noqa: ANN401 - a field of a record
    return isinstance(value, float) and 0.0 < abs(value) < 10.0**-CSV_DIGITS


def _log_value(value: float | str | None) -> str:
    if isinstance(value, float):
        return f"{value:.3f}" if math.isfinite(value) else "null"
    if isinstance(value, str) and (not value or not value.isprintable() or set(value) & set(' "=\\')):
        return json.dumps(value, ensure_ascii=not value.isprintable())
    return "null" if value is None else str(value)


def _cell(value: Any, form: str) -> str:  # noqa: ANN401 - a field of a record
    if isinstance(value, float):
        return format(value, form) if math.isfinite(value) else "-"
    return str(value)
