"""The tables of a store: every column, its type, its unit and its meaning; docs/store.md is made from this."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from bgars.io.parquet import need_pyarrow
from bgars.records.ball_result import BallResult
from bgars.records.keys import keys_of, old_names
from bgars.records.part_check import PartCheck
from bgars.records.part_result import PartResult

if TYPE_CHECKING:
    from collections.abc import Iterable

__all__ = ["FORMAT", "FORMAT_VERSION", "OLD_NAMES", "TABLES", "Column", "arrow_schema"]

FORMAT = "bgars-store"
FORMAT_VERSION = 2
"""Rises when a column goes, changes its name or its meaning; new columns alone do not raise it."""
KEY_MEANING = "the part: SHA-256 of its input files' contents, serial, recipe, method and version"
READINGS = (
    "pitch_um",
    "u_pitch_um",
    "grid_angle_deg",
    "seating_coplanarity_um",
    "u_seating_coplanarity_um",
    "regression_coplanarity_um",
    "u_regression_coplanarity_um",
    "warpage_um",
    "u_warpage_um",
    "shadow_residual_rms",
)
WHOLE = {"row", "col", "lights_used"}
TEXT = {"name", "verdict", "kind", "reason"}


class Column(NamedTuple):
    """A column: `kind` is text, texts, real, whole, truth or time; the unit ends its name."""

    name: str
    kind: str
    meaning: str


def _kind(name: str) -> str:
    if name in TEXT:
        return "text"
    if name in WHOLE:
        return "whole"
    return {"present": "truth", "reasons": "texts"}.get(name, "real")


def _of_record(record: type) -> Iterable[Column]:
    for name, key in keys_of(record).items():
        if name != "budget":
            yield Column(name, _kind(name), key.meaning)


PARTS = (
    Column("part_key", "text", KEY_MEANING),
    Column("sequence", "whole", "order in which parts came into the store; does not follow a clock that is set back"),
    Column("serial", "text", "serial number of the part"),
    Column("round", "whole", "inspection of the serial number: 1 = the first, 2 = the next, such as after rework"),
    Column("lot", "text", "lot or order"),
    Column("substrate", "text", "strip, tray or panel"),
    Column("position", "text", "place on the substrate"),
    Column("station", "text", "machine that took the images"),
    Column("operator", "text", "who ran the machine"),
    Column("part", "text", "name of the part, from the recipe"),
    Column("capture", "text", "name of the capture folder"),
    Column("capture_folder", "text", "where the images lay when they were inspected"),
    Column("captured_utc", "text", "when the last image was written: ISO 8601, UTC"),
    Column("inspected_utc", "time", "when it was inspected, UTC"),
    Column("verdict", "text", "pass, fail or undecided"),
    Column("reason", "text", "the first reason why it is not pass"),
    Column("reasons", "texts", "every reason"),
    Column("defects", "texts", "what fails, each once: missing, bridged, extra, or the name of the reading"),
    *(Column(name, "real", keys_of(PartResult)[name].meaning) for name in READINGS),
    Column("balls", "whole", "places and balls"),
    Column("balls_pass", "whole", "of them, those that pass"),
    Column("balls_fail", "whole", "those that fail"),
    Column("balls_undecided", "whole", "those that are undecided"),
    Column("balls_missing", "whole", "places that are seen to be empty"),
    Column("bridges", "whole", "pairs of balls that are joined"),
    Column("mean_diameter_um", "real", "mean over the balls with a reading, in um"),
    Column("mean_top_um", "real", "mean height over the balls with a reading, in um"),
    Column("warnings", "texts", "what to look at although the numbers are right"),
    Column(
        "images_sha256", "text", "SHA-256 of the images' checksums: the same for every inspection of the same images"
    ),
    Column("recipe_sha256", "text", "SHA-256 of the recipe file"),
    Column("method", "text", "estimator of the normals"),
    Column("version", "text", "version of bgars"),
    Column("seconds", "real", "what reading and inspecting took, in s"),
    Column("result_json", "text", "the whole result.json, for pages and for readings that have no column"),
)
BALLS = (
    Column("part_key", "text", KEY_MEANING),
    *_of_record(BallResult),
    Column("defects", "texts", "what fails: missing, bridged, extra, or the name of the reading"),
)
CHECKS = (Column("part_key", "text", KEY_MEANING), *_of_record(PartCheck))
BUDGETS = (
    Column("part_key", "text", KEY_MEANING),
    Column("ball", "text", "ball; null = of the part"),
    Column("reading", "text", "reading whose uncertainty it is part of"),
    Column("cause", "text", "cause of the uncertainty"),
    Column("u_um", "real", "standard uncertainty (k = 1) by this cause, in um"),
)
FAILURES = (
    Column("part_key", "text", "SHA-256 of folder, serial, recipe and version: the contents may be unreadable"),
    Column("sequence", "whole", "as in parts"),
    Column("serial", "text", "serial number of the part"),
    Column("lot", "text", "lot or order"),
    Column("capture_folder", "text", "where the images lay"),
    Column("failed_utc", "time", "when, UTC"),
    Column("reason", "text", "why it could not be inspected, in one line"),
    Column("version", "text", "version of bgars"),
)
TABLES = {"parts": PARTS, "balls": BALLS, "checks": CHECKS, "budgets": BUDGETS, "failures": FAILURES}
OLD_NAMES = {"balls": old_names(BallResult)}
"""Columns that files of earlier versions have under another name, by table."""
UNITS = {"_um": "um", "_deg": "deg", "seconds": "s"}


def arrow_schema(table: str) -> Any:  # noqa: ANN401 - pyarrow has no types
    """Return the Arrow schema of a table, units and meanings in its metadata."""
    pyarrow, _ = need_pyarrow()
    types = {
        "text": pyarrow.string(),
        "texts": pyarrow.list_(pyarrow.string()),
        "real": pyarrow.float64(),
        "whole": pyarrow.int64(),
        "truth": pyarrow.bool_(),
        "time": pyarrow.timestamp("us"),
    }
    columns = [
        pyarrow.field(
            name,
            types[kind],
            metadata={
                "description": meaning,
                "unit": next((unit for end, unit in UNITS.items() if name.endswith(end)), ""),
            },
        )
        for name, kind, meaning in TABLES[table]
    ]
    return pyarrow.schema(columns, metadata={"format": f"{FORMAT}-{table}", "format_version": str(FORMAT_VERSION)})
