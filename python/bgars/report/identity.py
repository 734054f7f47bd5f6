"""Which part it is, in the words of a page and of a picture."""

from __future__ import annotations

from pathlib import Path
from typing import Any

__all__ = ["identity_facts", "identity_line"]

TITLES = (
    ("serial", "serial number"),
    ("round", "round"),
    ("lot", "lot"),
    ("substrate", "substrate"),
    ("position", "position"),
    ("station", "station"),
    ("operator", "operator"),
    ("captured_utc", "images written"),
    ("inspected_utc", "inspected"),
    ("capture", "capture"),
    ("recipe", "recipe"),
    ("version", "bgars"),
)
MOST_CHARACTERS = 180


def identity_facts(result: dict[str, Any]) -> list[tuple[str, str]]:
    """Return name and value of what is known of a part's identity; `result` as in result.json."""
    recipe = result["recipe"] or {}
    file = Path(recipe["file"]).name if recipe.get("file") else ""
    values = {**result, **result.get("identity", {}), "recipe": file or recipe.get("name", "")}
    return [(title, str(values[name])) for name, title in TITLES if values.get(name)]


def identity_line(result: dict[str, Any]) -> str:
    """Return the same as one line."""
    line = " · ".join(f"{title} {value}" for title, value in identity_facts(result))
    return line if len(line) <= MOST_CHARACTERS else f"{line[: MOST_CHARACTERS - 3]}..."
