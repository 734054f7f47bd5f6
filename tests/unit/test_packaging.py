"""What is packaged elsewhere asks for what pyproject.toml asks for."""

from __future__ import annotations

import re
import sys
from pathlib import Path

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
RECIPE = (ROOT / "packaging" / "conda" / "recipe.yaml").read_text(encoding="utf-8")


def test_the_conda_recipe_asks_for_the_same_packages() -> None:
    texts = [*PROJECT["dependencies"], *PROJECT["optional-dependencies"]["report"]]
    wanted = {text.partition(";")[0].strip() for text in texts}
    run = RECIPE.partition("\n  run:\n")[2].partition("\ntests:")[0]
    listed = {f"{name}{limit}" for name, limit in re.findall(r"(?:- |then: )([\w-]+) (>=[\d.]+)$", run, re.MULTILINE)}
    assert {text.replace("matplotlib-base", "matplotlib") for text in listed} == wanted


def test_the_conda_recipe_has_the_version_of_the_package() -> None:
    version = re.search(r'(?m)^version = "([^"]+)"', (ROOT / "Cargo.toml").read_text(encoding="utf-8"))
    assert version is not None
    assert f'version: "{version[1]}"' in RECIPE
    assert f'python_min: "{PROJECT["requires-python"].removeprefix(">=")}"' in RECIPE
