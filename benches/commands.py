"""What whole commands cost: CPU seconds, wall seconds, peak memory, each in a process of its own.

python benches/commands.py [--label now] [--quick] [--only WORD] [--docs]

Parts are simulated once, into a folder that is kept (``--data``). Results go to benches/commands.json under the label;
``--docs`` writes the table of docs/performance.md, which sets "before" beside "now". An earlier state is measured
with ``PYTHONPATH=EARLIER/python`` and ``--label before``: the commands run in child processes, which inherit it.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple

import imageio.v3 as iio
import numpy as np

HERE = Path(__file__).parent
RESULTS = HERE / "commands.json"
PAGE = HERE.parent / "docs" / "performance.md"
START, END = "<!-- commands: make bench -->", "<!-- end of commands -->"
BGARS = [sys.executable, "-m", "bgars"]
PART = """
name = "part"
rows = {rows}
cols = {rows}
pitch_um = 1000.0
diameter_um = 600.0
height_um = 500.0
[limits]
true_position_um = 50.0
diameter_um = [560.0, 640.0]
height_um = [460.0, 540.0]
seating_coplanarity_um = 80.0
"""
SCENE = """
seed = {rows}
[scene]
kind = "ball_array"
rows = {rows}
cols = {rows}
seed = {rows}
jitter = {{ height_um = 8.0, radius_um = 3.0, position_um = 3.0 }}
board = {{ i_d = 0.12, texture = {{ contrast = 0.25 }} }}
[rig]
ring = {{ count = {lights}, elevation_deg = 45.0 }}
[material]
i_d = 0.5
i_s = 1.0
hardness = 40.0
[camera]
pixel_pitch_um = {pitch}
full_well_e = 35000.0
read_noise_levels = 0.05
"""


class Case(NamedTuple):
    """A command: its name in the table, its arguments (OUT is a fresh folder), the largest exit code that is right."""

    name: str
    arguments: list[str]
    worst_code: int = 0
    quick: bool = True


class Cost(NamedTuple):
    """Of one run: user and system time of the process and its children, and the most memory of any of them."""

    cpu_s: float
    wall_s: float
    peak_mb: float


def cost_of(arguments: list[str], worst_code: int) -> Cost | None:
    """Run a command; None where this state of the project does not have it."""
    start = time.perf_counter()
    process = subprocess.Popen(arguments, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    assert process.stderr is not None
    errors = process.stderr.read().decode()
    _, status, used = os.wait4(process.pid, 0)
    wall_s = time.perf_counter() - start
    code = process.returncode = os.waitstatus_to_exitcode(status)
    if code == 2 and "No such option" in errors:
        return None
    if not 0 <= code <= worst_code:
        raise SystemExit(f"{' '.join(arguments)}: exit code {code}\n{errors}")
    return Cost(used.ru_utime + used.ru_stime, wall_s, used.ru_maxrss / 1024)


def simulated(data: Path, rows: int, lights: int, pitch_um: float) -> Path:
    """A capture folder of so many rows of balls; made once."""
    folder = data / f"balls-{rows * rows}-lights-{lights}"
    if not folder.is_dir():
        recipe = data / f"{folder.name}.toml"
        recipe.write_text(SCENE.format(rows=rows, lights=lights, pitch=pitch_um), encoding="utf-8")
        subprocess.run([*BGARS, "simulate", str(recipe), "-o", str(folder)], check=True, stdout=subprocess.DEVNULL)
    (data / f"part-{rows * rows}.toml").write_text(PART.format(rows=rows), encoding="utf-8")
    return folder


def tiled(source: Path, megapixels: float) -> Path:
    """The images of a capture side by side, until they have so many pixels."""
    folder = source.with_name(f"{source.name}-{megapixels:g}-megapixels")
    if folder.is_dir():
        return folder
    folder.mkdir()
    for file in source.iterdir():
        if file.suffix == ".png" and file.name.startswith("light_"):
            image = iio.imread(file)
            side = int(np.sqrt(megapixels * 1e6))
            repeats = [-(-side // size) for size in image.shape[:2]]
            iio.imwrite(folder / file.name, np.tile(image, repeats)[:side, :side])
        elif file.suffix in {".txt", ".toml"}:
            shutil.copy(file, folder)
    return folder


def study_of(data: Path, parts: int, repeats: int) -> Path:
    """A study of several captures of 16 balls in folders part/repeat, each with noise of its own."""
    study = data / "study"
    for number in range(parts * repeats):
        place = study / f"part{number // repeats}" / f"repeat{number % repeats}"
        if not place.is_dir():
            recipe = data / "balls-16-lights-8.toml"
            command = [*BGARS, "simulate", str(recipe), "--seed", str(number), "-o", str(place)]
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return study


def cases(data: Path, quick: bool) -> list[Case]:
    """Every command of the table; parts that only long ones need are not made for a quick run."""
    small = simulated(data, 4, 8, 10.0)
    found = [
        Case("import bgars", [sys.executable, "-c", "import bgars"]),
        Case("bgars --help", [*BGARS, "--help"]),
        Case("bgars demo", [*BGARS, "demo", "-o", "OUT"]),
        Case("reconstruct, 0.2 megapixels, 8 lights", [*BGARS, "reconstruct", str(small), "-o", "OUT"]),
    ]
    found += _inspections(small, 16)
    hundred = simulated(data, 10, 8, 5.1)
    found.append(Case("reconstruct, 4 megapixels, 8 lights", [*BGARS, "reconstruct", str(hundred), "-o", "OUT"]))
    found += _inspections(hundred, 100)
    normals = small.with_name("normals")
    if not normals.is_dir():
        subprocess.run([*BGARS, "normals", str(hundred), "-o", str(normals)], check=True, stdout=subprocess.DEVNULL)
    mesh = [*BGARS, "mesh", str(normals / "normals.png"), "-o", "OUT.ply", "--pixel-pitch-um", "5.1"]
    found.append(Case("mesh, 4 megapixels", mesh))
    if quick:
        return found
    study = [*BGARS, "grr", str(study_of(data, 4, 3)), "-o", "OUT", "-r", str(data / "part-16.toml")]
    found.append(Case("grr, 12 captures of 16 balls", study, 1))
    many = simulated(data, 4, 24, 10.0)
    for source, lights in ((many, 24), (small, 8)):
        for megapixels in (4, 20) if lights > 8 else (20,):
            # Elsewhere: what this process holds would count as the least that any command needs.
            with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as elsewhere:
                folder = elsewhere.submit(tiled, source, megapixels).result()
            name = f"reconstruct, {megapixels} megapixels, {lights} lights, tiled"
            found.append(Case(name, [*BGARS, "reconstruct", str(folder), "-o", "OUT"]))
    return found + _inspections(simulated(data, 32, 8, 16.0), 1024)


def _inspections(folder: Path, balls: int) -> list[Case]:
    recipe = folder.with_name(f"part-{balls}.toml")
    whole = [*BGARS, "inspect", str(folder), "-o", "OUT", "-r", str(recipe)]
    bare = [*whole, "--no-pictures", "--no-report"]
    return [
        Case(f"inspect, {balls:,} balls", whole, 1),
        Case(f"inspect, {balls:,} balls, no pictures, no report", bare, 1),
    ]


def table(results: dict[str, dict[str, list[float] | None]]) -> list[str]:
    """Lines of Markdown: CPU, wall and memory, before and now."""
    lines = [
        "| command | CPU before (s) | now (s) | wall before (s) | now (s) | peak before (MB) | now (MB) |",
        "| --- | ---: | ---: | ---: | ---: | ---: | ---: |",
    ]
    before, now = results.get("before", {}), results.get("now", {})
    for name in now | before:
        cells = [(before.get(name), now.get(name)), ("{:.2f}", "{:.2f}", "{:.0f}")]
        texts = [
            form.format(each[at]) if each else "-"
            for at, form in enumerate(cells[1])
            for each in cells[0]
        ]  # fmt: skip
        lines.append(f"| {name} | {' | '.join(texts)} |")
    return lines


def main() -> None:
    """Measure, keep, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--label", choices=("before", "now"), default="now")
    parser.add_argument("--quick", action="store_true", help="leave out what takes more than a minute")
    parser.add_argument("--only", default="", help="commands whose name holds this word")
    parser.add_argument("--data", type=Path, default=Path(tempfile.gettempdir()) / "bgars-bench")
    parser.add_argument("--docs", action="store_true", help="write the table of docs/performance.md")
    options = parser.parse_args()
    options.data.mkdir(exist_ok=True)
    results = json.loads(RESULTS.read_text(encoding="utf-8")) if RESULTS.is_file() else {}
    kept = results.setdefault(options.label, {})
    for case in cases(options.data, options.quick):
        if options.only not in case.name:
            continue
        with tempfile.TemporaryDirectory() as folder:
            arguments = [part.replace("OUT", f"{folder}/out") for part in case.arguments]
            cost = cost_of(arguments, case.worst_code)
        kept[case.name] = None if cost is None else [round(value, 2) for value in cost]
        print(f"{options.label}  {case.name}: {'-' if cost is None else cost}", flush=True)
        RESULTS.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    lines = "\n".join(table(results))
    print(lines)
    if options.docs:
        text = PAGE.read_text(encoding="utf-8")
        head, _, rest = text.partition(START)
        _, _, tail = rest.partition(END)
        PAGE.write_text(f"{head}{START}\n\n{lines}\n\n{END}{tail}", encoding="utf-8")


if __name__ == "__main__":
    main()
