"""Code that people read runs: the README, the quick start, every docstring."""

from __future__ import annotations

import doctest
import importlib
import pkgutil
import re
import runpy
from pathlib import Path

import bgars
import pytest

ROOT = Path(__file__).parents[2]
MODULES = [name for _, name, _ in pkgutil.walk_packages(bgars.__path__, "bgars.") if not name.endswith("__main__")]


def test_the_readme_example_is_the_quick_start() -> None:
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    assert blocks == [(ROOT / "examples" / "quickstart.py").read_text(encoding="utf-8")]


def test_the_quick_start_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(ROOT / "examples" / "quickstart.py"))
    assert {path.suffix for path in tmp_path.iterdir()} >= {".ply"}


@pytest.mark.parametrize("name", MODULES)
def test_docstrings(name: str) -> None:
    assert doctest.testmod(importlib.import_module(name)).failed == 0


def test_the_module_is_an_optimised_build() -> None:
    assert not bgars._bgars.DEBUG_BUILD
