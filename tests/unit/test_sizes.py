"""One idea a file, and functions that fit on a screen."""

from __future__ import annotations

import ast
from pathlib import Path

import bgars

PACKAGE = Path(bgars.__file__).parent
MOST_LINES = 350
MOST_LINES_OF_A_FUNCTION = 80
"""Without the list of its arguments and its docstring, which grow with what a user is told."""


def test_files_and_functions_are_short() -> None:
    long: list[str] = []
    for path in sorted(PACKAGE.rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        lines = len(text.splitlines())
        long += [f"{path.relative_to(PACKAGE)}: {lines} lines"] if lines > MOST_LINES else []
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                start = node.body[1 if ast.get_docstring(node) and len(node.body) > 1 else 0].lineno
                lines = (node.end_lineno or start) - start + 1
                long += [f"{path.name}: {node.name}: {lines} lines"] if lines > MOST_LINES_OF_A_FUNCTION else []
    assert not long, "\n".join(long)
