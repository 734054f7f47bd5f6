"""The data flows one way in the Rust core, too, and no files of a folder name each other in a circle."""

from __future__ import annotations

import re
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[2] / "rust" / "bgars-core" / "src"
ORDER = [
    "error",
    "pixel",
    "median",
    "components",
    "lights",
    "stack",
    "radiometry",
    "readings",
    "normals",
    "reflectance",
    "blind",
]
"""Each may name those before it; what is not here stands by itself on the first eight."""
INPUTS = 8
NAMES = {
    "Error": "error",
    "Result": "error",
    "Pixel": "pixel",
    "Lights": "lights",
    "ImageStack": "stack",
    "Radiometry": "radiometry",
}
BESIDE = {"io": {"mesh"}, "vertex_normals": {"io"}}
"""What else stands above the inputs."""


def code(path: Path) -> str:
    """A file without comments and unit tests."""
    text = re.sub(r"//[^\n]*", "", path.read_text(encoding="utf-8"))
    return text.split("#[cfg(test)]\nmod tests")[0]


def named(text: str, root: str) -> set[str]:
    """Words that follow `root::`, in braces, too."""
    found = set(re.findall(rf"\b{root}::(\w+)", text))
    for group in re.findall(rf"\b{root}::\{{((?:[^{{}}]|\{{[^{{}}]*\}})*)\}}", text):
        flat = re.sub(r"\{[^{}]*\}", "", group)
        found |= {word.strip().split("::")[0].split(" ")[0] for word in flat.split(",") if word.strip()}
    return found


MODULES = sorted({path.stem for path in SOURCE.iterdir()} - {"lib"})


@pytest.mark.parametrize("module", MODULES)
def test_a_module_names_earlier_ones_alone(module: str) -> None:
    place = SOURCE / module
    files = sorted(place.rglob("*.rs")) if place.is_dir() else [place.with_suffix(".rs")]
    found = {NAMES.get(name, name) for path in files for name in named(code(path), "crate")} - {module}
    allowed = ORDER[: ORDER.index(module)] if module in ORDER else ORDER[:INPUTS]
    assert found <= {*allowed, *BESIDE.get(module, ())}


@pytest.mark.parametrize(
    "folder",
    sorted(str(place.relative_to(SOURCE)) for place in SOURCE.rglob("*") if place.is_dir()),
)
def test_no_files_of_a_folder_go_in_a_circle(folder: str) -> None:
    files = {path.stem: path for path in (SOURCE / folder).glob("*.rs") if path.stem != "mod"}
    graph = {stem: named(code(path), "super") & files.keys() - {stem} for stem, path in files.items()}
    assert len(list(TopologicalSorter(graph).static_order())) == len(files)
