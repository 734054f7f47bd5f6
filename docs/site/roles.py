"""Docstrings name functions as Sphinx does, ``:func:`bgars.inspect` ``; the site makes links of those that it has."""

from __future__ import annotations

import re
from typing import Any

import griffe
from api_pages import PUBLIC

PAGE = re.compile(r"\bdocs/(\w+)\.md\b")
ROLE = re.compile(r":(?:class|func|meth|attr|mod|data):`~?([\w.]+)`")


class Roles(griffe.Extension):
    """Replace the roles before docstrings are parsed."""

    def on_object(self, *, obj: griffe.Object, **_: Any) -> None:  # noqa: ANN401 - griffe's own call
        """Link public names, leave the others as code."""
        if obj.docstring is not None:
            text = ROLE.sub(_link, obj.docstring.value)
            obj.docstring.value = PAGE.sub(r"[\1](../\1.md)", text)


def _link(role: re.Match[str]) -> str:
    parts = role[1].removeprefix("bgars.").split(".")
    shown = role[1] if parts[-1] in PUBLIC else ".".join(parts)
    known = next((name for name in (parts[-1], parts[0]) if name in PUBLIC), None)
    return f"[`{shown}`][bgars.{known}]" if known else f"`{shown}`"
