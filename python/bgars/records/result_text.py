"""A result as text: balls as CSV and as a table, the part as a line of a log."""

from __future__ import annotations

import csv
import io
import json
import math
from typing import TYPE_CHECKING, Any, get_args

from bgars.files.csv_cells import harmless
from bgars.records.ball_result import BallResult, Verdict
from bgars.records.keys import DIGITS, keys_of, plain_value

if TYPE_CHECKING:
    from collections.abc import Mapping

    from bgars.records.part_result import PartResult

__all__ = ["csv_text", "error_line", "log_line", "log_pairs", "table_text"]

CSV_DIGITS = 3
CSV_PART = ("part_serial", "part_lot", "part_capture", "part_inspected_utc", "part_round")
TABLE = (
    ("ball", "name", ""),
    ("x um", "x_um", ".1f"),
    ("y um", "y_um", ".1f"),
    ("position um", "true_position_um", ".1f"),
    ("diameter um", "diameter_um", ".1f"),
    ("height um", "top_um", ".1f"),
    ("seating um", "seating_deviation_um", ".1f"),
    ("aspect ratio", "aspect_ratio", ".3f"),
    ("flat top um", "flat_top_depth_um", ".1f"),
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

LINE_KEYS = (
    *("time", "part", "serial", "capture", "verdict", "balls"),
    *(f"balls_{verdict}" for verdict in get_args(Verdict)),
    *("balls_missing", "bridges", *LINE_READINGS, "reason", "warnings", "version", "round"),
)


def csv_text(result: PartResult) -> str:
    """The balls, one line per ball."""
    text = io.StringIO()
    names = [name for name in keys_of(BallResult) if name != "budget"]
    writer = csv.writer(text, lineterminator="\n")
    part = [result.serial, result.identity.lot, result.capture, result.inspected_utc, result.identity.round or ""]
    writer.writerow([*names, *CSV_PART])
    for ball in result.balls:
        cells = [_csv_cell(name, getattr(ball, name)) for name in names]
        told = ["; ".join(cell) if isinstance(cell, list) else cell for cell in cells]
        writer.writerow([harmless(cell) if isinstance(cell, str) else cell for cell in (*told, *part)])
    return text.getvalue()


def table_text(result: PartResult) -> str:
    """The balls, for people."""
    rows = [[title for title, _, _ in TABLE]]
    rows += [[_cell(getattr(ball, name), form) for _, name, form in TABLE] for ball in result.balls]
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


def error_line(*, time: str, part: str, serial: str, capture: str, reason: str, version: str) -> str:
    """A part that could not be inspected, with the keys of :func:`log_line`; what is not known is null.

    Examples
    --------
    >>> error_line(time="", part="BGA 9", serial="SN1", capture="SN1", reason="no images", version="1")[:70]
    'time=null part="BGA 9" serial=SN1 capture=SN1 verdict=error balls=null'
    """
    told = {"part": part, "serial": serial, "capture": capture, "reason": reason, "version": version}
    return _line({"time": time or None, **told, "verdict": "error"})


def log_line(result: PartResult) -> str:
    """The part, as key=value pairs."""
    balls = {verdict: sum(ball.verdict == verdict for ball in result.balls) for verdict in get_args(Verdict)}
    pairs = {
        "time": result.inspected_utc or None,
        "part": result.name,
        "serial": result.serial,
        "capture": result.capture,
        "verdict": result.verdict,
        "balls": len(result.balls),
        **{f"balls_{verdict}": count for verdict, count in balls.items()},
        "balls_missing": sum(not ball.present and ball.verdict == "fail" for ball in result.balls),
        "bridges": len(result.bridges),
        **{name: getattr(result, name) for name in LINE_READINGS},
        "reason": result.reasons[0] if result.reasons else "",
        "warnings": len(result.warnings),
        "version": result.version,
        "round": result.identity.round,
    }
    return _line(pairs)


def _line(pairs: dict[str, Any]) -> str:
    """Pairs as a line that always has the same keys in the same order."""
    return log_pairs({key: pairs.get(key) for key in LINE_KEYS})


def log_pairs(pairs: Mapping[str, float | str | None]) -> str:
    """Return key=value pairs as one line of a log.

    Examples
    --------
    >>> log_pairs({"moved": 2, "level": 0.01, "scale": None, "reason": "light 2 moved"})
    'moved=2 level=0.010 scale=null reason="light 2 moved"'
    """
    return " ".join(f"{key}={_log_value(value)}" for key, value in pairs.items())


def _csv_cell(name: str, value: Any) -> Any:  # noqa: ANN401 - a field of a record
    """Lengths to a nanometre, ratios and small uncertainties to as many decimals as tell them from 0."""
    return plain_value(value, CSV_DIGITS if name.endswith("_um") and not _is_tiny(value) else DIGITS)


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
