"""Rewrite the measured tables of docs/line.md: `python docs/make_line.py` (ten minutes; leave the machine alone)."""

from __future__ import annotations

import argparse
import json
import os
import platform
import re
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import bgars
import imageio.v3 as iio
from bgars.io.provenance import capture_files, checksums
from bgars.line import demo
from bgars.line.batch import store_outcome
from bgars.line.inbox import Inbox
from bgars.line.job import Job, run_job
from bgars.line.notify import Notifier
from bgars.line.warm import warm_up
from bgars.line.watch import Watch

T = TypeVar("T")
PAGE = Path(__file__).parent / "line.md"
BEGIN, END = "<!-- measured: begin -->", "<!-- measured: end -->"
WANTED_S = 1.0
SIDE_PX, PIXEL_UM, BALLS = 2048, 5.1, 10


def main() -> None:
    """Measure, and put the tables between the marks."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--parts", type=int, default=24, help="parts of a batch")
    options.add_argument("--cycles", type=int, default=5, help="large parts that are watched")
    options.add_argument("--stored", type=int, default=1000, help="parts in the store that is asked")
    options.add_argument("--only-watch", action="store_true", help="leave the tables of batch and store as they are")
    options.add_argument("--only-batch", action="store_true", help="leave the tables of watch and store as they are")
    given = options.parse_args()
    if given.only_batch:
        only_batch(given.parts)
        return
    if given.only_watch:
        only_watch(given.cycles)
        return
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        top = heading()
        watched, large_cpu_s = watch_table(folder, given.cycles)
        tables = [top, *batch_table(folder, given.parts, large_cpu_s), *watched, *store_table(folder, given.stored)]
    text = PAGE.read_text(encoding="utf-8")
    head, tail = text.split(BEGIN)[0], text.split(END)[1]
    PAGE.write_text(f"{head}{BEGIN}\n{chr(10).join(tables)}\n{END}{tail}", encoding="utf-8")


def only_batch(parts: int) -> None:
    """Measure the tables of a batch again, and put them in the place of the old ones."""
    text = PAGE.read_text(encoding="utf-8")
    before, _, rest = text.partition("**Batch:**")
    old, mark, after = rest.partition("**Watch:**")
    found = re.search(r"4 megapixels, ([0-9.]+) CPU s", old)
    assert found is not None, "the page has no earlier tables"
    with tempfile.TemporaryDirectory() as place:
        tables = batch_table(Path(place), parts, float(found[1]))
    PAGE.write_text(f"{before}{chr(10).join(tables)}\n{mark}{after}", encoding="utf-8")


def only_watch(cycles: int) -> None:
    """Measure the table of a watched part again, and put it in the place of the old one."""
    text = PAGE.read_text(encoding="utf-8")
    before, _, rest = text.partition("**Watch:**")
    after = rest[rest.index("**Store:**") :]
    with tempfile.TemporaryDirectory() as place:
        lines, _ = watch_table(Path(place), cycles)
    PAGE.write_text(f"{before}{chr(10).join(lines)}\n{after}", encoding="utf-8")


def heading() -> str:
    """What the tables were measured on."""
    load = os.getloadavg()[0]
    name = next(
        (line.split(":")[1].strip() for line in Path("/proc/cpuinfo").read_text().splitlines() if "model name" in line),
        platform.processor(),
    )
    busy = f"load {load:.1f} when it began" if load > 1 else "otherwise idle"
    return (
        f"## Measured\n\nBy `make line` on {os.cpu_count()} processors ({name}), {busy}. On a busy "
        f"machine wall times say little: "
        "compare the CPU seconds.\n"
    )


def batch_table(folder: Path, parts: int, large_cpu_s: float) -> list[str]:
    """Parts a minute with one and two processes, and what follows for more."""
    captures = folder / "captures"
    captures.mkdir()
    for number in range(parts):
        demo.drop_part(captures, number, parts)
        (captures / demo.serial_of(number) / "capture.toml").write_text(demo.RIG)
    (folder / "part.toml").write_text(demo.RECIPE)
    load = os.getloadavg()[0]
    rows, cpu_s = [], {}
    for processes in (1, 2):
        told, used = run_batch(folder, captures, processes)
        # Once more, now that the store knows every part: what remains is the start, and reading.
        _, start = run_batch(folder, captures, processes)
        cpu_s[processes] = (used - start) / parts
        rows.append((processes, 60 * told["inspected"] / told["seconds"], used, start, used / told["seconds"]))
    append_s = append_time(folder, captures / demo.serial_of(0))
    base = rows[0]
    lines = [
        f"**Batch:** {parts} parts of nine balls, 290 x 290 pixels, eight lights, one thread per process; load "
        f"{load:.1f} when it began.\n",
        "| processes | parts per minute | efficiency (wall) | CPU s of all | of it the start | efficiency (CPU) "
        "| without the start | processors used |",
        "|---:|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for processes, rate, used, start, had in rows:
        wall = rate / (processes * base[1])
        lines.append(
            f"| {processes} | {rate:.1f} | {wall:.2f} | {used:.1f} | {start:.1f} | {base[2] / used:.2f} "
            f"| {cpu_s[1] / cpu_s[processes]:.2f} | {had:.2f} of {processes} |"
        )
    lines += [
        "",
        "Efficiency (CPU) is the CPU time of one process for all parts, divided by that of two: the cost of running in "
        "parallel. The start is the CPU time of the same command when the store knows all parts; it occurs once, "
        "whatever their number. Rates beyond two processes are calculated: the process that writes the store needs "
        f"{1e3 * append_s:.0f} ms per part, which limits any number of workers; sent images pass a network of 1 Gbit/s "
        "(32 MB for a part of 4 megapixels and eight lights).\n",
        f"| workers | parts per minute, these | limited by | parts per minute, 4 megapixels, "
        f"{large_cpu_s:.1f} CPU s, images sent | limited by |",
        "|---:|---:|---|---:|---|",
    ]
    for workers in (4, 16, 64):
        small = bound({"inspection": 60 * workers / cpu_s[2], "store": 60 / append_s})
        large = bound({"inspection": 60 * workers / large_cpu_s, "network": 60 * 125e6 / 32e6, "store": 60 / append_s})
        lines.append(f"| {workers} | {small[1]:.0f} | {small[0]} | {large[1]:.0f} | {large[0]} |")
    return [*lines, ""]


def run_batch(folder: Path, captures: Path, processes: int) -> tuple[dict[str, float], float]:
    """Run the command; return what it tells and the CPU seconds of it and of its processes."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    line = ["batch", captures, "-r", folder / "part.toml", "-o", folder / f"store{processes}"]
    line += ["--processes", processes, "--threads", 1, "--json"]
    done = subprocess.run([sys.executable, "-m", "bgars", *map(str, line)], capture_output=True, text=True, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    told: dict[str, float] = json.loads(done.stdout)
    return told, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def bound(rates: dict[str, float]) -> tuple[str, float]:
    """What is slowest, and its rate."""
    return min(rates.items(), key=lambda pair: pair[1])


def append_time(folder: Path, capture: Path) -> float:
    """Median seconds of an append."""
    store = bgars.open_store(folder / "appended", create=True)
    (outcome,) = run_job(Job(str(capture)))
    assert outcome.result is not None
    seconds = []
    for number in range(30):
        named = replace(outcome, result=replace(outcome.result, serial=f"N{number}"))
        start = time.perf_counter()
        store_outcome(named, store)
        seconds.append(time.perf_counter() - start)
    return statistics.median(seconds)


def watch_table(folder: Path, cycles: int) -> tuple[list[str], float]:
    """Seconds from the last image to the result, of a part with 100 balls at 4 megapixels."""
    inbox = folder / "inbox"
    inbox.mkdir()
    scene = bgars.Scene.ball_array(BALLS, BALLS, jitter=bgars.Jitter(4.0, 1.0, 2.0), seed=1)
    camera = bgars.Camera(pixel_pitch_um=PIXEL_UM, shape=(SIDE_PX, SIDE_PX))
    capture, _ = bgars.simulate(scene, bgars.LightRig.ring(demo.LIGHTS), bgars.Material(), camera)
    rig = folder / "capture.toml"
    rig.write_text(demo.RIG.replace("16.0", str(PIXEL_UM)))
    store = bgars.open_store(folder / "watched", create=True)
    watch = Watch(
        Inbox(inbox, count=None, trigger="ready", settle_s=0.0),
        store,
        None,
        rig,
        inbox / "_done",
        inbox / "_failed",
        notifier=Notifier(line_file=str(folder / "line")),
        say=lambda _line: None,
    )
    warm_up(store)  # as the command does
    load = os.getloadavg()[0]
    walls, cpus = [], []
    split: dict[str, list[float]] = {}
    for number in range(cycles + 1):
        part = inbox / f"SN{number}"
        part.mkdir()
        for light, image in enumerate(capture.images):
            iio.imwrite(part / f"light_{light:02d}.png", image)
        rig_seconds = time.perf_counter()
        (part / "ready").touch()
        cpu = time.process_time()
        assert watch.step()
        walls.append(time.perf_counter() - rig_seconds)
        cpus.append(time.process_time() - cpu)
        done = next(inbox.glob(f"_done/*/SN{number}"))
        for name, seconds in split_of(done, folder / "split", number).items():
            split.setdefault(name, []).append(seconds)
    rest = slice(1, None)
    verdict = "met" if statistics.median(walls[rest]) <= WANTED_S else "**not met**"
    rows = {
        "from the last image (the trigger) to the line for the PLC, wall": statistics.median(walls[rest]),
        "the same, longest": max(walls[rest]),
        "the same, first part of the process": walls[0],
        "the same, CPU s": statistics.median(cpus[rest]),
        **{f"of it {name}, CPU s": statistics.median(seconds[rest]) for name, seconds in split.items()},
    }
    lines = [
        f"**Watch:** parts with {BALLS * BALLS} balls, {SIDE_PX} x {SIDE_PX} pixels, eight lights, 8 "
        f"bit; {cycles} parts after a first one; load {load:.1f} when it began. "
        f"Wanted: {WANTED_S:.1f} s, which is {verdict}.\n",
        "| | s |",
        "|---|---:|",
        *(f"| {name} | {value:.2f} |" for name, value in rows.items()),
        "",
    ]
    return lines, statistics.median(cpus[rest])


def split_of(capture: Path, store: Path, number: int) -> dict[str, float]:
    """CPU seconds of what is done with a part, one after the other."""
    taken: dict[str, float] = {}

    def timed(name: str, work: Callable[[], T]) -> T:
        start = time.process_time()
        made = work()
        taken[name] = time.process_time() - start
        return made

    read = timed("reading the images", lambda: bgars.read_capture(capture))
    timed("their checksums", lambda: checksums(capture_files(read)))
    timed("the check", lambda: bgars.check(read))
    result = timed("the inspection", lambda: bgars.inspect(read, check=False))
    result = replace(result, serial=f"SN{number}", inspected_utc="2026-01-31T12:00:00Z")
    timed("the store", lambda: bgars.open_store(store, create=True).append(result))
    return taken


def store_table(folder: Path, parts: int) -> list[str]:
    """Size of a store, and what questions take."""
    result = next(iter(bgars.read_results([folder / "watched"], where="serial = 'SN0'")[0]))[1]
    store = bgars.open_store(folder / "asked", create=True)
    appends = []
    for number in range(parts):
        start = time.perf_counter()
        store.append(replace(result, serial=f"SN{number:05d}", inspected_utc=f"2026-01-{1 + number % 5:02d}T12:00:00Z"))
        appends.append(time.perf_counter() - start)
    start = time.perf_counter()
    files = store.compact()
    compaction_s = time.perf_counter() - start
    size = sum(path.stat().st_size for path in store.folder.rglob("*.parquet"))
    asked = {}
    for name, sql in {
        "yield by day": "select day, count(*) filter (verdict = 'pass') / count(*) from parts group by day",
        "the ten balls that fail most": "select name, count(*) filter (verdict = 'fail') n from balls "
        "group by name order by n desc limit 10",
        "uncertainty by cause": "select reading, cause, median(u_um) from budgets group by reading, cause",
    }.items():
        start = time.perf_counter()
        store.query(sql)
        asked[name] = time.perf_counter() - start
    lines = [
        f"**Store:** {parts} parts of 100 balls, five days.\n",
        "| | |",
        "|---|---:|",
        f"| append, median (longest) | {1e3 * statistics.median(appends):.0f} ms ({1e3 * max(appends):.0f} ms) |",
        f"| compaction of {files['files_before']} files to {files['files_after']} | {compaction_s:.1f} s |",
        f"| on disk, a part | {size / parts / 1e3:.0f} kB |",
        *(f"| question: {name} | {seconds:.2f} s |" for name, seconds in asked.items()),
    ]
    return [*lines, ""]


if __name__ == "__main__":
    main()
