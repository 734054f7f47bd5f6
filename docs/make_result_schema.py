"""Rewrite docs/result.schema.json, the JSON Schema of result.json, from its model: ``make schema``."""

from __future__ import annotations

import json
from pathlib import Path

from bgars.io.result_schema import result_schema

PAGE = Path(__file__).parent / "result.schema.json"


def schema_text() -> str:
    """Return the schema as the file holds it."""
    return json.dumps(result_schema(), indent=2, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    PAGE.write_text(schema_text(), encoding="utf-8")
