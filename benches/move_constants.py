"""Run tests with one constant of balls/ or inspection/ multiplied, and print which fail.

``python benches/move_constants.py inspection.priors.ROUND --factor 1.5 [TESTS ...]``: the tests run in a process of
their own, where the module is compiled with ``ROUND = moved(ROUND, 1.5)`` below its assignment: what is derived from
the constant, imported from the module or a default argument moves too. The package and its bytecode stay as they are.
"""

from __future__ import annotations

import argparse
import ast
import importlib.util
import os
import re
import subprocess
import sys
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence
    from types import CodeType, ModuleType

ROOT = Path(__file__).resolve().parent.parent
VARIABLE = "BGARS_MOVE"
TESTS = {
    "balls": ("find_balls", "find_places", "find_metal", "registration"),
    "inspection": ("measure_balls", "inspect_parts", "inspection_doubts", "judge"),
}
"""Of tests/unit, what is run for a module of each folder where no tests are named."""
FAILED = re.compile(r"^(?:FAILED|ERROR) (\S+)", re.MULTILINE)


def moved(value: object, factor: float) -> object:
    """`value` times `factor`; whole numbers stay so and change by one at least, shares of mixtures stay."""
    if isinstance(value, tuple):
        parts = [moved(part, factor) for part in value]
        return value._replace(narrow=parts[0], wide=parts[1]) if hasattr(value, "_replace") else tuple(parts)
    if isinstance(value, int):
        least = int(np.sign(factor - 1.0))
        return value + (round(value * (factor - 1.0)) or least)
    return value * factor if isinstance(value, float) else np.asarray(value) * factor


class MovedLoader(SourceFileLoader):
    """Compiles a module with one constant moved."""

    constant = ""
    factor = 1.0

    def get_code(self, fullname: str) -> CodeType:
        """Compile the source, never the cache."""
        tree = ast.parse(Path(self.path).read_bytes(), self.path)
        places = [index for index, statement in enumerate(tree.body) if self.constant in _assigned(statement)]
        if len(places) != 1:
            msg = f"{fullname} has no constant {self.constant}"
            raise ImportError(msg)
        move = f"from move_constants import moved as __moved\n{self.constant} = __moved({self.constant}, {self.factor})"
        tree.body[places[0] + 1 : places[0] + 1] = ast.parse(move).body
        code: CodeType = compile(tree, self.path, "exec")
        return code


class MovedFinder:
    """Finds the module named in `VARIABLE`, for `MovedLoader`."""

    def __init__(self, name: str, factor: float) -> None:
        self.module, _, self.constant = f"bgars.{name}".rpartition(".")
        self.factor = factor

    def find_spec(
        self, fullname: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return the spec of the module; others are found as ever."""
        spec = PathFinder.find_spec(fullname, path, target) if fullname == self.module else None
        if spec is None or spec.origin is None:
            return None
        loader = MovedLoader(fullname, spec.origin)
        loader.constant, loader.factor = self.constant, self.factor
        return importlib.util.spec_from_file_location(fullname, spec.origin, loader=loader)


def install() -> None:
    """Move the constant in this process."""
    name, factor = os.environ[VARIABLE].split("=")
    finder = MovedFinder(name, float(factor))
    assert finder.module not in sys.modules, "imported before it could be moved"
    sys.meta_path.insert(0, finder)


def pytest_unconfigure() -> None:
    """Say it where no test imported the module."""
    module, _, _ = f"bgars.{os.environ[VARIABLE].split('=')[0]}".rpartition(".")
    if module not in sys.modules:
        print(f"\nERROR {module} was not imported by any test")


def failing(name: str, factor: float, tests: Sequence[str], first: bool = False) -> list[str]:
    """Ids of the tests that fail with the constant `name` (``folder.module.NAME``) times `factor`."""
    folder = name.partition(".")[0]
    chosen = list(tests) or [f"tests/unit/test_{stem}.py" for stem in TESTS[folder]]
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "move_constants", "--tb=no"]
    environment = {
        **os.environ,
        VARIABLE: f"{name}={factor}",
        "PYTHONPATH": os.pathsep.join([str(ROOT / "benches"), os.environ.get("PYTHONPATH", "")]),
        "OMP_NUM_THREADS": "1",
    }
    command += ["-x"] if first else []
    done = subprocess.run([*command, *chosen], cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    if done.returncode not in {0, 1}:
        sys.exit(done.stdout + done.stderr)
    return FAILED.findall(done.stdout)


def _assigned(statement: ast.stmt) -> list[str]:
    """Names that a statement assigns."""
    if not isinstance(statement, ast.Assign):
        return []
    return [node.id for target in statement.targets for node in ast.walk(target) if isinstance(node, ast.Name)]


def main() -> None:
    """Run the tests and print those that fail."""
    parser = argparse.ArgumentParser(description="Print the tests that fail when a constant moves.")
    parser.add_argument("name", help="folder.module.NAME, as inspection.priors.ROUND")
    parser.add_argument("--factor", type=float, default=1.5)
    parser.add_argument("--first", action="store_true", help="stop at the first test that fails")
    parser.add_argument("tests", nargs="*", help="files or ids; by default a fast set for the folder")
    options = parser.parse_intermixed_args()
    failed = failing(options.name, options.factor, options.tests, options.first)
    print("\n".join(failed) if failed else "none fails")


if __name__ == "__main__":
    main()
elif VARIABLE in os.environ:
    # As a plugin of pytest: before its conftest imports the package.
    install()
