"""Threads that a call asks for by their number are kept for the next one; what they do meanwhile, and in a fork."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
from typing import TYPE_CHECKING

import bgars
import numpy as np
import pytest

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="counts the threads of a process as Linux shows them")

START = """
import json, os, sys, time
import numpy as np, bgars

def work(threads):
    facing = np.broadcast_to(np.float32([0, 0, 1]), (40, 40, 3))
    return float(bgars.integrate_normals(facing, threads=threads).height_px[0, 0])

def tasks():
    return set(os.listdir("/proc/self/task"))

before = tasks()
"""


def run(script: str) -> object:
    """What a fresh process prints, as JSON."""
    run = subprocess.run(
        [sys.executable, "-c", START + script], capture_output=True, text=True, check=True, timeout=120
    )
    return json.loads(run.stdout)


def test_a_call_takes_the_threads_of_the_one_before() -> None:
    counts = run("""
work(3)
first = tasks() - before
work(3)
same = tasks() - before
work(2)
print(json.dumps([len(first), len(same - first), len(tasks() - before)]))
""")
    assert counts == [3, 0, 5]


def test_the_pools_of_four_numbers_of_threads_are_kept() -> None:
    counts = run("""
def kept(expected):
    end = time.monotonic() + 30  # threads that are not kept end by themselves
    while len(tasks() - before) != expected and time.monotonic() < end:
        time.sleep(0.05)
    return len(tasks() - before)

for threads in (10, 11, 12, 13):
    work(threads)
four = kept(46)
work(14)
print(json.dumps([four, kept(50)]))
""")
    assert counts == [46, 50], "the one that was not used for longest goes first"


def test_threads_do_nothing_while_nobody_calls() -> None:
    spent_s = run("""
work(2), work(None)
time.sleep(0.2)
start = time.process_time()
time.sleep(1)
print(json.dumps(time.process_time() - start))
""")
    assert isinstance(spent_s, float)
    assert spent_s < 0.1, "of a second"


def test_a_fork_starts_threads_of_its_own() -> None:
    found = run("""
import signal
work(2), work(3), work(None)
child = os.fork()
if child == 0:
    signal.alarm(60)
    results = [work(2), work(None), work(2), work(200), work(3)]
    os._exit(0 if results == [0.0] * 5 else 1)
print(json.dumps([os.waitpid(child, 0)[1], work(2)]))
""")
    assert found == [0, 0.0]


@pytest.mark.parametrize("method", ["fork", "spawn"])
def test_processes_of_multiprocessing_work_after_the_first_call(tmp_path: Path, method: str) -> None:
    program = tmp_path / "program.py"
    program.write_text(
        START
        + f"""
import multiprocessing

if __name__ == "__main__":
    work(None), work(2)
    with multiprocessing.get_context("{method}").Pool(2) as pool:
        results = pool.map_async(work, [None, 2, None, 3]).get(timeout=60)
    print(json.dumps([results, work(None)]))
""",
        encoding="utf-8",
    )
    done = subprocess.run([sys.executable, program], capture_output=True, text=True, check=True, timeout=120)
    assert json.loads(done.stdout) == [[0.0] * 4, 0.0]


@pytest.mark.parametrize("threads", [2, None])
def test_calls_at_the_same_time_give_the_same(threads: int | None) -> None:
    normals = np.random.default_rng(5).normal([0, 0, 3], 0.1, (150, 150, 3)).astype(np.float32)
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    expected = bgars.integrate_normals(normals).height_px
    found: list[bool] = []

    def calls() -> None:
        found.extend(
            np.array_equal(bgars.integrate_normals(normals, threads=threads).height_px, expected) for _ in "abc"
        )

    callers = [threading.Thread(target=calls) for _ in range(4)]
    for caller in callers:
        caller.start()
    for caller in callers:
        caller.join()
    assert found == [True] * 12


def test_a_call_in_the_progress_of_another_has_threads_too() -> None:
    directions = bgars.LightRig.ring(8).directions
    images = np.random.default_rng(7).integers(20, 200, (8, 600, 600), dtype=np.uint8)
    inner: list[bgars.NormalField] = []

    def call(_: float) -> None:
        inner.append(bgars.estimate_normals(images, directions, method="lambertian", threads=2))

    bgars.estimate_normals(images, directions, method="blind", threads=2, progress=call)  # a second or so
    expected = bgars.estimate_normals(images, directions, method="lambertian")
    np.testing.assert_array_equal(inner[0].normals, expected.normals)
