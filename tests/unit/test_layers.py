"""The data flows one way: no folder imports one beside it or a later one."""

from __future__ import annotations

import ast
from pathlib import Path

import bgars
import pytest

PACKAGE = Path(bgars.__file__).parent
LAYERS = (
    ("errors", "extras", "version", "samples", "_bgars"),
    ("files",),
    ("records",),
    ("io", "checks", "station", "normals", "surface", "balls", "inspection", "simulate"),
    ("pipelines",),
    ("report", "store"),
    ("studies", "line"),
    ("cli",),
)
LEVEL = {folder: level for level, folders in enumerate(LAYERS) for folder in folders}


def imports(path: Path) -> set[str]:
    """Folders of the package that a file imports, also inside functions and for types."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module == "bgars":
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("bgars."):
            found.add(str(node.module).split(".")[1])
        elif isinstance(node, ast.Import):
            found |= {name.name.split(".")[1] for name in node.names if name.name.startswith("bgars.")}
    return found


def test_at_the_top_stand_folders() -> None:
    files = {path.stem for path in PACKAGE.glob("*.py")} - {"__init__", "__main__"}
    folders = {path.parent.name for path in PACKAGE.glob("*/__init__.py")}
    assert files == {"errors", "extras", "version"}
    assert files | folders | {"_bgars"} == set(LEVEL)


@pytest.mark.parametrize("path", sorted(PACKAGE.rglob("*.py")), ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_point_backward(path: Path) -> None:
    own = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
    if own not in {"__init__", "__main__"}:
        wrong = {other for other in imports(path) - {own} if LEVEL[other] >= LEVEL[own]}
        assert not wrong, f"{own} must not import {', '.join(sorted(wrong))}"
