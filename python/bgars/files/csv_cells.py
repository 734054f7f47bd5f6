"""Text in CSV files that spreadsheets must not run."""

from __future__ import annotations

__all__ = ["harmless"]

STARTS_FORMULA = ("=", "+", "-", "@", "\t", "\r")


def harmless(text: str) -> str:
    """Return a cell of text; where a spreadsheet would take it for a formula, an apostrophe comes first (OWASP).

    >>> harmless("A1"), harmless("=1+2")
    ('A1', "'=1+2")
    """
    return f"'{text}" if text.startswith(STARTS_FORMULA) else text
