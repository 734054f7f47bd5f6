"""Rewrite docs/constants.md, the registry of the constants of balls/ and inspection/: ``make constants``.

Values and meanings are read from the sources, kinds, reasons and tests from ``docs/constants.tsv``. A constant is a
name in capitals at the top level of a module whose value is made of numbers; names of positions (``range``), of other
constants alone, and texts are none.
"""

from __future__ import annotations

import ast
import csv
import sys
from collections import Counter
from pathlib import Path
from typing import NamedTuple

DOCS = Path(__file__).resolve().parent
PAGE = DOCS / "constants.md"
REGISTRY = DOCS / "constants.tsv"
PACKAGE = DOCS.parent / "python" / "bgars"
FOLDERS = ("balls", "inspection")
COLUMNS = ("module", "name", "kind", "chosen_by", "test")
KINDS = {
    "error model": "a standard deviation, a prior or a share that enters an uncertainty",
    "physics or geometry": "what light, balls, lenses or pixels are",
    "numerics": "tolerances, rounds, ridges, floors, sizes of grids and samples, numbers of terms, identities",
    "decision": "a threshold that accepts, refuses or names something",
    "tuned": "chosen on scenes",
}
CALLS = {"Mixture", "float", "len", "range"}
"""What a value may call, beside functions of numpy and math."""


class Constant(NamedTuple):
    """One constant as the sources have it; `module` is ``folder.file``."""

    module: str
    name: str
    value: str
    meaning: str


class Entry(NamedTuple):
    """One line of the registry."""

    kind: str
    chosen_by: str
    test: str


def constants() -> list[Constant]:
    """Every constant of `FOLDERS`, in the order of the sources."""
    paths = [path for folder in FOLDERS for path in sorted((PACKAGE / folder).glob("*.py"))]
    return [constant for path in paths for constant in _of_module(path)]


def registry() -> dict[tuple[str, str], Entry]:
    """Kind, reason and test of each (module, name)."""
    with REGISTRY.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file, delimiter="\t", quoting=csv.QUOTE_NONE))
    return {(row["module"], row["name"]): Entry(row["kind"], row["chosen_by"], row["test"]) for row in rows}


def mismatch() -> list[str]:
    """What the registry and the sources disagree in, in words."""
    names = [(constant.module, constant.name) for constant in constants()]
    known = registry()
    missing = [f"{module}.{name}: not in {REGISTRY.name}" for module, name in names if (module, name) not in known]
    stale = [f"{module}.{name}: no such constant" for module, name in known.keys() - set(names)]
    wrong = [f"{m}.{n}: kind {entry.kind!r}" for (m, n), entry in known.items() if entry.kind not in KINDS]
    return missing + sorted(stale) + wrong


def unused() -> list[str]:
    """Constants that no line of the package reads, in words."""
    read: set[tuple[str, str]] = set()
    for path in PACKAGE.rglob("*.py"):
        module = f"{path.parent.name}.{path.stem}"
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load):
                read.add((module, node.id))
            if isinstance(node, ast.ImportFrom) and node.module:
                read |= {(".".join(node.module.split(".")[-2:]), alias.name) for alias in node.names}
    return [f"{module}.{name}" for module, name, *_ in constants() if (module, name) not in read]


def page_text() -> str:
    """Return the page as the file holds it."""
    known = registry()
    found = constants()
    count = Counter(known[constant.module, constant.name].kind for constant in found)
    lines = [
        "# Constants",
        "",
        f"The {len(found)} constants of `balls/` and `inspection/`. `make constants` writes this page: value and",
        "meaning from the sources, the rest from [constants.tsv](constants.tsv). The test is one that fails when the",
        "constant is multiplied by the factor behind it (`benches/move_constants.py`); an empty cell: none is known.",
        "",
        "| kind | constants | what it is |",
        "|---|---|---|",
        *(f"| {kind} | {count[kind]} | {words} |" for kind, words in KINDS.items()),
    ]
    for module in dict.fromkeys(constant.module for constant in found):
        lines += ["", f"## {module}", "", "| name | value | meaning | kind | chosen by | test that moves |"]
        lines.append("|---|---|---|---|---|---|")
        for constant in found:
            if constant.module == module:
                kind, chosen_by, test = known[module, constant.name]
                cells = (f"`{constant.name}`", f"`{constant.value}`", constant.meaning, kind, chosen_by, test)
                lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return "\n".join(lines) + "\n"


def _of_module(path: Path) -> list[Constant]:
    """Constants of one file."""
    source = path.read_text(encoding="utf-8")
    body = ast.parse(source).body
    lines = source.splitlines()
    found = []
    for statement, after in zip(body, [*body[1:], None], strict=True):
        if isinstance(statement, ast.Assign) and len(statement.targets) == 1:
            meaning = _docstring(after) or _comment(lines, statement)
            pairs = _pairs(statement.targets[0], statement.value)
            found += [
                Constant(f"{path.parent.name}.{path.stem}", name, ast.unparse(value), meaning)
                for name, value in pairs
                if name.isupper() and _is_number(value)
            ]
    return found


def _pairs(target: ast.expr, value: ast.expr) -> list[tuple[str, ast.expr]]:
    """Names and values of an assignment; several on one line one by one."""
    if isinstance(target, ast.Name):
        return [(target.id, value)]
    if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
        return [pair for one, part in zip(target.elts, value.elts, strict=True) for pair in _pairs(one, part)]
    return []


def _is_number(value: ast.expr) -> bool:
    """Whether a value is made of numbers: literals at least once, constants, and functions of them."""
    literal = False
    for node in ast.walk(value):
        if isinstance(node, ast.Constant):
            if isinstance(node.value, bool) or not isinstance(node.value, (int, float)):
                return False
            literal = True
        if isinstance(node, ast.Call):
            function = ast.unparse(node.func)
            if function not in CALLS and not function.startswith(("np.", "math.")):
                return False
        if isinstance(node, (ast.Dict, ast.Subscript, ast.JoinedStr)):
            return False
    return literal


def _docstring(statement: ast.stmt | None) -> str:
    """Return the text of a bare string, in one line."""
    if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant):
        text = statement.value.value
        return " ".join(text.split()) if isinstance(text, str) else ""
    return ""


def _comment(lines: list[str], statement: ast.stmt) -> str:
    """Return the comment at the end of a statement's line."""
    rest = lines[(statement.end_lineno or 1) - 1].encode()[statement.end_col_offset or 0 :].decode().strip()
    text = rest.removeprefix("#").strip() if rest.startswith("#") else ""
    return "" if text.startswith("noqa") else text


if __name__ == "__main__":
    if problems := mismatch():
        sys.exit("\n".join(problems))
    PAGE.write_text(page_text(), encoding="utf-8")
