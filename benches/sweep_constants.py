"""Find the constants of balls/ and inspection/ that a pinned reading holds, and enter them into docs/constants.tsv.

``BGARS_DATA=... python benches/sweep_constants.py [NAME ...]``: for each constant without a test, a process of its own
inspects the dozen rendered parts of ``tests/unit/test_reality_scenes.py`` with the constant multiplied, until a reading
differs from ``tests/unit/pinned_readings.json``. By default all constants that are no numerics; about 15 s each where
nothing moves.
"""

from __future__ import annotations

import argparse
import csv
import json
import multiprocessing
import os
import runpy
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np  # noqa: F401 - loaded once, for all processes
from move_constants import ROOT, MovedFinder

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

sys.path[:0] = [str(ROOT / "tests" / "unit"), str(ROOT / "benches" / "reality")]

TEST = "test_reality_scenes.py::test_readings_of_the_dozen_are_those_on_record"
FACTORS = (1.5, 0.5)
LIMIT_S = 300
"""Longest that a part may take: a moved constant may make a loop endless."""
REGISTRY = ROOT / "docs" / "constants.tsv"


def moves(name: str, factor: float, parts: list[str]) -> str:
    """First of the parts that reads otherwise, in a process of its own; empty where none does."""
    context = multiprocessing.get_context("fork")
    receiver, sender = context.Pipe(duplex=False)
    child = context.Process(target=_child, args=(name, factor, parts, sender))
    child.start()
    sender.close()
    try:
        # A moved constant may end a part in an error, or never.
        return str(receiver.recv()) if receiver.poll(LIMIT_S) else "without an end"
    except EOFError:
        return "with an error"
    finally:
        child.kill()
        child.join()


def _child(name: str, factor: float, parts: list[str], sender: Connection) -> None:
    finder = MovedFinder(name, factor)
    assert finder.module not in sys.modules, "imported before it could be moved"
    sys.meta_path.insert(0, finder)
    from judge_scene import judge_scene  # noqa: PLC0415 - the package is imported with the constant moved
    from pinned import PINNED, differences, pin_of  # noqa: PLC0415

    pinned = json.loads(PINNED.read_text(encoding="utf-8"))
    for part in parts:
        record = judge_scene(Path(os.environ["BGARS_DATA"]) / "reality" / part, normals=False)
        if differences(pin_of(record), pinned[part]):
            sender.send(part)
            return
    sender.send("")


def main() -> None:
    """Sweep, with a line per constant, and write the registry after each that was found."""
    parser = argparse.ArgumentParser(description="Enter the constants that pinned readings hold into the registry.")
    parser.add_argument("names", nargs="*", help="folder.module.NAME; by default all without a test but numerics")
    parser.add_argument("--parts", nargs="*", default=[str(seed) for seed in (6, 9, 2, 8, 5, 1, 11, 4, 7, 12, 3, 10)])
    options = parser.parse_args()
    registry = runpy.run_path(str(ROOT / "docs" / "make_constants.py"))["registry"]()
    names = options.names or [
        f"{module}.{name}" for (module, name), entry in registry.items() if not entry.test and entry.kind != "numerics"
    ]
    for count, name in enumerate(names, 1):
        for factor in FACTORS:
            part = moves(name, factor, options.parts)
            if part:
                _enter(name, f"{TEST} x{factor:g}")
                break
        print(f"{count} of {len(names)}: {name} {f'x{factor:g}: part {part}' if part else 'moves nothing'}", flush=True)


def _enter(name: str, test: str) -> None:
    module, _, constant = name.rpartition(".")
    with REGISTRY.open(encoding="utf-8", newline="") as file:
        rows = list(csv.reader(file, delimiter="\t", quoting=csv.QUOTE_NONE))
    for row in rows:
        if row[:2] == [module, constant]:
            row[4] = test
    REGISTRY.write_text("".join("\t".join(row) + "\n" for row in rows), encoding="utf-8")


if __name__ == "__main__":
    main()
