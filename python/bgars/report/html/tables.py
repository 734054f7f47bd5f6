"""The tables of the page: key readings, balls, lights, what was not measured."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from bgars.inspection.judge import MAX_LIGHT_CHANGE_DEG
from bgars.report.html.words import (
    NOT_MEASURED,
    PART_WORDS,
    QUANTITIES,
    VERDICT_MARKS,
    ball_state,
    expanded,
    is_known,
    limit_words,
    listed,
    number,
    range_of,
)

if TYPE_CHECKING:
    from bgars.report.html.source import PageSource

__all__ = ["ball_rows", "board_words", "key_readings", "light_rows", "raised_together", "recipe_rows", "unmeasured"]

VERDICT_ORDER = {"fail": 0, "undecided": 1, "pass": 2}
CORE = (
    ("x_um", "position"),
    ("diameter_um", "diameter"),
    ("top_um", "height"),
    ("aspect_ratio", "aspect ratio"),
    ("flat_top_depth_um", "flat top"),
)


def key_readings(result: dict[str, Any]) -> list[dict[str, str]]:
    """Rows of the whole part (its checks), then the spread of the balls' readings against their limits."""
    rows = []
    for check in result["checks"]:
        verdict = check["verdict"]
        rows.append(
            {
                "name": PART_WORDS.get(check["name"], check["name"]),
                "key": check["name"],
                "value": number(check["value_um"]),
                "u": number(expanded(check["u_um"])),
                "bias": number(check["bias_um"]) if "coplanarity" in check["name"] else "",
                "limits": limit_words((check["lowest_um"], check["highest_um"])),
                "verdict": verdict or "",
                "mark": VERDICT_MARKS.get(verdict, ""),
                "reason": check["reason"] if verdict != "pass" else "",
            }
        )
    return rows


def spreads(result: dict[str, Any]) -> list[dict[str, str]]:
    """One row a quantity of the balls: lowest, highest, and against which limit."""
    rows = []
    for quantity in QUANTITIES:
        known = [(ball[quantity.name], ball["name"]) for ball in result["balls"] if is_known(ball[quantity.name])]
        whole = [(value, name) for value, name in known if math.isfinite(value)]
        low, high = (min(whole), max(whole)) if whole else ((None, ""), (None, ""))
        limits = range_of(result["recipe"], quantity.limit)
        rows.append(
            {
                "title": quantity.title,
                "meaning": quantity.meaning,
                "unit": quantity.unit,
                "low": number(low[0], quantity.digits),
                "low_ball": low[1],
                "high": number(high[0], quantity.digits),
                "high_ball": high[1],
                "count": str(len(whole)),
                "limits": limit_words(limits),
            }
        )
    return rows


def ball_rows(result: dict[str, Any]) -> list[dict[str, Any]]:
    """One row per ball, cells as they are shown and as they are sorted by."""
    rows = []
    for index, ball in enumerate(result["balls"]):
        cells = [
            {
                "text": number(ball[quantity.name], quantity.digits),
                "value": ball[quantity.name],
                "u": number(expanded(ball[quantity.u_name]), quantity.digits)
                if quantity.u_name and is_known(ball[quantity.name]) and is_known(ball[quantity.u_name])
                else "",
            }
            for quantity in QUANTITIES
        ]
        places = [{"text": number(ball[name], 1), "value": ball[name], "u": ""} for name in ("x_um", "y_um")]
        rows.append(
            {
                "index": index,
                "name": ball["name"],
                "verdict": ball["verdict"],
                "mark": VERDICT_MARKS[ball["verdict"]],
                "order": VERDICT_ORDER[ball["verdict"]],
                "state": ball_state(ball),
                "cells": [*places, *cells],
                "lights": ball["lights_used"],
                "reasons": ball["reasons"],
            }
        )
    return rows


def unmeasured(result: dict[str, Any]) -> list[dict[str, str]]:
    """What has no number, and why: balls of the same holes and reasons together."""
    groups: dict[tuple[str, str], list[str]] = {}
    for ball in result["balls"]:
        holes = [words for name, words in CORE if not is_known(ball[name])]
        if ball["present"] and not holes:
            continue
        what = ", ".join(holes) if ball["present"] else "everything"
        why = "; ".join(ball["reasons"]) or "no reason is given"
        groups.setdefault((what, why), []).append(ball["name"])
    rows = [{"where": listed(names), "what": what, "why": why} for (what, why), names in groups.items()]
    for check in result["checks"]:
        if not is_known(check["value_um"]):
            words = PART_WORDS.get(check["name"], check["name"])
            rows.append({"where": "the part", "what": words, "why": check["reason"] or _why(check["name"], result)})
    return rows


def _why(name: str, result: dict[str, Any]) -> str:
    if "coplanarity" in name:
        return "it takes three measured tops that are not in one line, around the centre of gravity, and a known board"
    if name == "pitch_um":
        return "a list of positions, or too few balls, has no pitch"
    if all(is_known(value) for value in result["board_coefficients_um"][1:]):
        return "it takes three measured balls"
    return "the board's shape is not known"


def light_rows(source: PageSource) -> list[dict[str, str]]:
    """One row per light: where the rig has it, where its shadows put it, how far that is."""
    rows = []
    is_fitted = is_known(source.result["shadow_residual_rms"])
    changes = source.result["light_change_deg"] if is_fitted else []
    for index, (x, y, z) in enumerate(source.result["light_directions"]):
        known = is_known(x) and is_known(y) and is_known(z)
        elevation = math.degrees(math.atan2(z, math.hypot(x, y))) if known else None
        lamp = source.lamps[index] if index < len(source.lamps) else None
        moved = changes[index] if index < len(changes) else None
        rows.append(
            {
                "index": str(index),
                "image": lamp.image if lamp else "",
                "azimuth": number(round(math.degrees(math.atan2(y, x)), 2) % 360.0 if known else None),
                "elevation": number(elevation),
                "raised": _signed(
                    elevation - lamp.elevation_deg if is_fitted and lamp and elevation is not None else None
                ),
                "moved": number(moved, 3),
                "strayed": "yes" if is_known(moved) and moved > MAX_LIGHT_CHANGE_DEG else "",
            }
        )
    return rows


def raised_together(source: PageSource) -> str:
    """By how much all lights were raised on average: what balls that are all flattened alike look like."""
    rows = source.result["light_directions"]
    if not is_known(source.result["shadow_residual_rms"]):
        return "not fitted: no shadow was measured"
    if len(rows) != len(source.lamps) or not all(is_known(value) for row in rows for value in row) or not rows:
        return "unknown: report.json is not beside the result"
    raised = [
        math.degrees(math.atan2(z, math.hypot(x, y))) - lamp.elevation_deg
        for (x, y, z), lamp in zip(rows, source.lamps, strict=True)
    ]
    mean = _signed(sum(raised) / len(raised))
    return f"{mean}° on average; U of the heights covers its uncertainty"


def _signed(value: float | None) -> str:
    return NOT_MEASURED if value is None else f"{round(value, 2) + 0.0:+.2f}"


def board_words(result: dict[str, Any]) -> str:
    """The board's fitted shape in words."""
    c = result["board_coefficients_um"]
    if not all(is_known(value) for value in c[1:3]):
        return "not measured"
    tilt_deg = math.degrees(math.atan(math.hypot(c[1], c[2])))
    bends = [value for value in c[3:] if is_known(value)]
    if not any(bends):
        return f"plane, tilted by {tilt_deg:.3f}° against the image"
    terms = ", ".join(f"{value:.3g}" for value in bends)
    return f"quadratic, tilted by {tilt_deg:.3f}° against the image; x², xy, y²: {terms} per µm"


def recipe_rows(recipe: dict[str, Any] | None) -> list[tuple[str, str]]:
    """What the recipe says, key and value, in the words of its own file."""
    rows: list[tuple[str, str]] = []
    for key, value in (recipe or {}).items():
        entries = value.items() if isinstance(value, dict) else [("", value)]
        prefix = "" if key == "layout" else key
        for name, entry in entries:
            if entry is None or entry == []:
                continue
            rows.append((".".join(part for part in (prefix, name) if part), _recipe_value(entry)))
    return rows


def _recipe_value(value: Any) -> str:  # noqa: ANN401 - whatever a recipe holds
    if isinstance(value, float):
        return f"{value:g}"
    if not isinstance(value, list | tuple):
        return str(value)
    if value and all(isinstance(entry, list | tuple) and entry for entry in value):
        return f"{len(value)} places: " + listed([str(entry[0]) for entry in value])
    parts = [_recipe_value(entry) for entry in value]
    is_range = len(value) == len(("lowest", "highest")) and not isinstance(value[0], str)
    return " to ".join(parts) if is_range else listed(parts)
