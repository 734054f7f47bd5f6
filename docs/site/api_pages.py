"""The API reference: a page for each group of public names, as ``python/bgars/__init__.pyi`` lists them."""

from __future__ import annotations

import inspect
import re
from pathlib import Path
from typing import NamedTuple

import bgars

ROOT = Path(__file__).parents[2]
LINE = re.compile(r"^from \.([\w.]+) import (\w+) as \2$", re.MULTILINE)
STUB = (ROOT / "python" / "bgars" / "__init__.pyi").read_text(encoding="utf-8")
PUBLIC = {name: module for module, name in LINE.findall(STUB) if not name.startswith("_")}


class Group(NamedTuple):
    """A page: its title, what it is for, and the modules whose public names it shows."""

    title: str
    purpose: str
    modules: tuple[str, ...]


GROUPS = {
    "pipelines": Group(
        "Reconstruct and inspect",
        "From a capture to normals, heights, a mesh, and a verdict on every ball.",
        ("pipelines", "normals", "surface", "balls"),
    ),
    "files": Group("Read and write", "Files in and out; every reader says what it assumed.", ("io", "samples")),
    "records": Group(
        "Records",
        "What flows from step to step: frozen dataclasses, units in the names of their fields. In a notebook they "
        "show themselves as a table and a thumbnail; `plot()` draws them.",
        ("records",),
    ),
    "simulate": Group(
        "Simulate", "Photographs of parts that do not exist, with exact truth.", ("simulate", "pipelines.scene_recipes")
    ),
    "station": Group("Calibrate a station", "What all captures of a set-up share, measured once.", ("station",)),
    "line": Group(
        "Lines, stores, studies", "Many parts: batches, results, gauge studies, charts.", ("line", "store", "studies")
    ),
    "report": Group("Pages and pictures", "What people look at.", ("report",)),
    "errors": Group("Errors", "Bad input raises one of these, with one message that says what to do.", ("errors",)),
}


def group_of(module: str) -> str | None:
    """Page of the public names of a module: the longest prefix wins; None where no group wants it."""
    prefixes = {prefix: page for page, group in GROUPS.items() for prefix in group.modules}
    known = [prefix for prefix in prefixes if f"{module}.".startswith(f"{prefix}.")]
    return prefixes[max(known, key=len)] if known else None


def api_pages() -> dict[str, str]:
    """Markdown of the pages by their paths in the site.

    Raises
    ------
    ValueError
        A public name that no group shows.
    """
    names: dict[str, list[str]] = {page: [] for page in GROUPS}
    for name, module in PUBLIC.items():
        page = group_of(module)
        if page is None and module != "version":
            msg = f"docs/site/api_pages.py: no group of GROUPS shows bgars.{name} ({module})"
            raise ValueError(msg)
        if page is not None:
            names[page].append(name)
    pages = {f"api/{page}.md": _page(GROUPS[page], names[page]) for page in GROUPS}
    pages["api/index.md"] = _index(names)
    return pages


def _page(group: Group, names: list[str]) -> str:
    return "\n\n".join([f"# {group.title}", group.purpose, *(f"::: bgars.{name}" for name in names)])


def _index(names: dict[str, list[str]]) -> str:
    text = [
        "# API reference",
        f"All {len(PUBLIC)} public names of `import bgars`; each is loaded when it is first used.",
    ]
    for page, group in GROUPS.items():
        rows = [f"| [`{name}`][bgars.{name}] | {_summary(name)} |" for name in names[page]]
        text += [
            f"## [{group.title}]({page}.md)",
            group.purpose,
            "\n".join(["| name | what |", "| --- | --- |", *rows]),
        ]
    return "\n\n".join(text)


def _summary(name: str) -> str:
    """First paragraph of the docstring; links are for the page itself."""
    text = (inspect.getdoc(getattr(bgars, name)) or "").split("\n\n")[0].replace("\n", " ")
    return re.sub(r":\w+:`~?([\w.]+)`", r"`\1`", text).replace("``", "`").replace("|", "\\|")
