"""A simulated station before `bgars watch`: latency and memory over many small parts (`make watch-station`).

The watch is the command itself, in a process of its own. One part after the other is dropped as a camera's software
does it, the trigger last; the time that counts is from the trigger to the line that a PLC gets over TCP.

    python benches/watch_station.py --docs                     # 1,000 parts inspected, 5,000 answered at once
    python benches/watch_station.py --parts 50 --instant 0     # a look at it
"""

from __future__ import annotations

import argparse
import json
import os
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import bgars
import imageio.v3 as iio
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "line.md"
BEGIN, END = "<!-- station: begin -->", "<!-- station: end -->"
LIGHTS, SIDE_PX, PIXEL_UM = 8, 64, 20.0
DIFFERENT = 20
"""Captures that are simulated; parts repeat them under new serial numbers."""
LOOK_EVERY = 50
LONGEST_S = 300.0
RIG = f"pixel_pitch_um = {PIXEL_UM}\n[lights]\nring = {{ count = {LIGHTS}, elevation_deg = 45.0 }}\n"


@dataclass
class Run:
    """What was measured of one process.

    Attributes
    ----------
    name : str
    latencies_s : list of float
        From the trigger to the line, by part.
    memory_mb : list of (int, float)
        Parts done, and resident memory then.
    cpu_s : float
        Of the process, from the first part to the last.
    load : float
        Of the machine, when it ended.
    """

    name: str
    latencies_s: list[float] = field(default_factory=list)
    memory_mb: list[tuple[int, float]] = field(default_factory=list)
    cpu_s: float = 0.0
    load: float = 0.0


def images() -> list[list[bytes]]:
    """PNG files of small parts with one ball."""
    made = []
    for seed in range(DIFFERENT):
        scene = bgars.Scene.ball_array(1, 1, jitter=bgars.Jitter(4.0, 1.0, 2.0), seed=seed)
        camera = bgars.Camera(pixel_pitch_um=PIXEL_UM, shape=(SIDE_PX, SIDE_PX))
        capture, _ = bgars.simulate(scene, bgars.LightRig.ring(LIGHTS), bgars.Material(), camera)
        made.append([iio.imwrite("<bytes>", image, extension=".png") for image in capture.images])
    return made


def station(folder: Path, name: str, parts: int, *, instant: bool) -> Run:
    """Drop parts, one when the one before is told."""
    inbox = folder / "inbox"
    inbox.mkdir(parents=True)
    (folder / "capture.toml").write_text(RIG, encoding="utf-8")
    files = images()
    run = Run(name)
    with socket.create_server(("127.0.0.1", 0)) as plc:
        plc.settimeout(LONGEST_S)
        line = ["watch", inbox, "-o", folder / "store", "--rig", folder / "capture.toml", "--trigger", "ready"]
        line += ["--tcp", f"127.0.0.1:{plc.getsockname()[1]}"]
        program = [sys.executable, __file__, "--serve"] if instant else [sys.executable, "-m", "bgars"]
        watch = subprocess.Popen([*program, *map(str, line)], stdout=subprocess.DEVNULL)
        try:
            started_s = 0.0
            for number in range(parts):
                run.latencies_s.append(one_part(inbox / f"SN{number:05d}", files[number % DIFFERENT], plc))
                started_s = started_s or cpu_of(watch.pid)
                if (number + 1) % LOOK_EVERY == 0 or number == 0:
                    run.memory_mb.append((number + 1, memory_of(watch.pid)))
                    sys.stderr.write(f"{name}: {number + 1} of {parts}, {run.memory_mb[-1][1]:.1f} MB\n")
            run.cpu_s = cpu_of(watch.pid) - started_s
        finally:
            watch.terminate()
            watch.wait(LONGEST_S)
    run.load = os.getloadavg()[0]
    stored = bgars.open_store(folder / "store").query("select count(distinct serial) n from parts")["n"][0].as_py()
    assert stored == parts, f"{stored} of {parts} parts are in the store"
    return run


def one_part(place: Path, files: list[bytes], plc: socket.socket) -> float:
    """Write the images of a part, then the trigger; return the seconds until its line comes."""
    place.mkdir()
    for light, content in enumerate(files):
        (place / f"light_{light:02d}.png").write_bytes(content)
    start = time.perf_counter()
    (place / "ready").touch()
    connection, _ = plc.accept()
    with connection:
        text = b"".join(iter(lambda: connection.recv(4096), b""))
    seconds = time.perf_counter() - start
    assert f"serial={place.name} ".encode() in text, text
    return seconds


def cpu_of(pid: int) -> float:
    """Processor seconds of a process."""
    values = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(values[11]) + int(values[12])) / os.sysconf("SC_CLK_TCK")


def memory_of(pid: int) -> float:
    """Resident memory of a process, MB."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmRSS:")) / 1e3


def serve() -> None:
    """Be the watch, with an inspection that answers at once: what is around it is left."""
    from bgars.cli import main as bgars_main  # noqa: PLC0415 - only here
    from bgars.io.provenance import capture_files, checksums  # noqa: PLC0415
    from bgars.line import job  # noqa: PLC0415

    known: list[bgars.PartResult] = []

    def instant(capture: bgars.Capture, *_: object, **__: object) -> bgars.PartResult:
        if not known:
            known.append(bgars.inspect(capture, check=False))
        return replace(known[0], capture=capture.name, files=checksums(capture_files(capture)))

    job.inspected = instant  # type: ignore[assignment]
    sys.argv = [sys.argv[0], *sys.argv[2:]]
    bgars_main()


def growth(run: Run) -> tuple[float, float, float]:
    """Memory after a tenth of the parts, at the end, and its slope between them, kB a part."""
    parts, memory = (np.array(values) for values in zip(*run.memory_mb, strict=True))
    settled = parts >= parts[-1] / 10
    slope = np.polyfit(parts[settled], memory[settled], 1)[0] if settled.sum() > 1 else 0.0
    return float(memory[settled][0]), float(memory[-1]), float(1e3 * slope)


def table(runs: list[Run]) -> Iterator[str]:
    """The lines of the page."""
    loads = " and ".join(f"{run.load:.1f}" for run in runs)
    yield (
        f"**A station, by `make watch-station`:** parts with one ball, {SIDE_PX} x {SIDE_PX} pixels, {LIGHTS} lights, "
        f"one after the other; `bgars watch` as a process of its own, polling as it does by default; load {loads} on "
        f"{os.cpu_count()} processors."
    )
    yield ""
    yield f"| | {' | '.join(run.name for run in runs)} |"
    yield "|---|" + "---:|" * len(runs)
    rows = {
        "parts": [f"{len(run.latencies_s)}" for run in runs],
        "from the last image (the trigger) to the line for the PLC, median": [
            f"{1e3 * statistics.median(run.latencies_s):.0f} ms" for run in runs
        ],
        "the same, 99th percentile": [f"{1e3 * np.percentile(run.latencies_s, 99):.0f} ms" for run in runs],
        "the same, longest": [f"{1e3 * max(run.latencies_s):.0f} ms" for run in runs],
        "the process, CPU a part": [f"{1e3 * run.cpu_s / max(len(run.latencies_s) - 1, 1):.0f} ms" for run in runs],
        "memory after a tenth of the parts": [f"{growth(run)[0]:.0f} MB" for run in runs],
        "memory at the end": [f"{growth(run)[1]:.0f} MB" for run in runs],
        "slope from the one to the other, a part": [f"{growth(run)[2]:.1f} kB" for run in runs],
    }
    for name, cells in rows.items():
        yield f"| {name} | {' | '.join(cells)} |"


def main() -> None:
    """Run, say what was measured, and put it on the page."""
    if sys.argv[1:2] == ["--serve"]:
        serve()
        return
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--parts", type=int, default=1000, help="parts that are inspected")
    options.add_argument("--instant", type=int, default=5000, help="parts whose inspection answers at once")
    options.add_argument("--rows", type=Path, nargs="+", help="runs that were kept by --keep, instead of new ones")
    options.add_argument("--keep", type=Path, help="JSON file for the runs")
    options.add_argument("--docs", action="store_true", help="rewrite the table of docs/line.md")
    given = options.parse_args()
    kinds = (("inspected", given.parts, False), ("inspection answers at once", given.instant, True))
    runs = [Run(**each) for path in given.rows or () for each in json.loads(path.read_text(encoding="utf-8"))]
    with tempfile.TemporaryDirectory() as place:
        for name, parts, instant in kinds:
            if parts and not given.rows:
                runs.append(station(Path(place) / name.replace(" ", "-"), name, parts, instant=instant))
    lines = list(table(runs))
    sys.stdout.write("\n".join(lines) + "\n")
    if given.keep:
        kept = [asdict(run) | {"latencies_s": [round(each, 4) for each in run.latencies_s]} for run in runs]
        given.keep.write_text(json.dumps(kept) + "\n", encoding="utf-8")
    if given.docs:
        text = PAGE.read_text(encoding="utf-8")
        head, tail = text.split(BEGIN)[0], text.split(END)[1]
        PAGE.write_text(f"{head}{BEGIN}\n{chr(10).join(lines)}\n{END}{tail}", encoding="utf-8")


if __name__ == "__main__":
    main()
