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


def test_the_readme_shows_the_examples() -> None:
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    examples = [ROOT / "examples" / name for name in ("inspect_part.py", "quickstart.py")]
    assert blocks == [example.read_text(encoding="utf-8") for example in examples]


def test_after_the_demo_the_shell_is_told_where_bgars_is() -> None:
    block = re.findall(r"```sh\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL)[0]
    assert [line.split("  ")[0] for line in block.splitlines()[:2]] == ["make demo", ". .venv/bin/activate"]


def test_the_quick_start_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(ROOT / "examples" / "quickstart.py"))
    assert {path.suffix for path in tmp_path.iterdir()} >= {".ply"}


def test_the_inspection_example_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    setup = bgars.read_scene("defects-5x5")
    capture, truth = bgars.simulate(setup.scene, setup.rig, setup.material, setup.camera, seed=setup.seed)
    bgars.write_simulation(capture, truth, tmp_path / "part")
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(ROOT / "examples" / "inspect_part.py"))
    assert capsys.readouterr().out.startswith("fail")


@pytest.mark.parametrize("name", MODULES)
def test_docstrings(name: str) -> None:
    assert doctest.testmod(importlib.import_module(name)).failed == 0


def test_the_module_is_an_optimised_build() -> None:
    assert not bgars._bgars.DEBUG_BUILD
