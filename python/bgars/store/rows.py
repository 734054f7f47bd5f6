"""A result as rows of the store's tables."""

from __future__ import annotations

import math
from dataclasses import fields
from datetime import datetime
from typing import TYPE_CHECKING, Any

from bgars.errors import InputError
from bgars.inspection.decision import decide
from bgars.records.ball_result import BallResult
from bgars.records.part_check import PartCheck
from bgars.store.keys import images_key, part_key
from bgars.store.schema import READINGS

if TYPE_CHECKING:
    from bgars.records.part_result import PartResult

    Rows = dict[str, list[dict[str, Any]]]

__all__ = ["TIME_FORM", "result_rows", "utc_time"]

TIME_FORM = "%Y-%m-%dT%H:%M:%SZ"
BALL_READINGS = {
    "true_position_um": "true_position_um",
    "diameter_um": "diameter_um",
    "top_um": "height_um",
    "aspect_ratio": "aspect_ratio",
    "flat_top_depth_um": "flat_top_depth_um",
}
"""Reading of a ball and the limit that it is judged by."""


def result_rows(result: PartResult, *, sequence: int, capture_folder: str = "", seconds: float = math.nan) -> Rows:
    """Return the rows of a result, by table.

    Raises
    ------
    InputError
        The result has no time of inspection.
    """
    key = part_key(result)
    defects = {ball.name: _defects(ball, result) for ball in result.balls}
    return {
        "balls": [
            {
                "part_key": key,
                **{entry.name: _cell(getattr(ball, entry.name)) for entry in fields(BallResult)},
                "defects": defects[ball.name],
            }
            for ball in result.balls
        ],
        "checks": [
            {"part_key": key, **{entry.name: _cell(getattr(check, entry.name)) for entry in fields(PartCheck)}}
            for check in result.checks
        ],
        "budgets": list(_budgets(result, key)),
        "parts": [_part(result, key, defects, sequence, capture_folder, seconds)],
    }


def utc_time(text: str) -> datetime:
    """A stamp of a result as a time without a zone, which is UTC.

    Raises
    ------
    InputError
        It is no such stamp.
    """
    try:
        return datetime.strptime(text, TIME_FORM)
    except ValueError:
        msg = (
            f"result.inspected_utc: the store needs the time of inspection, such as 2026-01-31T12:00:00Z, got {text!r}"
        )
        raise InputError(msg) from None


def _part(
    result: PartResult,
    key: str,
    defects: dict[str, list[str]],
    sequence: int,
    capture_folder: str,
    seconds: float,
) -> dict[str, Any]:
    whole = [check.name for check in result.checks if check.verdict == "fail"]
    counted = {name: sum(ball.verdict == name for ball in result.balls) for name in ("pass", "fail", "undecided")}
    identity = {name: value for name, value in vars(result.identity).items() if name != "captured_utc"}
    recipe = result.recipe
    return {
        "part_key": key,
        "sequence": sequence,
        "serial": result.serial,
        **identity,
        "part": result.name,
        "capture": result.capture,
        "capture_folder": capture_folder,
        "captured_utc": result.identity.captured_utc,
        "inspected_utc": utc_time(result.inspected_utc),
        "verdict": result.verdict,
        "reason": result.reasons[0] if result.reasons else "",
        "reasons": list(result.reasons),
        "defects": list(dict.fromkeys([*(name for names in defects.values() for name in names), *whole])),
        **{name: _cell(getattr(result, name)) for name in READINGS},
        "balls": len(result.balls),
        **{f"balls_{name}": count for name, count in counted.items()},
        "balls_missing": sum("missing" in names for names in defects.values()),
        "bridges": len(result.bridges),
        "mean_diameter_um": _mean([ball.diameter_um for ball in result.balls]),
        "mean_top_um": _mean([ball.top_um for ball in result.balls]),
        "warnings": list(result.warnings),
        "images_sha256": images_key(result.files, len(result.light_directions)),
        "recipe_sha256": "" if recipe is None or recipe.file is None else dict(result.files).get(recipe.file.name, ""),
        "method": result.method,
        "version": result.version,
        "seconds": _cell(seconds),
        "result_json": result.to_json(),
    }


def _defects(ball: BallResult, result: PartResult) -> list[str]:
    """What makes a ball fail; nothing for one that does not."""
    if ball.verdict != "fail":
        return []
    if not ball.present:
        return ["missing"]
    if ball.kind != "ball":
        return [ball.kind]
    limits = None if result.recipe is None else result.recipe.limits
    found = []
    for name, limit in BALL_READINGS.items():
        allowed = None if limits is None else limits.range_of(limit)
        if allowed is not None and math.isfinite(getattr(ball, name)):
            verdict, _ = decide(name, getattr(ball, name), getattr(ball, f"u_{name}"), allowed)
            if verdict == "fail":
                found.append(name)
    return found or ["other"]


def _budgets(result: PartResult, key: str) -> Any:  # noqa: ANN401 - an iterator of rows
    for ball in result.balls:
        for reading, causes in ball.budget.items():
            for cause, u_um in causes.items():
                yield {"part_key": key, "ball": ball.name, "reading": reading, "cause": cause, "u_um": _cell(u_um)}
    for cause, u_um in result.seating_budget.items():
        row = {"part_key": key, "ball": None, "reading": "seating_coplanarity_um", "cause": cause, "u_um": _cell(u_um)}
        yield row


def _mean(values: list[float]) -> float | None:
    known = [value for value in values if math.isfinite(value)]
    return sum(known) / len(known) if known else None


def _cell(value: Any) -> Any:  # noqa: ANN401 - a field of a record
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return list(value) if isinstance(value, tuple) else value
