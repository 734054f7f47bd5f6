"""A watch whose inspection is instant, so that kills hit what comes around it; run as a program, or imported."""

from __future__ import annotations

import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import bgars
import imageio.v3 as iio
import numpy as np
from bgars.io.provenance import capture_files, checksums
from bgars.line import job
from stored_parts import part

RIG = "pixel_pitch_um = 10.0\n[lights]\nring = { count = 4, elevation_deg = 45.0 }\n"
SEED = 62


def drop(inbox: Path, name: str, seed: int) -> None:
    """A part as a camera's software writes it: a folder, images one by one, no description."""
    folder = inbox / name
    folder.mkdir()
    for light in range(4):
        image = np.random.default_rng([seed, light]).integers(0, 200, (5, 6), np.uint8)
        iio.imwrite(folder / f"img{light}.png", image)


def instant(capture: bgars.Capture, *_: object, **__: object) -> bgars.PartResult:
    return replace(part(0), capture=capture.name, method="reflectance", files=checksums(capture_files(capture)))


def command(inbox: Path, store: Path, *options: str) -> list[str]:
    rig = inbox.parent / "rig.toml"
    rig.write_text(RIG)
    arguments = ["watch", inbox, "-o", store, "--rig", rig, "--count", "4", "--settle", "0.05", "--poll", "0.02"]
    return [sys.executable, __file__, *map(str, arguments), *options]


def kill_often(inbox: Path, store: Path, kills: int, parts: int) -> Iterator[tuple[int, int, int]]:
    """Drop parts, kill the watch at random times; yield parts in the inbox, done, and in the store, after each kill."""
    draw = random.Random(SEED)
    dropped = 0
    for kill in range(kills):
        while dropped < parts * (kill + 1) // kills:
            drop(inbox, f"P{dropped:04d}", dropped)
            dropped += 1
        running = subprocess.Popen(command(inbox, store), stdout=subprocess.PIPE, text=True)
        assert running.stdout is not None
        # A life is counted from its first part, else most kills would hit the start of the program.
        if draw.random() < 0.8 and any(path.name.startswith("P") for path in inbox.iterdir()):
            running.stdout.readline()
        time.sleep(draw.uniform(0.0, 0.5))
        running.kill()
        running.communicate()
        yield census(inbox, store)
    # With nothing left to do the end may come before the program listens to it.
    ends = {0} if any(path.name.startswith("P") for path in inbox.iterdir()) else {0, -signal.SIGTERM}
    running = subprocess.Popen(command(inbox, store), stdout=subprocess.DEVNULL)
    deadline = time.monotonic() + 120
    while any(path.name.startswith("P") for path in inbox.iterdir()) and time.monotonic() < deadline:
        time.sleep(0.05)
    running.terminate()
    assert running.wait(30) in ends
    yield census(inbox, store)


def census(inbox: Path, store: Path) -> tuple[int, int, int]:
    waiting = {path.name for path in inbox.iterdir() if path.name.startswith("P")}
    done = {path.name for path in inbox.glob("_done/*/*")}
    if not (store / "store.json").is_file():
        return len(waiting), len(done), 0
    serials = bgars.open_store(store).query("select serial from parts")["serial"].to_pylist()
    assert len(set(serials)) == len(serials), "twice in the store"
    assert done <= set(serials), "moved, but not in the store"
    return len(waiting), len(done), len(serials)


def main() -> None:
    """``killed_watch.py watch ...``: the command; ``killed_watch.py FOLDER KILLS PARTS``: the long test."""
    if sys.argv[1] == "watch":
        job.inspected = instant
        from bgars.cli import main as bgars_main  # noqa: PLC0415 - the inspection is replaced first

        bgars_main()
        return
    folder, kills, parts = Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
    inbox = folder / "in"
    inbox.mkdir(parents=True)
    last = (0, 0, 0)
    for at, last in enumerate(kill_often(inbox, folder / "store", kills, parts), 1):
        dropped = parts * min(at, kills) // kills
        if last[0] + last[1] != dropped:
            sys.exit(f"after kill {at}: {last[0]} in the inbox and {last[1]} done, of {dropped}: lost")
    left = list(inbox.glob("_failed/*/*"))
    if last != (0, parts, parts) or left:
        sys.exit(f"in the end {last} in inbox, done and store, of {parts}; {len(left)} failed")
    sys.stdout.write(f"{kills} kills, {parts} parts: each is in the store once, none is lost\n")


if __name__ == "__main__":
    main()
