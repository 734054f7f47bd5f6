"""Measure bgars against its peers, side by side in one run, and print the ratios.

python benches/peers/compare.py [--quick] [--only normals|glossy|integrate|bilateral|read|write] [--json out.json]
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

from bilateral import MAPS
from machine import describe
from normal_fields import MASKS
from process import run_script
from table import group_lines, machine_line

GROUPS = ("normals", "glossy", "integrate", "bilateral", "read", "write")
THREADS = (1, 2)


class Task(NamedTuple):
    """One script in one process."""

    group: str
    script: str
    arguments: tuple[str, ...]
    threads: int = 1


def tasks(*, quick: bool) -> list[Task]:
    """Everything that is measured; `quick` leaves the large sizes out."""
    return [
        *_normals(quick=quick),
        *_glossy(quick=quick),
        *_integrate(quick=quick),
        *_bilateral(quick=quick),
        *_files(quick=quick),
        *_meshes(quick=quick),
    ]


def _normals(*, quick: bool) -> list[Task]:
    sizes = [("4", "2000", "2000")] if quick else [("4", "2000", "2000"), ("20", "4000", "5000")]
    found = [Task("normals", "normals.py", size, threads) for size in sizes for threads in THREADS]
    # The second side puts all images a power of two apart.
    found += [Task("normals", "pixel_types.py", (side,)) for side in (("512",) if quick else ("1500", "1536"))]
    return found + [Task("normals", "roofline.py", ("normals", *sizes[-1][1:]), threads) for threads in THREADS]


def _glossy(*, quick: bool) -> list[Task]:
    return [Task("glossy", "glossy.py", ("4" if quick else "10",), threads) for threads in THREADS]


def _integrate(*, quick: bool) -> list[Task]:
    largest = 1024 if quick else 4096
    found = [Task("integrate", "integrate.py", ("iterations", str(side)), 2) for side in _sides(512, largest)]
    for threads in THREADS:
        found += [Task("integrate", "integrate.py", ("dct", str(side)), threads) for side in _sides(1024, largest)]
    found += [Task("integrate", "integrate.py", ("cg", str(side))) for side in _sides(512, 512 if quick else 1024)]
    found += [Task("integrate", "integrate.py", ("amg", str(side))) for side in _sides(512, 512 if quick else 2048)]
    for side in (512, largest):
        found += [Task("integrate", "memory.py", (shape, str(side)), 2) for shape in MASKS]
    for shape in ("rectangle", "disc with holes"):
        # The script itself runs bgars in two processes, on one thread and on two.
        sides = _sides(512, 2048 if quick else 8192)
        found += [Task("integrate", "scaling.py", (shape, str(side))) for side in sides]
    side = str(1024 if quick else 4096)
    return found + [Task("integrate", "roofline.py", ("iteration", side), threads) for threads in THREADS]


def _bilateral(*, quick: bool) -> list[Task]:
    maps = ("diligent/cat",) if quick else MAPS
    return [Task("bilateral", "bilateral.py", (name,), threads) for name in maps for threads in THREADS]


def _files(*, quick: bool) -> list[Task]:
    size = ("2000", "2000") if quick else ("4000", "5000")
    return [Task("read", "files.py", (kind, *size), 2) for kind in ("png", "tiff")]


def _meshes(*, quick: bool) -> list[Task]:
    return [Task("write", "meshes.py", ("500" if quick else "1024",), 2)]


def _sides(first: int, last: int) -> list[int]:
    """Doubling sides."""
    return [first << step for step in range((last // first).bit_length())]


def measure(chosen: list[Task]) -> list[dict[str, Any]]:
    """Run the tasks one after the other; one that fails is a skipped row, and the others still run."""
    rows: list[dict[str, Any]] = []
    for number, task in enumerate(chosen, 1):
        words = " ".join(task.arguments)
        sys.stderr.write(f"[{number}/{len(chosen)}] {task.script} {words}, threads: {task.threads}\n")
        try:
            rows += run_script(task.script, list(task.arguments), task.threads)
        except subprocess.CalledProcessError as error:
            why = f"the script failed with status {error.returncode}, its message is above"
            rows.append({"kind": "skipped", "group": task.group, "what": f"{task.script} {words}", "why": why})
    return rows


def main() -> int:
    """Measure, print the tables, keep the rows; the exit status tells whether everything ran, not how fast."""
    parser = argparse.ArgumentParser(description="bgars against its peers, side by side in one run")
    parser.add_argument("--quick", action="store_true", help="small sizes only: does it all work? (some minutes)")
    parser.add_argument("--only", choices=GROUPS, help="one group of measurements")
    parser.add_argument("--json", type=Path, metavar="out.json", help="also write the rows to this file")
    options = parser.parse_args()
    chosen = [task for task in tasks(quick=options.quick) if options.only in {None, task.group}]
    rows, machine = measure(chosen), describe()
    if options.json is not None:
        record = {"machine": machine, "quick": options.quick, "rows": rows}
        options.json.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    print(machine_line(machine))
    for group in GROUPS:
        lines = group_lines(rows, group)
        if lines:
            print(f"\n{group}\n")
            print("\n".join(lines).rstrip())
    return int(any("the script failed" in row.get("why", "") for row in rows))


if __name__ == "__main__":
    sys.exit(main())
